"""The wiring as a picture: strip and carrier at one scale, what is plugged where, and what each pin is."""

from collections.abc import Iterator
from math import degrees

from gellight.lab.boards.model import Arc, Board, Line, Part, Path, Point, turned

LETTER_MM = 1.7
APART_MM = 34.0
"""between strip and carrier, for the labels"""
INK = {"5V": "#d6453d", "VBUS": "#d6453d", "5V_FUSED": "#d6453d", "GND": "#555", "3V3": "#d98324"}
SIGNAL = "#3b6fd4"


def wiring_svg(strip: Board, carrier: Board) -> str:
    """Return the picture: the strip with its tail at the left, the carrier at the right, both seen from their parts."""
    left, low, right, high = _extent(strip.outline)
    width, height = _extent(carrier.outline)[2:]
    x, middle = right + APART_MM, (low + high) / 2
    body = [
        f'<g transform="translate({-left:.3f} {high:.3f})">', *_drawn(strip), "</g>",
        f'<g transform="translate({x - left:.3f} {high - middle + height / 2:.3f})">', *_drawn(carrier),
        *_labels(carrier), "</g>",
        *_captions(x - left, width, high - low),
    ]  # fmt: skip
    whole = x - left + width + 16, high - low + 22
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{whole[0]:.1f}mm" height="{whole[1]:.1f}mm" '
        f'viewBox="-3 -3 {whole[0] + 6:.1f} {whole[1] + 6:.1f}" style="background:#fff">' + "\n".join(body) + "</svg>\n"
    )


def _extent(paths: tuple[Path, ...]) -> tuple[float, float, float, float]:
    """Return left, bottom, right and top of an outline."""
    points = [path.at(n / 90) if isinstance(path, Arc) else path.start for path in paths for n in range(91)]
    return (
        min(x for x, _ in points), min(y for _, y in points), max(x for x, _ in points), max(y for _, y in points)
    )  # fmt: skip


def _drawn(board: Board) -> Iterator[str]:
    """Yield outline, parts and pads; y is turned over."""
    way = " ".join(_command(path) for path in board.outline)
    start = board.outline[0].start
    yield f'<path d="M{_at(start)} {way} Z" fill="#f3ead0" stroke="#444" stroke-width=".25"/>'
    for part in board.parts:
        if part.item.number:
            corners = " ".join(_at(corner) for corner in _corners(part))
            yield f'<polygon points="{corners}" fill="#fff" stroke="#444" stroke-width=".12"/>'
    for pad in board.pads():
        (width, height), ink = pad.pad.size, INK.get(pad.net, SIGNAL if pad.net else "#bbb")
        yield (
            f'<rect x="{-width / 2:.3f}" y="{-height / 2:.3f}" width="{width:.3f}" height="{height:.3f}" fill="{ink}" '
            f'transform="translate({_at(pad.at)}) rotate({-degrees(pad.turn_rad):.2f})"/>'
        )
    for part in board.parts:
        if part.item.number and min(part.footprint.room) > 1.4:
            yield _text(_middle(part), part.reference, "middle")


def _labels(carrier: Board) -> Iterator[str]:
    """Yield the net at each connected pin of the controller and of the connectors."""
    for part in carrier.parts:
        if part.reference not in ("U1", "J1", "J2"):
            continue
        for pad in part.pads():
            if pad.net:
                yield _label(part, pad.at, pad.net)


def _label(part: Part, at: Point, net: str) -> str:
    if part.reference == "J2":
        return _text((at[0], at[1] - 2.6), net.removeprefix("TRIGGER_"), "middle", 1.1)
    if part.reference == "J1":
        return _text((at[0] - 1.2, at[1] - 0.35), net, "end", 1.0)
    side = 1 if at[0] < part.at[0] else -1
    return _text((at[0] + side * 1.4, at[1] - 0.6), net, "start" if side > 0 else "end")


def _captions(x: float, width: float, height: float) -> Iterator[str]:
    lines = (
        "left: the strip from its LEDs; its tail goes into J1, contacts to the board",
        "U1: the controller, its USB socket up; J2: trigger in, out, ground, 3.3 V",
        "USB of controller and of camera go into one self-powered hub",
    )
    for n, line in enumerate(lines):
        yield _text((0.0, -(height + 6 + n * 3.6)), line, "start", 2.6)


def _corners(part: Part) -> list[Point]:
    (width, height), (x, y) = part.footprint.room, part.footprint.middle
    around = ((-1, 1), (1, 1), (1, -1), (-1, -1))
    return [turned((x + sx * width / 2, y + sy * height / 2), part.turn_rad, part.at) for sx, sy in around]


def _middle(part: Part) -> Point:
    x, y = turned(part.footprint.middle, part.turn_rad, part.at)
    return x, y - LETTER_MM / 3


def _command(path: Path) -> str:
    if isinstance(path, Line):
        return f"L{_at(path.end)}"
    large, sweep = int(abs(path.to_rad - path.from_rad) > 3.14159), int(path.to_rad < path.from_rad)
    return f"A{path.radius:.3f} {path.radius:.3f} 0 {large} {sweep} {_at(path.end)}"


def _text(at: Point, text: str, anchor: str, size: float = LETTER_MM) -> str:
    return (
        f'<text x="{at[0]:.2f}" y="{-at[1]:.2f}" text-anchor="{anchor}" '
        f'style="font:{size}px system-ui,sans-serif">{text}</text>'
    )


def _at(point: Point) -> str:
    return f"{point[0]:.3f} {-point[1]:.3f}"
