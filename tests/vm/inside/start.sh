# The guest's first program on the machine's files: drivers, the real udevd, then the agent that does what tests ask.
export PATH=/usr/sbin:/usr/bin:/sbin:/bin HOME=/root PYTHONDONTWRITEBYTECODE=1 OPENBLAS_NUM_THREADS=1 LC_ALL=C.UTF-8
for module in $(cat "$FOLDER/modules.txt"); do busybox insmod "$module" || echo "cannot load $module"; done
/lib/systemd/systemd-udevd --daemon
echo "guest: drivers and udevd after $(cut -d' ' -f1 /proc/uptime) s"
"$PYTHON" -m tests.vm.inside.agent "$PORT" 2>&1
echo "guest: agent ended with $?"
echo o > /proc/sysrq-trigger
sleep 10
