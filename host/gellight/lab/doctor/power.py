"""Whether Linux has switched on all cameras and boards: it leaves a device dark that asks for more than its hub gives.

A hub without a power supply of its own gives 100 mA a port (USB 2.0, 7.2.1). A device that is refused is on the bus,
but has no node.
"""

from collections.abc import Collection, Iterator
from pathlib import Path

from gellight.ring.usb_numbers import is_board
from gellight.sensor.discovery import attribute
from gellight.sensor.findings import Finding, ok, problem

REMEDY = "use a hub with a power supply of its own, or a port of the computer for each"


def check_power(sysfs: Path, cameras: Collection[str]) -> Iterator[Finding]:
    """Name each board, and each camera at these USB ports, that Linux refused its current; nothing where there is none.

    Cameras that were refused have no node, and so are not known by port.
    """
    ours = [
        entry for entry in sorted((sysfs / "bus/usb/devices").glob("*-*"))
        if ":" not in entry.name and (entry.name in cameras or is_board(*_identity(entry)))
    ]  # fmt: skip
    refused = [entry for entry in ours if attribute(entry / "bConfigurationValue") == ""]
    for entry in refused:
        text = (
            f"{attribute(entry / 'product') or entry.name} at USB {entry.name} asks for more current than its hub gives"
        )
        yield problem("power", f"{text}, so Linux does not switch it on", REMEDY)
    if ours and not refused:
        yield ok("power", "every port gives what is asked for")


def _identity(device: Path) -> tuple[int, int, str]:
    vendor, product = (int(attribute(device / name) or "0", 16) for name in ("idVendor", "idProduct"))
    return vendor, product, attribute(device / "product")
