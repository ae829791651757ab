"""`gellight firmware`: the image of the light ring's board."""

import hashlib
from pathlib import Path
from typing import Annotated

import typer

from gellight.cli.lazy import lazy_group
from gellight.ring.firmware.image import image_crc
from gellight.ring.firmware.targets import committed_image, packaged, read_image
from gellight.ring.protocol import VERSION, schema_crc

app = typer.Typer(
    cls=lazy_group({}, {verb: f"is `python -m firmware.tools.{verb}` now" for verb in ("build", "generate")}),
    help="The firmware of the light ring: see it, flash it.",
    no_args_is_help=True,
)


@app.command("info")
def information() -> None:
    """Describe the images that come with this package."""
    for name, target in packaged().items():
        image = committed_image(name)
        print(f"image     {target.image}, for the {target.chip}")
        print(f"size      {len(image)} bytes of flash, CRC-32 {image_crc(image):08x}")
        print(f"SHA-256   {hashlib.sha256(target.image.read_bytes()).hexdigest()}")
    print(f"protocol  {VERSION[0]}.{VERSION[1]}, schema {schema_crc():08x}")


@app.command("flash")
def flash(
    port: Annotated[str | None, typer.Option(help="serial port of a running board, /dev/ttyACM0 or serial://")] = None,
    image: Annotated[Path | None, typer.Option(help="UF2 file instead of the one that comes with this package")] = None,
) -> None:
    """Flash the board at a port, or the one that waits in its boot loader; then open it and compare the image."""
    # the driver of the ring needs NumPy, which the other verbs do without
    from gellight.ring.firmware.flash import check_board, flash_board
    from gellight.ring.transport import board_ports, find_port

    content = read_image(image) if image else None
    name = find_port(port.removeprefix("serial://")) if port and port.startswith("serial://") else port
    before = {found.device for found in board_ports()} - {name}
    how, content = flash_board(content, port=name)
    print(how)
    print(f"runs at {check_board(content, before)}, image {image_crc(content):08x}")
