"""The chips that the firmware runs on, as `board.toml` in a folder of `firmware/boards` tells them.

Beside each image that comes with this package lies a copy of the file that it was built by.
"""

import hashlib
import tomllib
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from gellight.base.errors import InputError
from gellight.ring.firmware.image import from_uf2

CHECKOUT = Path(__file__).parents[4]  # the folder that holds host/
PACKAGED = Path(__file__).parent
PREFIX, TOLD = "gellight-", "board.toml"
DEFAULT = "rp2040"
"""the target that the emulator runs"""


@dataclass(frozen=True, kw_only=True)
class Target:
    """A chip: what builds its image, how its boot loader is known, and boards that have it."""

    name: str
    """of its folder"""
    chip: str
    family: int
    """of its UF2 files"""
    drive: str
    """Board-ID of its boot loader"""
    usb: tuple[int, int]
    """vendor and product of its boot loader"""
    shares: tuple[str, ...]
    """folders whose sources it shares"""
    zig: str
    gcc: str
    """processor, by the names of the compilers"""
    boot2: bool
    """the flash begins with 256 bytes that have a checksum of their own"""
    boards: dict[str, dict[str, Any]]
    text: str
    """of the file"""

    @property
    def image(self) -> Path:
        """The UF2 file that comes with this package."""
        return PACKAGED / f"{PREFIX}{self.name}.uf2"


def read_target(path: Path, name: str) -> Target:
    """Read a `board.toml`; InputError where it lacks something."""
    text = path.read_text()
    try:
        told: dict[str, Any] = {"boards": {}} | tomllib.loads(text)
        told |= {key: tuple(told[key]) for key in ("usb", "shares")}
        return Target(name=name, text=text, **told)
    except (tomllib.TOMLDecodeError, KeyError, TypeError) as error:
        raise InputError(f"{path} does not describe a board ({error}): compare it with that of rp2040") from error


@cache
def packaged() -> dict[str, Target]:
    """Return the targets whose images come with this package, by their names."""
    files = sorted(PACKAGED.glob(f"{PREFIX}*.toml"))
    return {name: read_target(path, name) for path in files if (name := path.stem.removeprefix(PREFIX))}


def target_of(family: int) -> Target:
    """Return the target of a UF2 family; InputError for one that is not known."""
    for target in packaged().values():
        if target.family == family:
            return target
    known = ", ".join(target.chip for target in packaged().values())
    raise InputError(f"the firmware is for another chip (family 0x{family:08x}), not for {known}: take one of theirs")


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
