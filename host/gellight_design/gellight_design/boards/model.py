"""What a circuit board is made of: mm, x right, y up, seen from the side of the parts; angles in rad, anticlockwise."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from math import cos, hypot, sin
from typing import Literal

Point = tuple[float, float]
Layer = Literal["F.Cu", "B.Cu"]
FRONT: Layer = "F.Cu"
BACK: Layer = "B.Cu"
GROUND = "GND"


def turned(point: Point, turn_rad: float, origin: Point = (0.0, 0.0)) -> Point:
    """Return a point turned about (0, 0), then moved by `origin`."""
    (x, y), c, s = point, cos(turn_rad), sin(turn_rad)
    return origin[0] + c * x - s * y, origin[1] + s * x + c * y


@dataclass(frozen=True)
class Pad:
    """A pad of a footprint, in the coordinates of the footprint."""

    number: str
    at: Point
    size: Point
    paste: bool = True
    """False: nothing is soldered by machine, as with the contacts of a tail"""


@dataclass(frozen=True)
class Footprint:
    """The land pattern of a part."""

    name: str
    pads: tuple[Pad, ...]
    room: Point
    """width and height of what the part takes of the board"""
    middle: Point = (0.0, 0.0)
    """of that room"""


@dataclass(frozen=True)
class Item:
    """What is ordered."""

    value: str
    maker: str
    number: str
    """the maker's part number; empty: nothing is bought for it"""


@dataclass(frozen=True)
class PlacedPad:
    """A pad where it is on the board."""

    part: str
    pad: Pad
    at: Point
    turn_rad: float
    net: str


@dataclass(frozen=True)
class Part:
    """A part on the board, and the net of each of its pads; a pad without a net is not connected."""

    reference: str
    item: Item
    footprint: Footprint
    at: Point
    turn_rad: float
    nets: Mapping[str, str]

    def pads(self) -> Iterator[PlacedPad]:
        """Yield its pads where they are."""
        for pad in self.footprint.pads:
            place = turned(pad.at, self.turn_rad, self.at)
            yield PlacedPad(self.reference, pad, place, self.turn_rad, self.nets.get(pad.number, ""))


@dataclass(frozen=True)
class Line:
    """A straight line."""

    start: Point
    end: Point

    @property
    def length_mm(self) -> float:
        """How long it is."""
        return hypot(self.end[0] - self.start[0], self.end[1] - self.start[1])


@dataclass(frozen=True)
class Arc:
    """A part of a circle about (0, 0), from one angle to another; anticlockwise if the second is larger."""

    radius: float
    from_rad: float
    to_rad: float

    def at(self, share: float) -> Point:
        """Return a point of it; 0 is its start, 1 its end."""
        turn = self.from_rad + share * (self.to_rad - self.from_rad)
        return self.radius * cos(turn), self.radius * sin(turn)

    @property
    def start(self) -> Point:
        """Where it begins."""
        return self.at(0)

    @property
    def end(self) -> Point:
        """Where it ends."""
        return self.at(1)

    @property
    def length_mm(self) -> float:
        """How long it is."""
        return abs(self.radius * (self.to_rad - self.from_rad))


Path = Line | Arc


@dataclass(frozen=True)
class Track:
    """Copper along a line or an arc."""

    path: Path
    width_mm: float
    layer: Layer
    net: str


@dataclass(frozen=True)
class Via:
    """A plated hole between the layers."""

    at: Point
    net: str
    size_mm: float = 0.6
    drill_mm: float = 0.3


@dataclass(frozen=True)
class Rules:
    """What the board house has to keep, mm."""

    clearance_mm: float
    edge_mm: float
    """from copper to the edge of the board"""
    thickness_mm: float
    copper_mm: float = 0.035


@dataclass(frozen=True)
class Board:
    """A whole board."""

    name: str
    title: str
    outline: tuple[Path, ...]
    """closed: each begins where the one before it ends"""
    rules: Rules
    parts: tuple[Part, ...]
    tracks: tuple[Track, ...]
    vias: tuple[Via, ...]
    notes: Mapping[str, tuple[Path, ...]] = field(default_factory=dict)
    """outlines for the board house by what they mean, as of a stiffener"""

    def pads(self) -> Iterator[PlacedPad]:
        """Yield the pads of all parts."""
        for part in self.parts:
            yield from part.pads()

    def nets(self) -> dict[str, set[tuple[str, str]]]:
        """Return the pads of each net: reference of the part and number of the pad."""
        found: dict[str, set[tuple[str, str]]] = {}
        for placed in self.pads():
            if placed.net:
                found.setdefault(placed.net, set()).add((placed.part, placed.pad.number))
        return found


def polygon(*points: Point) -> tuple[Line, ...]:
    """Return the closed outline through points."""
    return tuple(Line(start, end) for start, end in zip(points, (*points[1:], points[0]), strict=True))
