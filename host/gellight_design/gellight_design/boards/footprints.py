"""Land patterns, by the data sheets of the parts: pads from the middle of the part, x right, y up."""

from gellight_design.boards.model import Footprint, Pad, Point

# Four pads anticlockwise from the upper left. WS2812B-2020: 1 DOUT, 2 GND, 3 DIN, 4 VDD; WS2812B (5050): 1 VDD, 2 DOUT,
# 3 GND, 4 DIN.


def _corners(name: str, at: Point, size: Point, room: Point) -> Footprint:
    x, y = at
    places = ((-x, y), (-x, -y), (x, -y), (x, y))
    return Footprint(name, tuple(Pad(str(1 + n), place, size) for n, place in enumerate(places)), room)


def _pair(name: str, x: float, size: Point, room: Point) -> Footprint:
    return Footprint(name, (Pad("1", (-x, 0.0), size), Pad("2", (x, 0.0), size)), room)


def contacts(count: int, pitch: float, size: Point) -> Footprint:
    """Return the contacts of a flexible tail: a row along x, the first at (0, 0), with no paste."""
    pads = tuple(Pad(str(1 + n), (n * pitch, 0.0), size, paste=False) for n in range(count))
    return Footprint("FFC_tail", pads, (count * pitch, size[1]), ((count - 1) * pitch / 2, 0.0))


LED_2020 = _corners("WS2812B-2020", (0.915, 0.55), (0.7, 0.7), (2.6, 2.2))
LED_5050 = _corners("WS2812B-5050", (2.45, 1.65), (1.5, 0.9), (6.5, 5.2))
CHIP_0603 = _pair("0603", 0.8, (0.85, 0.95), (2.65, 1.15))
