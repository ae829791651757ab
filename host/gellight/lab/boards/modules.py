"""The controllers that the carrier takes as modules on pin headers: what is at each of their pins."""

from dataclasses import dataclass

from gellight.base.errors import InputError
from gellight.lab.boards.footprints import module
from gellight.lab.boards.model import GROUND, Footprint, Item, Point
from gellight.ring.boards import Board, CarrierPins

VBUS, LOGIC = "VBUS", "3V3"
Label = int | str
"""a GPIO by its number, or the name of a net, or something that stays free"""


@dataclass(frozen=True, kw_only=True)
class Module:
    """A controller: its pins down the left row, then up the right one, as an integrated circuit counts them."""

    item: Item
    pins: tuple[Label, ...]
    rows_mm: float
    """between its two rows of pins"""
    body: Point
    """width and height, mm"""

    @property
    def footprint(self) -> Footprint:
        """Its holes."""
        return module(self.item.value.replace(" ", "_"), range(1, 1 + len(self.pins)), self.rows_mm, self.body)


_G = GROUND
_PICO: tuple[Label, ...] = (
    0, 1, _G, 2, 3, 4, 5, _G, 6, 7, 8, 9, _G, 10, 11, 12, 13, _G, 14, 15,
    16, 17, _G, 18, 19, 20, 21, _G, 22, "RUN", 26, 27, _G, 28, "VREF", LOGIC, "3V3_EN", _G, "VSYS", VBUS,
)  # fmt: skip
# Pins by the makers' pinout drawings, with the USB socket up: left row downwards, right row upwards. The numbers of
# Pico, Pico 2 and XIAO are those of a distributor; that of the RP2040-Zero is not verified.
MODULES = {
    "pico": Module(
        item=Item("Raspberry Pi Pico", "Raspberry Pi", "SC0915", mounted=False),
        pins=_PICO, rows_mm=17.78, body=(21.5, 51.5),
    ),
    "pico2": Module(
        item=Item("Raspberry Pi Pico 2", "Raspberry Pi", "SC1631", mounted=False),
        pins=_PICO, rows_mm=17.78, body=(21.5, 51.5),
    ),
    "xiao": Module(
        item=Item("XIAO RP2040", "Seeed", "102010428", mounted=False),
        pins=(26, 27, 28, 29, 6, 7, 0, 1, 2, 4, 3, LOGIC, _G, VBUS),
        rows_mm=15.24, body=(18.0, 21.5),
    ),
    "rp2040-zero": Module(
        item=Item("RP2040-Zero", "Waveshare", "20187", mounted=False),
        pins=(VBUS, _G, LOGIC, 29, 28, 27, 26, 15, 14, 8, 7, 6, 5, 4, 3, 2, 1, 0),
        rows_mm=15.24, body=(18.2, 24.0),
    ),
}  # fmt: skip
"""by the name of their preset in the firmware"""


def find_module(name: str) -> Module:
    """Return a controller by its name; InputError for one that has no carrier."""
    if name not in MODULES:
        raise InputError(f"there is no carrier for a board {name!r}: choose {', '.join(MODULES)}")
    return MODULES[name]


def carrier_pins(preset: Board) -> CarrierPins:
    """Return the GPIOs that the carrier uses beside a preset's; InputError for a board whose `board.toml` has none."""
    if preset.carrier is None:
        raise InputError(f"there is no carrier for a {preset.name}: choose {', '.join(MODULES)}")
    return preset.carrier
