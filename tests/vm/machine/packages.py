"""Debian packages for the virtual machine: downloaded and unpacked into a cache folder, never installed.

The folder's name is a digest of every package and its version, so that a new kernel gets a folder of its own. What the
machine has installed already is not unpacked again: the guest sees the machine's own files beneath.
"""

import contextlib
import gzip
import hashlib
import lzma
import os
import re
import shutil
import stat
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Iterator
from pathlib import Path

TOOLS = ("qemu-system-x86", "busybox-static", "udev")
KERNEL = "linux-image-amd64"
KERNEL_PARTS = ("./boot/vmlinuz-*", *(f"*/kernel/{part}*" for part in (
    "drivers/media/", "drivers/usb/", "drivers/virtio/", "drivers/net/virtio_net", "drivers/net/net_failover",
    "net/core/", "fs/9p/", "net/9p/", "fs/netfs/", "fs/fscache/", "fs/overlayfs/",
)))  # fmt: skip
REMEDY = "on Debian: sudo apt-get update; elsewhere these tests cannot run"


class Missing(Exception):  # noqa: N818  (it is a finding, not a fault)
    """The machine cannot provide the virtual machine; says what is missing and what to do."""


def run(*command: str, cwd: Path | None = None) -> str:
    """Return what a command prints; `Missing` in one line when it cannot do its work."""
    try:
        return subprocess.run(
            command, check=True, capture_output=True, text=True, cwd=cwd, env=os.environ | {"LC_ALL": "C"}
        ).stdout
    except FileNotFoundError:
        raise Missing(f"the virtual machine needs {command[0]}: {REMEDY}") from None
    except subprocess.CalledProcessError as error:
        told = (error.stderr or error.stdout).strip().splitlines() or ["no reason given"]
        raise Missing(f"`{' '.join(command)[:80]}` fails ({told[-1]}): {REMEDY}") from None


def cache_folder() -> Path:
    """Return the folder for everything that can be made again."""
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "gellight" / "vm"


def wanted() -> list[str]:
    """Return `package=version` of all that has to be unpacked: the kernel, and tools with what they depend on."""
    depends = run("apt-cache", "depends", KERNEL)
    image = re.search(r"Depends: (linux-image-\d\S+)", depends)
    if not image:
        raise Missing(f"the package lists know no {KERNEL}: {REMEDY}")
    plan = run("apt-get", "-s", "-y", "--no-install-recommends", "install", *TOOLS)
    tools = re.findall(r"^Inst (\S+)(?: \[\S+\])? \((\S+)", plan, re.MULTILINE)
    version = re.search(r"Candidate: (\S+)", run("apt-cache", "policy", image[1]))
    return sorted({f"{name}={number}" for name, number in tools} | {f"{image[1]}={version[1] if version else ''}"})


def unpacked() -> Path:
    """Return the folder with `kernel/` and `tools/`, made now if it is not there.

    Where the package lists are missing or old, root renews them; anyone else gets `Missing`.
    """
    try:
        return _unpacked()
    except Missing:
        if os.geteuid() or not shutil.which("apt-get"):
            raise
        run("apt-get", "update", "-qq")
        return _unpacked()


def _unpacked() -> Path:
    packages = wanted()
    folder = cache_folder() / hashlib.sha256("\n".join((*packages, *KERNEL_PARTS)).encode()).hexdigest()[:16]
    if not folder.exists():
        folder.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=folder.parent) as draft:
            fill(Path(draft), packages)
            with contextlib.suppress(OSError):  # somebody else has made the same meanwhile
                (Path(draft) / "files").rename(folder)
    return folder


def fill(draft: Path, packages: list[str]) -> None:
    """Download packages and unpack them into `draft`/files."""
    (draft / "files").mkdir()
    download(packages, draft / "packages")
    for package in sorted((draft / "packages").glob("*.deb")):
        unpack(package, draft / "files")
    merge_usr(draft / "files/tools")


def download(packages: list[str], folder: Path) -> None:
    """Fetch packages from the sources that the machine's apt knows."""
    folder.mkdir(parents=True)
    run("apt-get", "-q", "download", *packages, cwd=folder)


def unpack(package: Path, folder: Path) -> None:
    """Unpack a package, of the kernel only what the guest may load."""
    target = folder / ("kernel" if package.name.startswith("linux-image") else "tools")
    target.mkdir(exist_ok=True)
    chosen = ["--wildcards", *KERNEL_PARTS] if target.name == "kernel" else []
    with subprocess.Popen(["dpkg-deb", "--fsys-tarfile", str(package)], stdout=subprocess.PIPE) as archive:
        tar = ["tar", "-x", "--no-same-owner", "-C", str(target), *chosen]
        subprocess.run(
            tar, stdin=archive.stdout, check=not chosen, stderr=subprocess.DEVNULL
        )  # a pattern may match nothing


def merge_usr(tools: Path) -> None:
    """Move /bin, /sbin and /lib into /usr, as installed systems have it: else they would hide the machine's own."""
    for name in ("bin", "sbin", "lib", "lib64"):
        part = tools / name
        if part.is_dir() and not part.is_symlink():
            shutil.copytree(part, tools / "usr" / name, symlinks=True, dirs_exist_ok=True)
            shutil.rmtree(part)


def load_order(folder: Path, names: Iterable[str]) -> list[Path]:
    """Return the files of modules and of all that they depend on, dependencies first.

    What is not there as a file is built into the kernel.
    """
    files = {path.name.split(".")[0].replace("-", "_"): path for path in folder.rglob("*.ko*")}
    ordered: list[Path] = []

    def add(name: str) -> None:
        path = files.get(name.replace("-", "_"))
        if path is None or path in ordered:
            return
        for needed in depends(content(path)):
            add(needed)
        ordered.append(path)

    for name in names:
        add(name)
    return ordered


def depends(module: bytes) -> list[str]:
    """Return the modules that a module says it needs, in its `.modinfo`."""
    found = re.search(rb"\0depends=([^\0]*)\0", module)
    return [name for name in found[1].decode().split(",") if name] if found else []


def content(path: Path) -> bytes:
    """Return the module itself; newer Debian kernels keep it compressed."""
    data = path.read_bytes()
    return lzma.decompress(data) if path.suffix == ".xz" else data


FIRST_DRIVERS = ("virtio_pci", "virtio_net", "9p", "9pnet_virtio", "overlay")
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


def initramfs(modules: list[Path], busybox: Path) -> bytes:
    """Return the first file system of the guest: busybox, the modules that reach the machine's files, and a script."""
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


def main() -> int:
    """Make the virtual machine's files ready ahead of the tests; what is missing is told in one line."""
    try:
        unpacked()
    except Missing as finding:
        print(f"tests in the virtual machine are left out: {finding}", file=sys.stderr)
        return 2 if os.environ.get("GELLIGHT_NO_SKIPS") else 0
    return 0


if __name__ == "__main__":
    sys.exit(main())
