"""What an act is left without: room, rights, memory, and the time of day. Each is done in a process of its own."""

import ctypes
import os
import resource
import time
from pathlib import Path

from tests.soak.writers import Writer

_NEW_NAMES, _NEW_USERS = 0x00020000, 0x10000000
"""CLONE_NEWNS, CLONE_NEWUSER"""
_CAPABILITIES_3 = 0x20080522
_libc = ctypes.CDLL(None, use_errno=True)
ZONES = ("UTC", "Pacific/Kiritimati", "Pacific/Pago_Pago", "Asia/Kathmandu", "America/St_Johns", "Africa/Casablanca")


def without_growth(writer: Writer, home: Path, most: int) -> None:
    """Do the act where no file may be larger than `most` bytes."""
    resource.setrlimit(resource.RLIMIT_FSIZE, (most, resource.RLIM_INFINITY))
    writer.act(home)


def without_rights(writer: Writer, home: Path) -> None:
    """Do the act without the right of root to write everywhere."""
    none = (ctypes.c_uint32 * 6)()
    if _libc.capset((ctypes.c_uint32 * 2)(_CAPABILITIES_3, 0), none) != 0:
        raise SystemExit("capabilities cannot be given up")
    writer.act(home)


def set_modes(home: Path, folders: int, files: int) -> None:
    """Set the rights of all that is in a home."""
    for path in (home, *home.rglob("*")):
        path.chmod(folders if path.is_dir() else files)


def own_disk(place: Path, options: str) -> None:
    """Mount a disk in memory that this process alone sees."""
    user, group = os.getuid(), os.getgid()
    if _libc.unshare(_NEW_NAMES | _NEW_USERS) != 0:
        raise SystemExit("no namespaces here")
    Path("/proc/self/setgroups").write_text("deny")
    Path("/proc/self/uid_map").write_text(f"0 {user} 1")
    Path("/proc/self/gid_map").write_text(f"0 {group} 1")
    if _libc.mount(b"tmpfs", os.fsencode(place), b"tmpfs", 0, options.encode()) != 0:
        raise SystemExit(f"no disk in memory: {os.strerror(ctypes.get_errno())}")


def fill(home: Path, leave: int) -> None:
    """Fill the disk but for some bytes."""
    free = os.statvfs(home).f_bavail * os.statvfs(home).f_frsize
    (home / "filler").write_bytes(bytes(max(free - leave, 0)))


def without_memory(writer: Writer, home: Path, more: int) -> None:
    """Do the act with so many bytes of memory more than there are."""
    _libc.malloc_trim(0)
    (used,) = (line.split()[1] for line in Path("/proc/self/status").read_text().splitlines() if "VmData" in line)
    resource.setrlimit(resource.RLIMIT_DATA, (1024 * int(used) + more, resource.RLIM_INFINITY))
    writer.act(home)


def with_another_clock(writer: Writer, home: Path, step_s: float, moment_s: float, zone: str) -> None:
    """Do the act in a time zone, with a time of day that steps after `moment_s`; what is there is of another time.

    Only what asks Python's module `time` notices the step: a computer's clock is not ours to set.
    """
    os.environ["TZ"] = zone
    time.tzset()
    real_ns, begun_s = time.time_ns, time.monotonic()
    for path in home.rglob("*"):
        os.utime(path, times=(max(time.time() - step_s, 0.0),) * 2)

    def stepped_ns() -> int:
        stepped = time.monotonic() - begun_s >= moment_s
        return max(real_ns() + int(step_s * 1e9) * stepped, 0)

    time.time_ns, time.time = stepped_ns, lambda: stepped_ns() / 1e9
    writer.act(home)
