"""The first file system of the guest: busybox, the modules that reach the machine's files, and a script."""

import gzip
import stat
from collections.abc import Iterator
from pathlib import Path

from tests.vm.machine.packages import content

DRIVERS = ("virtio_pci", "virtio_net", "9p", "9pnet_virtio", "overlay")
SCRIPT = r"""#!/bin/busybox sh
export PATH=/bin
busybox mount -t proc proc /proc; busybox --install -s /bin
mount -t sysfs sys /sys; mount -t devtmpfs dev /dev
for module in /modules/*; do insmod $module || echo "cannot load $module"; done
share="trans=virtio,version=9p2000.L,msize=512000,ro,cache=loose"
mount -t 9p -o $share machine /machine || echo "cannot see the machine's files"
mount -t 9p -o $share tools /tools || echo "cannot see the unpacked tools"
mount -t tmpfs tmpfs /writes; mkdir /writes/upper /writes/work
mount -t overlay -o lowerdir=/tools:/machine,upperdir=/writes/upper,workdir=/writes/work overlay /root
for place in proc sys dev; do mkdir -p /root/$place; mount --move /$place /root/$place; done
mount -t tmpfs tmpfs /root/run
ifconfig lo up; ifconfig eth0 10.0.2.15 netmask 255.255.255.0 up
start=$(sed -n 's/.*guest\.start=\([^ ]*\).*/\1/p' /root/proc/cmdline)
exec switch_root /root /bin/sh $start
"""


def build(modules: list[Path], busybox: Path) -> bytes:
    """Return the compressed archive."""
    folders = ["bin", "proc", "sys", "dev", "modules", "machine", "tools", "writes", "root"]
    entries = [(name, stat.S_IFDIR | 0o755, b"") for name in folders]
    entries += [
        ("init", stat.S_IFREG | 0o755, SCRIPT.encode()),
        ("bin/busybox", stat.S_IFREG | 0o755, busybox.read_bytes()),
    ]
    entries += [
        (f"modules/{i:02}-{path.name.split('.')[0]}.ko", stat.S_IFREG | 0o644, content(path))
        for i, path in enumerate(modules)
    ]
    return gzip.compress(b"".join(archive([*entries, ("TRAILER!!!", 0, b"")])), 1)


def archive(entries: list[tuple[str, int, bytes]]) -> Iterator[bytes]:
    """Yield the members of a cpio archive of the form "newc"."""
    for number, (name, mode, data) in enumerate(entries, 1):
        fields = (number, mode, 0, 0, 1, 0, len(data), 0, 0, 0, 0, len(name) + 1, 0)
        head = b"070701" + b"".join(b"%08X" % field for field in fields) + name.encode() + b"\0"
        yield head + bytes(-len(head) % 4) + data + bytes(-len(data) % 4)
