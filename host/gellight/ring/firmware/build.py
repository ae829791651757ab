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
from gellight.ring.firmware.image import flash_image, from_uf2, image_family, to_uf2
from gellight.ring.firmware.targets import CHECKOUT, Target, in_checkout, packaged, target_of
from gellight.ring.protocol import NO_PIN

DEFAULT = "rp2040"
"""the target that the emulator runs"""
_COMMON = (
    "-std=c11", "-Os", "-g0", "-ffreestanding", "-nostdlib", "-fno-common", "-fno-jump-tables",
    "-ffunction-sections", "-fdata-sections", "-Wall", "-Wextra", "-Wconversion", "-Werror",
    "-Wl,--gc-sections", "-Wl,-e,start", "-Wl,--build-id=none",
)  # fmt: skip
_INLINE_LITTLE = ("-mllvm", "-inline-threshold=5")
"""5 % smaller than by -Os alone, and not slower"""


def committed_image(name: str = DEFAULT) -> bytes:
    """Return the flash image for a target that comes with this package, its checksum verified."""
    path = packaged()[name].image
    file = path.read_bytes()
    expected = path.with_suffix(".sha256").read_text().split()[0]
    actual = hashlib.sha256(file).hexdigest()
    if actual != expected:
        raise InputError(f"{path} is damaged (SHA-256 {actual}, not {expected}): install gellight again")
    return from_uf2(file)


def read_image(path: Path) -> bytes:
    """Return the flash image of a UF2 file; InputError where it cannot be read or is none."""
    try:
        return from_uf2(path.read_bytes())
    except OSError as error:
        raise InputError(f"cannot read {path} ({error.strerror}): give a UF2 file") from error


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
