"""Land patterns, by the data sheets of the parts: pads from the middle of the part, x right, y up."""

from collections.abc import Sequence

from gellight.lab.boards.model import Footprint, Pad, Point

# Four pads anticlockwise from the upper left. WS2812B-2020: 1 DOUT, 2 GND, 3 DIN, 4 VDD; WS2812B (5050): 1 VDD, 2 DOUT,
# 3 GND, 4 DIN.


def _corners(name: str, at: Point, size: Point, room: Point) -> Footprint:
    x, y = at
    places = ((-x, y), (-x, -y), (x, -y), (x, y))
    return Footprint(name, tuple(Pad(str(1 + n), place, size) for n, place in enumerate(places)), room)


def _pair(name: str, x: float, size: Point, room: Point) -> Footprint:
    return Footprint(name, (Pad("1", (-x, 0.0), size), Pad("2", (x, 0.0), size)), room)


def _two_rows(name: str, count: int, pitch: float, x: float, size: Point, room: Point) -> Footprint:
    """Return a part with a row at each side, numbered anticlockwise from the upper left."""
    half = count // 2
    left = [(-x, (half - 1) * pitch / 2 - n * pitch) for n in range(half)]
    right = [(x, y) for _, y in reversed(left)]
    return Footprint(name, tuple(Pad(str(1 + n), at, size) for n, at in enumerate(left + right)), room)


def module(name: str, pins: Sequence[int], rows_mm: float, room: Point) -> Footprint:
    """Return the holes for a module on pin headers: two rows of 2.54 mm, numbered as in `_two_rows`."""
    rows = _two_rows(name, len(pins), 2.54, rows_mm / 2, (1.7, 1.7), room)
    pads = (
        Pad(str(pin), pad.at, pad.size, drill_mm=1.0, paste=False) for pin, pad in zip(pins, rows.pads, strict=True)
    )
    return Footprint(name, tuple(pads), room)


def header(name: str, count: int, pitch: float, room: Point, middle: Point) -> Footprint:
    """Return a row of holes along x, the first at (0, 0)."""
    pads = tuple(Pad(str(1 + n), (n * pitch, 0.0), (1.7, 1.95), 0.95, paste=False) for n in range(count))
    return Footprint(name, pads, room, middle)


def contacts(count: int, pitch: float, size: Point) -> Footprint:
    """Return the contacts of a flexible tail: a row along x, the first at (0, 0), with no paste."""
    pads = tuple(Pad(str(1 + n), (n * pitch, 0.0), size, paste=False) for n in range(count))
    return Footprint("FFC_tail", pads, (count * pitch, size[1]), ((count - 1) * pitch / 2, 0.0))


LED_2020 = _corners("WS2812B-2020", (0.915, 0.55), (0.7, 0.7), (2.6, 2.2))
LED_5050 = _corners("WS2812B-5050", (2.45, 1.65), (1.5, 0.9), (6.5, 5.2))
CHIP_0603 = _pair("0603", 0.8, (0.85, 0.95), (2.65, 1.15))
POLYFUSE = _pair("1812", 2.1375, (1.125, 3.4), (5.9, 3.9))
ELECTROLYTIC = _pair("CP_8x10.2", 3.25, (3.5, 2.5), (10.5, 8.8))
SOT23 = Footprint(
    "SOT-23",
    (Pad("1", (-0.94, 0.95), (1.4, 0.6)), Pad("2", (-0.94, -0.95), (1.4, 0.6)), Pad("3", (0.94, 0.0), (1.4, 0.6))),
    (3.9, 3.4),
)
SOT23_6 = _two_rows("SOT-23-6", 6, 0.95, 1.1375, (1.325, 0.6), (4.1, 3.4))
SOIC14 = _two_rows("SOIC-14", 14, 1.27, 2.475, (1.95, 0.6), (7.4, 9.2))
JST_XH4 = header("JST_B4B-XH-A", 4, 2.5, (13.4, 6.75), (3.75, -0.525))
_FFC = tuple(Pad(str(1 + n), (n - 2.5, 0.91), (0.4, 1.0)) for n in range(6))
FFC6 = Footprint(
    "Molex_200528-0060",
    (*_FFC, Pad("MP", (-5.3, -1.79), (2.0, 1.3)), Pad("MP", (5.3, -1.79), (2.0, 1.3))),
    (13.6, 6.6),
    (0.0, -1.39),
)
