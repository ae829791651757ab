"""What is ordered for the boards, by maker and the maker's part number.

Number, value and package of each part on the boards agree with distributors' pages and with bills of materials that
others published; the order of the LEDs' pads with KiCad libraries of others. Of `OTHERS` only the
camera's number was found elsewhere, the rest is not verified.
"""

from dataclasses import dataclass

from gellight.base.errors import InputError
from gellight.ring.boards import LEDS
from gellight_design.boards.footprints import LED_2020, LED_5050
from gellight_design.boards.model import Footprint, Item

CARRIERS = ("pico", "pico2", "xiao", "rp2040-zero")
"""controllers that have a carrier, by the name of their preset in the firmware"""
CAPACITOR_100N = Item("100 nF 50 V X7R", "Samsung", "CL10B104KB8NNNC")
THERMISTOR = Item("NTC 10 k, B 3380 K", "Murata", "NCP18XH103F03RB")
TAIL = Item("tail of the strip", "", "")


OTHERS = (
    (Item("USB camera, board of 32 x 32 mm, M12 lens", "innomaker", "U20CAM-1080P-S1"), 1, 1.0),
    (Item("M12 lens, 50 degrees horizontally on that camera", "any", ""), 1, 1.0),
    (Item("USB hub with a power supply of its own, 4 ports, 2 A", "any", ""), 1, 1.0),
    (Item("USB cable for the controller", "any", ""), 1, 1.0),
    (Item("disc of clear cast acrylic, 50 x 3 mm, film on both faces", "any", ""), 1, 1.0),
    (Item("clear silicone XP-565, g", "Silicones, Inc.", "XP-565"), 30, 15.0),
    (Item("silicone ink, grey, with activator and diluent, g", "Raw Material Suppliers", "Print-On"), 10, 3.0),
    (Item("release agent, spray can", "Mann", "Ease Release 200"), 1, 0.1),
    (Item("black ASA filament, g", "any", ""), 100, 80.0),
    (Item("cable gland M12 x 1.5", "any", ""), 1, 1.0),
    (Item("self-tapping screw 2 x 6 mm", "any", ""), 4, 4.0),
    (Item("pin header 2.54 mm, 20 pins", "any", ""), 2, 2.0),
    (Item("bearing ball of 4 mm radius", "any", ""), 1, 0.1),
)
"""what a sensor needs besides the boards' parts: how much for one, and for each of many"""


@dataclass(frozen=True)
class Lamp:
    """An LED that the strip may carry."""

    item: Item
    footprint: Footprint
    pins: dict[str, str]
    """number of the pad by what it is: VDD, GND, DIN, DOUT"""
    height_mm: float
    """of its package"""
    kind: str
    """its preset of the firmware, for its current"""
    node_mm: float
    """from its middle to where its data leaves the pads for the middle line of the strip"""

    @property
    def half_mm(self) -> float:
        """From its middle to the end of its pads, along the strip."""
        return max(pad.at[0] + pad.size[0] / 2 for pad in self.footprint.pads)

    @property
    def white_ma(self) -> float:
        """What it draws when it is white, 1 mA of its own included."""
        return 3 * LEDS[self.kind] / 1000 + 1


_PINS_2020 = {"DOUT": "1", "GND": "2", "DIN": "3", "VDD": "4"}
_PINS_5050 = {"VDD": "1", "DOUT": "2", "GND": "3", "DIN": "4"}
LAMPS = {
    "2020": Lamp(Item("WS2812B-2020", "Worldsemi", "WS2812B-2020"), LED_2020, _PINS_2020, 0.84, "ws2812b-2020", 1.45),
    "5050": Lamp(Item("WS2812B", "Worldsemi", "WS2812B-B/W"), LED_5050, _PINS_5050, 1.6, "ws2812b", 3.3),
}
"""by package"""


def find_lamp(package: str) -> Lamp:
    """Return the LED of a package; InputError for one that is not listed."""
    if package not in LAMPS:
        raise InputError(f"there is no LED in a package {package!r}: choose {' or '.join(LAMPS)}")
    return LAMPS[package]
