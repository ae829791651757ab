"""A plane of ground: all copper that a layer has room for, poured around what is there.

Islands that touch no copper of ground are left out, and so is what is narrower than `THIN_MM`. Pads of ground are
joined by four spokes, so that they can be soldered; their tracks stay, so no pad hangs at its spokes alone.
"""

from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, Any

from gellight.base.packages import needed
from gellight.lab.boards.model import BOTH, GROUND, Board, Layer, Line, PlacedPad, Point, Pour, turned

if TYPE_CHECKING:
    from shapely import Polygon

THIN_MM, GAP_MM, SPOKE_MM = 0.25, 0.3, 0.4
"""least width of the plane; from a pad of ground to the plane, and the width of its spokes"""
HOLE_MM, SPARE_MM = 0.1, 0.01
"""more than the clearance: to holes without copper, and to all else, as circles become polygons"""


def ground_planes(board: Board) -> tuple[Pour, ...]:
    """Return the pours of both layers of a board whose outline is a rectangle; InputError where shapely is missing."""
    with needed('pouring the ground plane needs a package: pip install "gellight[parts]"'):
        import shapely
    (left, bottom), (right, top) = board.outline[0].start, board.outline[1].end
    edge = board.rules.edge_mm + SPARE_MM
    room = shapely.box(left + edge, bottom + edge, right - edge, top - edge)
    pours = []
    for layer in BOTH:
        free = room - shapely.union_all(list(_others(board, layer)))
        ground = list(_ground(board, layer))
        gaps = shapely.union_all([shape.buffer(GAP_MM) for shape, pad in ground if pad])
        spokes = shapely.union_all([spoke for shape, pad in ground if pad for spoke in _spokes(pad)])
        wide = (free - (gaps - spokes)).buffer(-THIN_MM / 2, join_style="mitre")
        plane = wide.buffer(THIN_MM / 2, join_style="mitre") & free
        touching = shapely.union_all([shape for shape, _ in ground])
        pieces = [piece for piece in getattr(plane, "geoms", [plane]) if piece.intersects(touching)]
        pours.append(Pour(GROUND, layer, tuple(_cut_open(piece) for piece in pieces)))
    return tuple(pours)


def _others(board: Board, layer: Layer) -> Iterator[Any]:
    """Yield what the plane keeps off: copper of other nets, widened by the clearance, and the holes for screws."""
    from shapely import Point as Spot

    apart = board.rules.clearance_mm + SPARE_MM
    for pad in board.pads():
        if pad.net != GROUND and layer in pad.layers:
            yield _of_pad(pad).buffer(apart)
    yield from (shape.buffer(apart) for shape in _of_tracks(board, layer, ground=False))
    for at, diameter in board.holes:
        yield Spot(at).buffer(diameter / 2 + apart + HOLE_MM)


def _ground(board: Board, layer: Layer) -> Iterator[tuple[Any, PlacedPad | None]]:
    """Yield the copper of ground, with its pad where it is one."""
    for pad in board.pads():
        if pad.net == GROUND and layer in pad.layers:
            yield _of_pad(pad), pad
    for shape in _of_tracks(board, layer, ground=True):
        yield shape, None


def _of_tracks(board: Board, layer: Layer, *, ground: bool) -> Iterator[Any]:
    from shapely import LineString
    from shapely import Point as Spot

    for track in board.tracks:
        if (track.net == GROUND) == ground and track.layer == layer and isinstance(track.path, Line):
            yield LineString([track.path.start, track.path.end]).buffer(track.width_mm / 2)
    for via in board.vias:
        if (via.net == GROUND) == ground:
            yield Spot(via.at).buffer(via.size_mm / 2)


def _of_pad(pad: PlacedPad) -> Any:
    return _box(pad, pad.pad.size)


def _spokes(pad: PlacedPad) -> Iterator[Any]:
    (width, height), reach = pad.pad.size, 2 * (GAP_MM + THIN_MM)
    yield _box(pad, (width + reach, SPOKE_MM))
    yield _box(pad, (SPOKE_MM, height + reach))


def _box(pad: PlacedPad, size: Point) -> Any:
    from shapely import Polygon

    (x, y), turn = (size[0] / 2, size[1] / 2), pad.turn_rad
    return Polygon([turned(corner, turn, pad.at) for corner in ((-x, -y), (x, -y), (x, y), (-x, y))])


def _cut_open(piece: "Polygon") -> tuple[Point, ...]:
    """Return one outline for a polygon with holes: from the left of each a cut leads to what lies to its left."""
    ring = _points(piece.exterior.coords)
    for hole in sorted((_points(inside.coords) for inside in piece.interiors), key=min):
        first = hole.index(min(hole))
        x, y = hole[first]
        number, met = max(
            ((n, x0 + (y - y0) / (y1 - y0) * (x1 - x0)) for n, ((x0, y0), (x1, y1)) in _edges(ring)
             if min(y0, y1) <= y < max(y0, y1) and x0 + (y - y0) / (y1 - y0) * (x1 - x0) <= x),
            key=lambda crossing: crossing[1],
        )  # fmt: skip
        ring[number + 1 : number + 1] = [(met, y), *hole[first:], *hole[: first + 1], (met, y)]
    return tuple(ring)


def _points(coordinates: Iterable[Any]) -> list[Point]:
    """Return the corners of a closed way, each once, in whole nanometres."""
    return [(round(float(x), 6), round(float(y), 6)) for x, y in coordinates][:-1]


def _edges(ring: list[Point]) -> Iterator[tuple[int, tuple[Point, Point]]]:
    yield from enumerate(zip(ring, [*ring[1:], ring[0]], strict=True))
