"""Compile the firmware: one command, the same bytes from the same compiler, no SDK."""

import hashlib
import importlib.util
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from gellight.base.errors import InputError
from gellight.base.writing import write_file
from gellight.ring.firmware.image import flash_image, from_uf2, to_uf2

IMAGE = Path(__file__).parent / "gellight-rp2040.uf2"
CHECKOUT = Path(__file__).parents[4]
_COMMON = (
    "-std=c11", "-Os", "-g0", "-ffreestanding", "-nostdlib", "-fno-common", "-fno-jump-tables",
    "-ffunction-sections", "-fdata-sections", "-Wall", "-Wextra", "-Wconversion", "-Werror",
    "-Wl,--gc-sections", "-Wl,-e,start", "-Wl,--build-id=none",
)  # fmt: skip


def committed_image() -> bytes:
    """Return the flash image that comes with this package, its checksum verified."""
    file = IMAGE.read_bytes()
    expected = IMAGE.with_suffix(".sha256").read_text().split()[0]
    actual = hashlib.sha256(file).hexdigest()
    if actual != expected:
        raise InputError(f"{IMAGE} is damaged (SHA-256 {actual}, not {expected}): install gellight again")
    return from_uf2(file)


def read_image(path: Path) -> bytes:
    """Return the flash image of a UF2 file; InputError where it cannot be read or is none."""
    try:
        return from_uf2(path.read_bytes())
    except OSError as error:
        raise InputError(f"cannot read {path} ({error.strerror}): give a UF2 file") from error


def compiler(name: str) -> list[str]:
    """Return the command of `zig` (from PyPI's ziglang) or `gcc` (Debian's gcc-arm-none-eabi)."""
    if name == "zig":
        if importlib.util.find_spec("ziglang") is None:
            raise InputError('the compiler is missing: pip install "gellight[firmware]"')
        return [sys.executable, "-m", "ziglang", "cc", "-target", "thumb-freestanding-eabi", "-mcpu=cortex_m0plus",
                "-fno-sanitize=all", "-fno-builtin"]  # fmt: skip
    if name == "gcc":
        found = shutil.which("arm-none-eabi-gcc")
        if found is None:
            raise InputError("arm-none-eabi-gcc is missing: sudo apt-get install gcc-arm-none-eabi")
        return [found, "-mcpu=cortex-m0plus", "-mthumb", "-fno-builtin"]
    raise InputError(f"there is no compiler {name!r}: choose zig or gcc")


def sources(checkout: Path) -> list[Path]:
    """Return the files of the RP2040's image in a fixed order."""
    board, core = checkout / "firmware/boards/rp2040", checkout / "firmware/core"
    if not (core / "protocol.h").is_file():
        raise InputError(
            f"{checkout} does not hold the sources of the firmware: clone GelLight's repository, give --checkout FOLDER"
        )
    return [board / "boot2.S", *sorted(board.glob("*.c")), *sorted(core.glob("*.c"))]


def build_elf(checkout: Path = CHECKOUT, *, compiler_name: str = "zig") -> bytes:
    """Compile and link; a compiler's complaint becomes an InputError."""
    # Relative names, so that no path of this machine gets into the file.
    names = [str(path.relative_to(checkout)) for path in sources(checkout)]
    command = compiler(compiler_name)
    board = "firmware/boards/rp2040"
    with tempfile.TemporaryDirectory() as folder:
        elf = Path(folder) / "gellight.elf"
        arguments = [*command, *_COMMON, f"-I{board}", "-Ifirmware/core", "-T", f"{board}/board.ld", *names]
        done = subprocess.run([*arguments, "-o", str(elf)], cwd=checkout, capture_output=True, text=True, check=False)
        if done.returncode or done.stderr.strip():
            raise InputError(f"the firmware does not compile:\n{done.stderr.strip()}")
        return elf.read_bytes()


def build(checkout: Path = CHECKOUT, *, compiler_name: str = "zig") -> bytes:
    """Return the flash image made from the sources."""
    return flash_image(build_elf(checkout, compiler_name=compiler_name))


def write_image(image: bytes, path: Path = IMAGE) -> str:
    """Write a UF2 file and its checksum next to it; return the checksum. InputError where that is not possible."""
    file = to_uf2(image)
    digest = hashlib.sha256(file).hexdigest()
    for target, content in ((path, file), (path.with_suffix(".sha256"), f"{digest}  {path.name}\n".encode())):
        try:
            write_file(target, content)
        except OSError as error:
            raise InputError(f"cannot write {target} ({error.strerror}): choose another place") from error
    return digest
