"""Kernel modules of an unpacked kernel package: which there are, and in which order they load."""

import lzma
import re
from collections.abc import Iterable
from pathlib import Path


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
