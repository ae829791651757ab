"""Compile the images: `python firmware/build.py`, with zig (of the extra `firmware`) or gcc."""

import argparse
import sys
from pathlib import Path

from gellight.base.errors import GellightError, InputError
from gellight.ring.firmware.build import DEFAULT, build, write_image
from gellight.ring.firmware.targets import CHECKOUT, in_checkout


def main() -> None:
    """Compile each target, or the one that is named, and write its image."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--compiler", default="zig", help="zig or gcc")
    options.add_argument("--out", type=Path, help="UF2 file; default: the one that comes with the package")
    options.add_argument("--target", help="a folder of firmware/boards; default: each, with --out rp2040")
    given = options.parse_args()
    if given.out and given.out.suffix.lower() != ".uf2":
        raise InputError(
            f"--out {given.out}: give a name that ends with .uf2; a file of another kind would be replaced"
        )
    found = in_checkout(CHECKOUT)
    for name in [given.target or DEFAULT] if given.out or given.target else found:
        image = build(target=name, compiler_name=given.compiler)
        path = given.out or found[name].image
        print(f"{path}: {len(image)} bytes, SHA-256 {write_image(image, path, found[name])}")


if __name__ == "__main__":
    try:
        main()
    except GellightError as error:
        sys.exit(f"{error}")
