"""Who has a device open, as far as this user may see."""

import os
from pathlib import Path


def holders(path: str | Path, *, proc: Path = Path("/proc")) -> list[tuple[int, str]]:
    """Return process number and command of everyone else who has a device open, as far as this user may see."""
    target = os.path.realpath(path)
    found = []
    for folder in sorted(proc.glob("[0-9]*"), key=lambda place: int(place.name)):
        if int(folder.name) != os.getpid() and _open_count(folder / "fd", target):
            found.append((int(folder.name), _command(folder)))
    return found


def holders_text(path: str | Path, *, proc: Path = Path("/proc")) -> str:
    """Return in words who has a device open."""
    found = holders(path, proc=proc)
    if found:
        return ", ".join(f"{command} (process {number})" for number, command in found)
    if _open_count(proc / str(os.getpid()) / "fd", os.path.realpath(path)) > 1:
        return "this programme itself, which has it open twice"
    return "a programme that this user may not see (`sudo $(command -v gellight) doctor` names it)"


def _open_count(folder: Path, target: str) -> int:
    try:
        return [str(entry.readlink()) for entry in folder.iterdir()].count(target)
    except OSError:  # another user's process, or one that has just ended
        return 0


def _command(folder: Path) -> str:
    try:
        return (folder / "comm").read_text().strip()
    except OSError:
        return "unknown"
