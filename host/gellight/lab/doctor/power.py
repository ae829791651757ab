"""Whether the USB ports give what cameras and light rings ask for, by `bMaxPower` and the hubs above them in sysfs.

A port of the computer or of a hub with a supply of its own gives 500 mA, one of a hub without it 100 mA, and such a
hub takes all that it hands on, and what it needs itself, from the port that it hangs at (USB 2.0, 7.2.1; USB 3 gives
900 and 150 mA). Linux leaves a device unconfigured that asks for more: it is on the bus, but has no node.
"""

from collections.abc import Collection, Iterator
from dataclasses import dataclass
from pathlib import Path

from gellight.ring.usb_numbers import is_board
from gellight.sensor.discovery import attribute
from gellight.sensor.findings import Finding, ok, problem

SUPER_SPEED_MBPS = 5000.0
SELF_POWERED = 0x40
"""in bmAttributes"""
FULL_MA, LEAST_MA = (500, 900), (100, 150)
"""of a port: USB 2, USB 3"""
UNIT_MA = (2, 8)
"""of bMaxPower in a descriptor"""
CONFIGURATION_AT, MAX_POWER_AT = 18, 8
"""in the file `descriptors`: behind that of the device, and in that of the configuration"""
REMEDY = "use a hub with a power supply of its own, or a port of the computer for each"


@dataclass(frozen=True, kw_only=True)
class Load:
    """A device that takes its current from the bus."""

    port: str
    name: str
    needs_ma: int
    configured: bool
    hub: Path
    """the folder of the hub it hangs at"""


def check_power(sysfs: Path, cameras: Collection[str]) -> Iterator[Finding]:
    """Compare what every board and the cameras at these USB ports ask for with what their hubs give.

    Nothing is said of devices that do not tell what they need.
    """
    loads = [load for load in _loads(sysfs) if load.port in cameras or is_board(*_identity(sysfs, load.port))]
    for hub in sorted({load.hub for load in loads}):
        yield from _check_hub(hub, [load for load in loads if load.hub == hub], list(_loads(sysfs, hub)))


def _check_hub(hub: Path, ours: list[Load], all_there: list[Load]) -> Iterator[Finding]:
    """Check each of our devices at a hub, then all of them together."""
    given_ma, place = _given_ma(hub), _place(hub)
    starved = [load for load in ours if not load.configured or load.needs_ma > given_ma]
    for load in starved:
        refused = "" if load.configured else ", so Linux does not switch it on"
        text = f"{load.name} at USB {load.port} asks for {load.needs_ma} mA, {place} gives {given_ma}{refused}"
        yield problem("power", text, REMEDY)
    total_ma, takes_ma = sum(load.needs_ma for load in all_there), _takes_ma(hub)
    asked = " and ".join(f"{load.name} {load.needs_ma} mA" for load in ours)
    if takes_ma is not None and total_ma + takes_ma > FULL_MA[_is_super(hub)]:
        text = f"all at {place} and it itself may draw {total_ma + takes_ma} mA ({asked}) through one port"
        yield problem("power", f"{text}, which gives {FULL_MA[_is_super(hub)]}", REMEDY)
    elif not starved:
        yield ok("power", f"{asked}: {place} gives {given_ma} mA a port")


def _place(hub: Path) -> str:
    if _is_root(hub):
        return "the computer"
    return f"the hub at USB {hub.name}, {'self-powered' if _has_supply(hub) else 'bus-powered'},"


def _is_root(hub: Path) -> bool:
    return hub.name.startswith("usb")


def _is_super(device: Path) -> bool:
    return float(attribute(device / "speed") or 0) >= SUPER_SPEED_MBPS


def _has_supply(hub: Path) -> bool:
    """Whether a hub has a supply of its own; one that does not say so has."""
    return bool(int(attribute(hub / "bmAttributes") or "40", 16) & SELF_POWERED)


def _given_ma(hub: Path) -> int:
    """Return what a port of this hub gives, mA."""
    return (FULL_MA if _is_root(hub) or _has_supply(hub) else LEAST_MA)[_is_super(hub)]


def _takes_ma(hub: Path) -> int | None:
    """Return what a hub without a supply needs itself, mA; None for one that hands on nothing of its port's."""
    return None if _is_root(hub) or _has_supply(hub) else _needs_ma(hub)


def _loads(sysfs: Path, hub: Path | None = None) -> Iterator[Load]:
    """Yield the devices on the bus, or those at one hub, that say what they need."""
    for entry in sorted((sysfs / "bus/usb/devices").glob("*-*")):
        folder = entry.resolve()
        needs_ma = _needs_ma(folder)
        if ":" in entry.name or not needs_ma or (hub is not None and folder.parent != hub):
            continue
        yield Load(
            port=entry.name, name=attribute(folder / "product") or entry.name, needs_ma=needs_ma,
            configured=attribute(folder / "bConfigurationValue") != "", hub=folder.parent,
        )  # fmt: skip


def _identity(sysfs: Path, port: str) -> tuple[int, int, str]:
    folder = sysfs / "bus/usb/devices" / port
    numbers = (int(attribute(folder / name) or "0", 16) for name in ("idVendor", "idProduct"))
    return (*numbers, attribute(folder / "product"))  # type: ignore[return-value]


def _needs_ma(device: Path) -> int:
    """Return what a device asks for, mA; 0 where it does not say. sysfs names it of configured devices alone."""
    if named := attribute(device / "bMaxPower").removesuffix("mA"):
        return int(named)
    try:
        descriptors = (device / "descriptors").read_bytes()
    except OSError:
        return 0
    at = CONFIGURATION_AT + MAX_POWER_AT
    return descriptors[at] * UNIT_MA[_is_super(device)] if len(descriptors) > at else 0
