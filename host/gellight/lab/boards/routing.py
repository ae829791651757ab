"""Find the copper of a board: the cheapest way on a grid of both layers, net after net (Dijkstra's algorithm).

C. Y. Lee, "An algorithm for path connections and its applications", IRE Transactions EC-10 (1961), with costs of its
own for straight steps, diagonals and vias. Where a net finds no way, all begin anew with that net as the first. Parts
have to be turned by whole quarters.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from math import cos, hypot, sin

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from gellight.base.errors import InputError
from gellight.lab.boards.model import BOTH, Layer, Line, PlacedPad, Point, Rules, Track, Via

STEP_MM = 0.5
VIA_COST = 8.0
"""in steps of the grid"""
VIA_MM = 0.6
HOLE_MM = 0.1
"""more than the clearance that copper keeps from a hole for a screw"""
TRIES = 8
Mask = NDArray[np.bool_]
Numbers = NDArray[np.int64]


@dataclass
class Router:
    """The state of a board between its nets; `route` adds one."""

    width: float
    height: float
    rules: Rules
    pads: Sequence[PlacedPad]
    holes: Sequence[tuple[Point, float]] = ()
    tracks: list[Track] = field(default_factory=list)
    vias: list[Via] = field(default_factory=list)

    def __post_init__(self) -> None:
        """Lay out the grid; node (layer, row, column) lies at (column, row) steps from the lower left corner."""
        self.columns, self.rows = int(self.width / STEP_MM) + 1, int(self.height / STEP_MM) + 1
        # Places between the nodes count too: a corner may come nearer to a step than to its ends.
        half = STEP_MM / 2
        self.x, self.y = np.meshgrid(np.arange(2 * self.columns - 1) * half, np.arange(2 * self.rows - 1) * half)

    def route_all(self, widths: Mapping[str, float]) -> None:
        """Connect the nets, each by tracks of its width; raises InputError where no order was found that works."""
        order, tried = list(widths), 0
        while True:
            self.tracks.clear()
            self.vias.clear()
            failed = next((net for net in order if not self.route(net, widths[net])), None)
            if failed is None:
                self.tracks = [piece for track in self.tracks for piece in self._split(track)]
                return
            if tried == TRIES:
                raise InputError(f"no way was found for {failed}: the board is too small for its parts")
            order.insert(0, order.pop(order.index(failed)))
            tried += 1

    def route(self, net: str, width: float) -> bool:
        """Connect the pads of a net by tracks of a width; return whether there was a way."""
        pads = [pad for pad in self.pads if pad.net == net]
        free = np.stack([self._free(net, layer, width / 2) for layer in BOTH])
        drill = np.logical_and(*(self._free(net, layer, VIA_MM / 2) for layer in BOTH))
        graph = self._graph(free, drill)
        doors = [self._doors(pad) for pad in pads]
        reached, tree = {0}, doors[0]
        entered: set[int] = set()
        while len(reached) < len(pads):
            cost, before, _ = dijkstra(graph, indices=tree, min_only=True, return_predecessors=True)
            ways = [(cost[doors[n]].min(), n) for n in range(len(pads)) if n not in reached]
            far, nearest = min(ways)
            if not np.isfinite(far):
                return False
            way = list(self._way(before, int(doors[nearest][cost[doors[nearest]].argmin()])))
            self._lay(way, width, net)
            entered |= {way[0], way[-1]}
            reached.add(nearest)
            tree = np.unique(np.concatenate([tree, np.array(way), doors[nearest]]))
        for pad, door in zip(pads, doors, strict=True):
            self._join(pad, [int(node) for node in door if node in entered], width)
        return True

    def _free(self, net: str, layer: Layer, half: float) -> Mask:
        """(2 rows - 1, 2 columns - 1) where copper of a half width keeps off all that is not of the net."""
        reach = hypot(half + self.rules.clearance_mm, STEP_MM / 2**0.5 / 2)
        inside = half + self.rules.edge_mm
        free: Mask = (self.x >= inside) & (self.x <= self.width - inside)
        free &= (self.y >= inside) & (self.y <= self.height - inside)
        for pad in self.pads:
            if pad.net != net and layer in pad.layers:
                self._keep_off(free, Line(pad.at, pad.at), _half_size(pad), reach)
        for track in self.tracks:
            if track.net != net and track.layer == layer and isinstance(track.path, Line):
                self._keep_off(free, track.path, (0.0, 0.0), reach + track.width_mm / 2)
        for via in self.vias:
            if via.net != net:
                self._keep_off(free, Line(via.at, via.at), (0.0, 0.0), reach + via.size_mm / 2)
        for at, diameter in self.holes:
            self._keep_off(free, Line(at, at), (0.0, 0.0), reach + diameter / 2 + HOLE_MM)
        return free

    def _keep_off(self, free: Mask, line: Line, half: Point, reach: float) -> None:
        """Take away what lies nearer than `reach` to a box of half a size that is moved along a line."""
        near = []
        for axis, count in ((1, free.shape[0]), (0, free.shape[1])):
            ends = sorted((line.start[axis], line.end[axis]))
            first, last = ends[0] - half[axis] - reach, ends[1] + half[axis] + reach
            near.append(slice(max(0, int(2 * first / STEP_MM)), min(count, int(2 * last / STEP_MM) + 2)))
        window = near[0], near[1]
        x, y = self.x[window] - line.start[0], self.y[window] - line.start[1]
        along = np.subtract(line.end, line.start)
        share = np.clip((x * along[0] + y * along[1]) / max(along @ along, 1e-12), 0, 1)
        dx, dy = np.abs(x - share * along[0]) - half[0], np.abs(y - share * along[1]) - half[1]
        free[window] &= np.hypot(np.maximum(dx, 0), np.maximum(dy, 0)) >= reach

    def _graph(self, free: Mask, drill: Mask) -> coo_array:
        nodes = free[:, ::2, ::2]
        number = np.arange(nodes.size).reshape(nodes.shape)
        ends, costs = [], []
        for dy, dx in ((0, 1), (1, 0), (1, 1), (1, -1)):
            here = (slice(None), slice(0, self.rows - dy), slice(max(0, -dx), self.columns - max(0, dx)))
            there = (slice(None), slice(dy, self.rows), slice(max(0, dx), self.columns - max(0, -dx)))
            both = nodes[here] & nodes[there] & free[:, dy::2, abs(dx) :: 2]
            ends.append(np.stack([number[here][both], number[there][both]]))
            costs.append(np.full(ends[-1].shape[1], hypot(dx, dy)))
        drill = drill[::2, ::2]
        ends.append(np.stack([number[0][drill], number[1][drill]]))
        costs.append(np.full(ends[-1].shape[1], VIA_COST))
        start, end = np.concatenate(ends, axis=1)
        cost = np.concatenate(costs)
        both_ways = (np.concatenate([cost, cost]), (np.concatenate([start, end]), np.concatenate([end, start])))
        return coo_array(both_ways, shape=(nodes.size, nodes.size)).tocsr()

    def _doors(self, pad: PlacedPad) -> Numbers:
        """Return the nodes at which a pad is entered: that next to its middle, on each of its layers."""
        column, row = round(pad.at[0] / STEP_MM), round(pad.at[1] / STEP_MM)
        return np.array([self._number(BOTH.index(layer), row, column) for layer in pad.layers])

    def _number(self, layer: int, row: int, column: int) -> int:
        return (layer * self.rows + row) * self.columns + column

    def _place(self, node: int) -> tuple[Layer, Point]:
        layer, rest = divmod(node, self.rows * self.columns)
        row, column = divmod(rest, self.columns)
        return BOTH[layer], (column * STEP_MM, row * STEP_MM)

    def _way(self, before: Numbers, end: int) -> Iterator[int]:
        while end >= 0:
            yield end
            end = int(before[end])

    def _lay(self, way: Sequence[int], width: float, net: str) -> None:
        """Add the tracks and vias of a way; steps in one direction become one track."""
        places = [self._place(node) for node in way]
        start = 0
        for n in range(1, len(places)):
            (layer, here), (other, there) = places[n - 1], places[n]
            if layer != other:
                self._track(places[start], places[n - 1], width, net)
                self.vias.append(Via(here, net))
                start = n
            elif n + 1 < len(places) and not _straight(here, there, places[n + 1][1]):
                self._track(places[start], places[n], width, net)
                start = n
        self._track(places[start], places[-1], width, net)

    def _track(self, start: tuple[Layer, Point], end: tuple[Layer, Point], width: float, net: str) -> None:
        if start[1] != end[1]:
            self.tracks.append(Track(Line(start[1], end[1]), width, start[0], net))

    def _split(self, track: Track) -> Iterator[Track]:
        """Yield a track in pieces that end where others of its net do."""
        if not isinstance(track.path, Line):
            return
        ends = {place for one in self.tracks if (one.net, one.layer) == (track.net, track.layer)
                for place in (one.path.start, one.path.end)}  # fmt: skip
        ends |= {via.at for via in self.vias if via.net == track.net}
        start, end = track.path.start, track.path.end
        steps = round(max(abs(end[0] - start[0]), abs(end[1] - start[1])) / STEP_MM)
        between = [(start[0] + (end[0] - start[0]) * n / steps, start[1] + (end[1] - start[1]) * n / steps)
                   for n in range(1, steps)]  # fmt: skip
        stops = [start, *(place for place in between if place in ends), end]
        for first, second in pairwise(stops):
            yield replace(track, path=Line(first, second))

    def _join(self, pad: PlacedPad, doors: Sequence[int], width: float) -> None:
        """Lead from the nodes beside the middle of a pad into the middle, on the layers by which it was entered."""
        for layer, place in map(self._place, doors):
            if hypot(place[0] - pad.at[0], place[1] - pad.at[1]) > 1e-6:
                narrow = min(width, *pad.pad.size)
                self.tracks.append(Track(Line(place, pad.at), narrow, layer, pad.net))


def _straight(first: Point, second: Point, third: Point) -> bool:
    return bool(np.allclose(np.subtract(second, first), np.subtract(third, second)))


def _half_size(pad: PlacedPad) -> Point:
    c, s = abs(cos(pad.turn_rad)), abs(sin(pad.turn_rad))
    (width, height) = pad.pad.size
    return (c * width + s * height) / 2, (s * width + c * height) / 2
