"""Build the core of the firmware to the libraries beside this file: `python -m gellight.lab.core_board.build`."""

from pathlib import Path

from gellight.reconstruction.native.build import compiled, write_libraries
from gellight.ring.firmware.targets import CHECKOUT

FOLDER = Path(__file__).parent
CHECKSUMS = FOLDER / "libraries.sha256"
_NAMED = "-install_name", "core_board.so"  # or the place where it was built gets in
TARGETS = {
    "linux-x86_64": ("x86_64-linux-musl", "-nostdlib"),
    "linux-aarch64": ("aarch64-linux-musl", "-nostdlib"),
    "darwin-x86_64": ("x86_64-macos", *_NAMED),
    "darwin-arm64": ("aarch64-macos", *_NAMED),
}
"""system and machine, as Python calls them: target for the compiler, and what it needs there"""
FLAGS = (
    "-std=c11", "-Os", "-fno-sanitize=all", "-fPIC", "-shared", "-g0", "-s", "-Wall", "-Wextra", "-Wconversion",
    "-Werror", "-fno-asynchronous-unwind-tables", "-fno-unwind-tables",
)  # fmt: skip
_FOR_LINUX = ("-Wl,--build-id=none", "-Wl,--hash-style=gnu")
_PLACES = "firmware/core", "firmware/boards/host"


def library_file(name: str) -> Path:
    """Return where the library for a system and machine lies."""
    return FOLDER / f"core_board-{name}.so"


def build(name: str, checkout: Path = CHECKOUT) -> bytes:
    """Compile one library from a checkout; InputError where the compiler is missing or complains."""
    flags = [*FLAGS, *(_FOR_LINUX if name.startswith("linux") else ())]
    files = [str(path.relative_to(checkout)) for place in _PLACES for path in sorted((checkout / place).glob("*.c"))]
    arguments = [*TARGETS[name], *flags, *(f"-I{place}" for place in _PLACES), *files]
    return compiled(f"the core of the firmware for {name}", checkout, arguments)


def main() -> None:
    """Build and write all libraries and their checksums."""
    write_libraries({library_file(name): build(name) for name in TARGETS}, CHECKSUMS)


if __name__ == "__main__":
    main()
