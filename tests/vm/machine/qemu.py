"""The virtual machine: Debian's kernel under qemu, this machine's files beneath it, and an agent that takes calls."""

import json
import os
import shlex
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from tests.vm.machine.packages import FIRST_DRIVERS, content, initramfs, load_order, unpacked

DRIVERS = ("vhci_hcd", "uvcvideo", "cdc_acm")
ON_DEMAND = ("vivid",)
BOOT_LIMIT_S = 270.0
"""on a machine that does nothing else it takes 30"""
ROOT = Path(__file__).parents[3]


class GuestError(AssertionError):
    """A function raised in the guest, or did not end."""


class Call:
    """A function that runs in the guest."""

    def __init__(self, lines: Iterator[str]) -> None:
        """Follow its answers."""
        self._lines = lines
        self._ended: dict[str, Any] | None = None

    def event(self, name: str) -> dict[str, Any]:
        """Wait for an event and return its facts."""
        found = self.next_event(name)
        if found is None:
            raise GuestError(f"the function returned {self.result()!r} without the event {name!r}")
        return found

    def next_event(self, name: str) -> dict[str, Any] | None:
        """Wait for an event and return its facts; None where the function returns before."""
        while self._ended is None:
            answer = self._next()
            if answer.get("event") == name:
                return answer
            if "result" in answer:
                self._ended = answer
        return None

    def result(self) -> Any:
        """Wait for the end and return the result."""
        while self._ended is None:
            answer = self._next()
            if "result" in answer:
                self._ended = answer
        return self._ended["result"]

    def _next(self) -> dict[str, Any]:
        line = next(self._lines, None)
        if line is None:
            raise GuestError("the guest has hung up: see its console")
        answer: dict[str, Any] = json.loads(line)
        if "error" in answer:
            raise GuestError(answer["error"])
        return answer


class Line:
    """A connection to the agent; it does one call after the other."""

    def __init__(self, connection: socket.socket) -> None:
        """Wait until the agent says that it is ready."""
        self._write = connection.makefile("w")
        self._lines = iter(connection.makefile("r"))
        ready = Call(self._lines).event("ready")
        self.name, self.uptime_s = str(ready["line"]), float(ready["uptime_s"])

    def start(self, call: str, *, limit_s: float = 30.0, **arguments: Any) -> Call:
        """Begin a function `module:function` of the package tests.vm.inside."""
        request = {"call": f"tests.vm.inside.{call}", "arguments": arguments, "limit_s": limit_s}
        print(json.dumps(request), file=self._write, flush=True)
        return Call(self._lines)

    def preload(self, *modules: str) -> None:
        """Import modules once for all later calls on this line: in an emulated machine it takes seconds."""
        print(json.dumps({"preload": modules}), file=self._write, flush=True)
        Call(self._lines).result()

    def run(self, call: str, *, limit_s: float = 30.0, **arguments: Any) -> Any:
        """Run a function and return its result."""
        return self.start(call, limit_s=limit_s, **arguments).result()


class Guest:
    """A booted guest whose agent is ready."""

    def __init__(self, lines: list[Line], folder: Path, process: subprocess.Popen[bytes]) -> None:
        """Take both lines; `folder` has the guest's console and what the machine lays ready for it."""
        self._process = process
        named = {line.name: line for line in lines}
        self.main, self.aside = named["main"], named["aside"]
        self.folder = folder
        self.run, self.start = self.main.run, self.main.start


def hardware_virtualisation() -> bool:
    """Whether KVM can run Debian's kernel; a /dev/kvm without these flags takes only guests made for it, and hangs."""
    flags = Path("/proc/cpuinfo").read_text().split()
    return os.access("/dev/kvm", os.W_OK) and ("vmx" in flags or "svm" in flags)


@contextmanager
def booted(folder: Path) -> Iterator[Guest]:
    """Boot a guest; `folder` takes its console. Raises `Missing` when this machine cannot."""
    base = unpacked()
    listener = socket.create_server(("127.0.0.1", 0))
    listener.settimeout(BOOT_LIMIT_S)
    console = folder / "console.txt"
    command = qemu(base, folder, console, listener.getsockname()[1])
    environment = os.environ | {"LD_LIBRARY_PATH": str(base / "tools/usr/lib/x86_64-linux-gnu")}
    with (folder / "qemu.txt").open("w") as said:
        process = subprocess.Popen(command, env=environment, stdin=subprocess.DEVNULL, stdout=said, stderr=said)
    try:
        yield Guest([Line(answered(listener, process, folder)) for _ in range(2)], folder, process)
    finally:
        process.kill()
        process.wait()
        listener.close()


def answered(listener: socket.socket, process: subprocess.Popen[bytes], folder: Path) -> socket.socket:
    """Return the connection of the agent; tell what qemu or the console said when there is none."""
    listener.settimeout(0.5)
    end = time.monotonic() + BOOT_LIMIT_S
    while time.monotonic() < end and process.poll() is None:
        try:
            connection, _ = listener.accept()
        except TimeoutError:
            continue
        connection.settimeout(BOOT_LIMIT_S)
        return connection
    told = [
        (folder / name).read_text(errors="replace")[:4000]
        for name in ("qemu.txt", "console.txt")
        if (folder / name).exists()
    ]
    raise RuntimeError("the guest did not start:\n" + "\n".join(told))


def qemu(base: Path, folder: Path, console: Path, port: int) -> list[str]:
    """Return the command that boots the guest."""
    kernel = next((base / "kernel/boot").glob("vmlinuz-*"))
    write_first_files(base, folder, kernel.name.removeprefix("vmlinuz-"))
    write_start(folder, port)
    program = Path("usr/bin/qemu-system-x86_64")
    tools = base / "tools" if (base / "tools" / program).exists() else Path("/")
    return [
        str(tools / program), "-L", str(tools / "usr/share/qemu"), "-L", str(tools / "usr/share/seabios"),
        *processor(), "-m", "1536", "-smp", "2", "-nodefaults", "-no-user-config", "-display", "none", "-no-reboot",
        "-serial", f"file:{console}", "-kernel", str(kernel), "-initrd", str(folder / "initramfs.gz"),
        "-append", f"console=ttyS0 quiet panic=-1 net.ifnames=0 mitigations=off guest.start={folder}/start.sh",
        "-netdev", "user,id=net", "-device", "virtio-net-pci,netdev=net,romfile=",
        *share("machine", Path("/")), *share("tools", base / "tools"),
    ]  # fmt: skip


def processor() -> list[str]:
    """Return the options that choose the processor: emulated unless KVM can run this kernel.

    The emulated one is a Nehalem, as newer ones do arithmetic that emulation does many times slower.
    """
    if hardware_virtualisation():
        return ["-accel", "kvm", "-cpu", "host"]
    return ["-accel", "tcg,thread=multi,tb-size=512", "-cpu", "Nehalem"]


def share(name: str, path: Path) -> list[str]:
    """Return the options that show a folder to the guest, to be read only."""
    how = f"local,id={name},path={path},security_model=none,multidevs=remap,readonly=on"
    return ["-fsdev", how, "-device", f"virtio-9p-pci,fsdev={name},mount_tag={name}"]


def write_first_files(base: Path, folder: Path, release: str) -> None:
    """Write the initramfs, and a list of the modules that the guest loads, in order."""
    modules = next((base / "kernel").rglob(f"modules/{release}"))
    busybox = next(path for root in (base / "tools", Path("/")) if (path := root / "usr/bin/busybox").exists())
    (folder / "initramfs.gz").write_bytes(initramfs(load_order(modules, FIRST_DRIVERS), busybox))
    at_boot = plain(load_order(modules, DRIVERS), folder)
    later = [path for path in plain(load_order(modules, ON_DEMAND), folder) if path not in at_boot]
    (folder / "modules.txt").write_text("".join(f"{path}\n" for path in at_boot))
    (folder / "on-demand.txt").write_text("".join(f"{path}\n" for path in later))


def write_start(folder: Path, port: int) -> None:
    """Write the guest's first script, with what it has to know before it."""
    known = {
        "FOLDER": folder,
        "PORT": port,
        "PYTHON": sys.executable,
        "PYTHONPATH": os.pathsep.join(str(ROOT / part) for part in ("host", "models", ".")),
    }
    told = "".join(f"export {name}={shlex.quote(str(value))}\n" for name, value in known.items())
    (folder / "start.sh").write_text(told + (ROOT / "tests/vm/inside/start.sh").read_text())


def plain(modules: list[Path], folder: Path) -> list[Path]:
    """Return modules as files that are not compressed."""
    files = []
    for path in modules:
        if path.suffix == ".ko":
            files.append(path)
        else:
            files.append(folder / path.name.removesuffix(path.suffix))
            files[-1].write_bytes(content(path))
    return files
