"""Compile the firmware: the same bytes from the same compiler, no SDK. `python -m firmware.tools.build --help`."""

import argparse
import hashlib
import importlib.util
import shutil
import struct
import subprocess
import sys
import tempfile
import zlib
from pathlib import Path

from gellight.base.errors import InputError
from gellight.base.writing import write_file
from gellight.ring.firmware.image import (
    BOOT2_BYTES,
    FLASH_BASE,
    HEADER,
    HEADER_MAGIC,
    VECTORS,
    image_family,
    to_uf2,
)  # fmt: skip
from gellight.ring.firmware.targets import CHECKOUT, DEFAULT, TOLD, Target, read_target, target_of
from gellight.ring.protocol import NO_PIN

_COMMON = (
    "-std=c11", "-Os", "-g0", "-ffreestanding", "-nostdlib", "-fno-common", "-fno-jump-tables",
    "-ffunction-sections", "-fdata-sections", "-Wall", "-Wextra", "-Wconversion", "-Werror",
    "-Wl,--gc-sections", "-Wl,-e,start", "-Wl,--build-id=none",
)  # fmt: skip
_ELF_HEAD = struct.Struct("<16sHHIIIIIHHHHHH")
_SEGMENT = struct.Struct("<8I")
_ARM = 40
_LOAD = 1
_INLINE_LITTLE = ("-mllvm", "-inline-threshold=5")
"""5 % smaller than by -Os alone, and not slower"""


def boot2_crc(boot2: bytes) -> int:
    """Return the checksum that the boot ROM demands: polynomial 0x04C11DB7, not reflected, not inverted at the end."""
    crc = 0xFFFFFFFF
    for byte in boot2:
        crc ^= byte << 24
        for _ in range(8):
            crc = ((crc << 1) ^ 0x04C11DB7 if crc & 0x80000000 else crc << 1) & 0xFFFFFFFF
    return crc


def compiler(name: str, target: Target) -> list[str]:
    """Return the command for a target of `zig` (from PyPI's ziglang) or `gcc` (Debian's gcc-arm-none-eabi)."""
    if name == "zig":
        if importlib.util.find_spec("ziglang") is None:
            raise InputError("the compiler is missing: pip install ziglang==0.17.0")
        return [sys.executable, "-m", "ziglang", "cc", "-target", "thumb-freestanding-eabi", f"-mcpu={target.zig}",
                "-fno-sanitize=all", "-fno-builtin", *_INLINE_LITTLE]  # fmt: skip
    if name == "gcc":
        found = shutil.which("arm-none-eabi-gcc")
        if found is None:
            raise InputError("arm-none-eabi-gcc is missing: sudo apt-get install gcc-arm-none-eabi")
        return [found, f"-mcpu={target.gcc}", "-mthumb", "-fno-builtin"]
    raise InputError(f"there is no compiler {name!r}: choose zig or gcc")


def folders(target: Target) -> list[str]:
    """Return where the sources of a target are, in a checkout: its own folder, those it shares, the core."""
    return [f"firmware/boards/{name}" for name in (target.name, *target.shares)] + ["firmware/core"]


def sources(checkout: Path, target: Target) -> list[Path]:
    """Return the files of an image in a fixed order."""
    found = [sorted((checkout / folder).glob(pattern)) for folder in folders(target) for pattern in ("*.S", "*.c")]
    return [path for paths in found for path in paths]


def thermistor_pin(target: Target) -> int:
    """Return the GPIO of the ring's NTC, by the carriers of a target's boards; NO_PIN where no board has a carrier."""
    pins = {board["carrier"]["thermistor"] for board in target.boards.values() if "carrier" in board}
    if len(pins) > 1:
        raise InputError(
            f"the carriers of {target.chip} have their thermistor at GPIO {sorted(pins)}: an image knows one"
        )
    return int(pins.pop()) if pins else NO_PIN


def in_checkout(checkout: Path = CHECKOUT) -> dict[str, Target]:
    """Return the targets of a checkout by their names."""
    files = sorted((checkout / "firmware/boards").glob(f"*/{TOLD}"))
    if not files:
        raise InputError(
            f"{checkout} does not hold the sources of the firmware: clone GelLight's repository, give --checkout FOLDER"
        )
    return {path.parent.name: read_target(path, path.parent.name) for path in files}


def find_target(name: str, checkout: Path = CHECKOUT) -> Target:
    """Return a target of a checkout; InputError for one that it does not have."""
    targets = in_checkout(checkout)
    if name not in targets:
        raise InputError(f"there is no target {name!r}: choose {', '.join(targets)}")
    return targets[name]


def build_elf(checkout: Path = CHECKOUT, *, target: str = DEFAULT, compiler_name: str = "zig") -> bytes:
    """Compile and link; a compiler's complaint becomes an InputError."""
    # Relative names, so that no path of this machine gets into the file.
    chosen = find_target(target, checkout)
    names = [str(path.relative_to(checkout)) for path in sources(checkout, chosen)]
    command, places = compiler(compiler_name, chosen), folders(chosen)
    with tempfile.TemporaryDirectory() as folder:
        elf = Path(folder) / "gellight.elf"
        told = [*(f"-I{place}" for place in places), f"-DTHERMISTOR_PIN={thermistor_pin(chosen)}u"]
        arguments = [*command, *_COMMON, *told, "-T", f"{places[0]}/board.ld", *names]
        done = subprocess.run([*arguments, "-o", str(elf)], cwd=checkout, capture_output=True, text=True, check=False)
        if done.returncode or done.stderr.strip():
            raise InputError(f"the firmware does not compile:\n{done.stderr.strip()}")
        return elf.read_bytes()


def build(checkout: Path = CHECKOUT, *, target: str = DEFAULT, compiler_name: str = "zig") -> bytes:
    """Return the flash image for a target made from the sources."""
    chosen = find_target(target, checkout)
    elf = build_elf(checkout, target=target, compiler_name=compiler_name)
    return flash_image(elf, family=chosen.family, boot2=chosen.boot2)


def flash_image(elf: bytes, *, family: int, boot2: bool) -> bytes:
    """Return what lies in flash from its first byte on, checksums of boot2, where there is one, and image included."""
    image = bytearray(_load(elf))
    image += bytes(-len(image) % 4)
    if boot2:
        image[BOOT2_BYTES - 4 : BOOT2_BYTES] = boot2_crc(bytes(image[: BOOT2_BYTES - 4])).to_bytes(4, "little")
    at = VECTORS + BOOT2_BYTES * boot2
    magic, *_ = HEADER.unpack_from(image, at)
    if magic != HEADER_MAGIC:
        raise InputError(f"the image has 0x{magic:08x} where its header belongs: check board.ld")
    body = bytes(image[at + HEADER.size :])
    HEADER.pack_into(image, at, HEADER_MAGIC, len(body), zlib.crc32(body), family)
    return bytes(image)


def _load(elf: bytes) -> bytes:
    """Place the segments by their load addresses; gaps are erased flash."""
    if elf[:6] != b"\x7fELF\x01\x01" or int.from_bytes(elf[18:20], "little") != _ARM:
        raise InputError("the linker's output is not a 32-bit little-endian ELF file for Arm")
    head = _ELF_HEAD.unpack_from(elf)
    offset, size, count = head[5], head[9], head[10]
    image = bytearray()
    for number in range(count):
        kind, at, _, address, filed, *_ = _SEGMENT.unpack_from(elf, offset + number * size)
        if kind != _LOAD or not filed:
            continue
        start = address - FLASH_BASE
        if start < 0:
            raise InputError(f"a segment would be loaded to 0x{address:08x}, which is not flash: check board.ld")
        image.extend(b"\xff" * (start + filed - len(image)))
        image[start : start + filed] = elf[at : at + filed]
    return bytes(image)


def write_image(image: bytes, path: Path, target: Target | None = None) -> str:
    """Write a UF2 file, its checksum and what its target is next to it; return the checksum.

    InputError where that is not possible.
    """
    file = to_uf2(image)
    told = target or target_of(image_family(image))
    digest = hashlib.sha256(file).hexdigest()
    texts = {".sha256": f"{digest}  {path.name}\n", ".toml": told.text}
    contents = {path: file} | {path.with_suffix(suffix): text.encode() for suffix, text in texts.items()}
    for place, content in contents.items():
        try:
            write_file(place, content)
        except OSError as error:
            raise InputError(f"cannot write {place} ({error.strerror}): choose another place") from error
    return digest


def main() -> None:
    """Compile the images that come with the package, or one of them to another file."""
    parser = argparse.ArgumentParser(prog="python -m firmware.tools.build", description=main.__doc__)
    parser.add_argument("--checkout", type=Path, default=CHECKOUT, help="sources; default: this checkout")
    parser.add_argument("--compiler", default="zig", help="zig (of the extra `firmware`) or gcc")
    parser.add_argument("--out", type=Path, help="UF2 file; default: the one that comes with the package")
    parser.add_argument("--target", help=f"a folder of firmware/boards; default: each, with --out {DEFAULT}")
    given = parser.parse_args()
    if given.out and given.out.suffix.lower() != ".uf2":
        parser.error(f"--out {given.out}: give a name that ends with .uf2; another file would be replaced")
    chosen = given.target or (DEFAULT if given.out else None)
    for name in [chosen] if chosen else in_checkout(given.checkout):
        target = find_target(name, given.checkout)
        image = build(given.checkout, target=name, compiler_name=given.compiler)
        path = given.out or target.image
        print(f"{path}: {len(image)} bytes, SHA-256 {write_image(image, path, target)}")


if __name__ == "__main__":
    try:
        main()
    except InputError as error:
        sys.exit(str(error))
