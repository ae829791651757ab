"""`gellight firmware`: the image of the light ring's board."""

import hashlib
from pathlib import Path
from typing import Annotated

import typer

from gellight.ring.firmware import build as building
from gellight.ring.firmware import generate as generating
from gellight.ring.firmware.build import CHECKOUT, IMAGE, committed_image
from gellight.ring.firmware.image import image_crc
from gellight.ring.protocol import VERSION, schema_crc

app = typer.Typer(help="The firmware of the light ring: what it is, build it, flash it.", no_args_is_help=True)
Checkout = Annotated[Path | None, typer.Option(help="sources; default: the checkout this package runs from")]


@app.command("info")
def information() -> None:
    """Describe the image that comes with this package."""
    image = committed_image()
    print(f"image     {IMAGE}")
    print(f"size      {len(image)} bytes of flash, CRC-32 {image_crc(image):08x}")
    print(f"SHA-256   {hashlib.sha256(IMAGE.read_bytes()).hexdigest()}")
    print(f"protocol  {VERSION[0]}.{VERSION[1]}, schema {schema_crc():08x}")


@app.command("generate")
def generate(checkout: Checkout = None) -> None:
    """Write the C header and the document of the protocol from its definition."""
    for path in generating.generate(checkout or CHECKOUT):
        print(f"wrote {path}")


@app.command("build")
def build(
    checkout: Checkout = None,
    compiler: Annotated[str, typer.Option(help="zig (of the extra `firmware`) or gcc")] = "zig",
    out: Annotated[Path | None, typer.Option(help="UF2 file; default: the one that comes with this package")] = None,
) -> None:
    """Compile the image."""
    image = building.build(checkout or CHECKOUT, compiler_name=compiler)
    digest = building.write_image(image, out or IMAGE)
    print(f"{out or IMAGE}: {len(image)} bytes, SHA-256 {digest}")


@app.command("flash")
def flash(
    port: Annotated[str | None, typer.Option(help="serial port of a running board, /dev/ttyACM0 or serial://")] = None,
    image: Annotated[Path | None, typer.Option(help="UF2 file instead of the one that comes with this package")] = None,
    drive: Annotated[Path | None, typer.Option(help="where the boot loader is mounted, if it is not found")] = None,
) -> None:
    """Flash the board at a port, or the one that waits in its boot loader; then open it and compare the image."""
    # the driver of the ring needs NumPy, which the other verbs do without
    from gellight.ring.firmware.flash import check_board, copy_uf2, flash_board
    from gellight.ring.transport import board_ports, find_port

    content = building.read_image(image) if image else committed_image()
    name = find_port(port.removeprefix("serial://")) if port and port.startswith("serial://") else port
    before = {found.device for found in board_ports()} - {name}
    if drive:
        copy_uf2(content, drive)
        print(f"copied to {drive}")
    else:
        print(flash_board(content, port=name))
    print(f"runs at {check_board(content, before)}, image {image_crc(content):08x}")
