"""Build the committed libraries of the frame path and of the simulated board: `python -m firmware.tools.libraries`.

The same sources and the same compiler (PyPI's `ziglang`, in the extra `firmware`) give the same bytes on every machine.
The libraries need nothing but memcpy and memset, so one serves every Linux, with glibc or musl.
"""

import hashlib
import importlib.util
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path

from gellight.base.errors import InputError
from gellight.base.writing import write_file
from gellight.lab.core_board import core
from gellight.reconstruction.native import library
from gellight.ring.firmware.targets import CHECKOUT

FRAME_PATHS: dict[str, tuple[str, ...]] = {
    "x86_64-v4": ("x86_64-linux-musl", "-mcpu=x86_64_v4", "-mprefer-vector-width=512"),
    "x86_64-v3": ("x86_64-linux-musl", "-mcpu=x86_64_v3"),
    "x86_64-v2": ("x86_64-linux-musl", "-mcpu=x86_64_v2"),
    "aarch64": ("aarch64-linux-musl", "-mcpu=generic"),
}
"""name of a library: target and processor for the compiler; v4 is AVX-512, v3 AVX2, v2 SSE4.2, aarch64 has NEON"""
# No -ffast-math: the code has to see NaN, and a library must not change how the whole process treats small numbers.
FLAGS = (
    "-std=c11", "-O3", "-ffp-contract=fast", "-fno-math-errno", "-fno-trapping-math", "-fno-signed-zeros",
    "-Wall", "-Wextra", "-Werror",
)  # fmt: skip
# Loops of unknown length are not unrolled: that makes libraries a tenth larger, and none faster.
_LIBRARY = (
    "-fno-sanitize=all", "-fPIC", "-shared", "-nostdlib", "-fvisibility=hidden", "-g0", "-s", "-Wl,--build-id=none",
    "-fno-asynchronous-unwind-tables", "-fno-unwind-tables", "-Wl,--hash-style=gnu", "-mllvm", "-unroll-runtime=false",
)  # fmt: skip


_NAMED = "-install_name", "core_board.so"  # or the place where it was built gets in
BOARDS: dict[str, tuple[str, ...]] = {
    "linux-x86_64": ("x86_64-linux-musl", "-nostdlib"),
    "linux-aarch64": ("aarch64-linux-musl", "-nostdlib"),
    "darwin-x86_64": ("x86_64-macos", *_NAMED),
    "darwin-arm64": ("aarch64-macos", *_NAMED),
}
"""system and machine, as Python calls them: target for the compiler, and what it needs there"""
_OF_BOARDS = (
    "-std=c11", "-Os", "-fno-sanitize=all", "-fPIC", "-shared", "-g0", "-s", "-Wall", "-Wextra", "-Wconversion",
    "-Werror", "-fno-asynchronous-unwind-tables", "-fno-unwind-tables",
)  # fmt: skip
_FOR_LINUX = ("-Wl,--build-id=none", "-Wl,--hash-style=gnu")
_PLACES = "firmware/core", "firmware/boards/host"


def sources() -> list[str]:
    """Return the names of the C files of the frame path in a fixed order."""
    return sorted(path.name for path in library.FOLDER.glob("*.c"))


def frame_path(name: str) -> bytes:
    """Compile one library of the frame path; InputError where the compiler is missing or complains."""
    arguments = [*FRAME_PATHS[name], *FLAGS, *_LIBRARY, *sources()]
    return compiled(f"the frame path for {name}", library.FOLDER, arguments)


def board(name: str, checkout: Path = CHECKOUT) -> bytes:
    """Compile one core of the firmware from a checkout; InputError where the compiler is missing or complains."""
    flags = [*_OF_BOARDS, *(_FOR_LINUX if name.startswith("linux") else ())]
    files = [str(path.relative_to(checkout)) for place in _PLACES for path in sorted((checkout / place).glob("*.c"))]
    arguments = [*BOARDS[name], *flags, *(f"-I{place}" for place in _PLACES), *files]
    return compiled(f"the core of the firmware for {name}", checkout, arguments)


def compiled(what: str, folder: Path, arguments: Sequence[str]) -> bytes:
    """Return a library that PyPI's compiler makes in a folder; InputError where it is missing or complains."""
    if importlib.util.find_spec("ziglang") is None:
        raise InputError("the compiler is missing: pip install ziglang==0.17.0")
    with tempfile.TemporaryDirectory() as made:
        out = Path(made) / "library.so"
        command = [sys.executable, "-m", "ziglang", "cc", "-target", *arguments, "-o", str(out)]
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
        if done.returncode or done.stderr.strip():
            raise InputError(f"{what} does not compile:\n{done.stderr.strip()}")
        return out.read_bytes()


def write_libraries(libraries: Mapping[Path, bytes], checksums: Path) -> None:
    """Write libraries and their checksums."""
    sums = []
    for path, content in libraries.items():
        write_file(path, content)
        sums.append(f"{hashlib.sha256(content).hexdigest()}  {path.name}\n")
        print(sums[-1].rstrip())
    write_file(checksums, "".join(sums).encode())


def main() -> None:
    """Build and write all libraries and their checksums."""
    write_libraries({library.library_file(name): frame_path(name) for name in FRAME_PATHS}, library.CHECKSUMS)
    write_libraries({core.library_file(name): board(name) for name in BOARDS}, core.CHECKSUMS)


if __name__ == "__main__":
    main()
