"""Cast shadows on the C library; what it computes is what `cast_shadows.CastShadows` computes."""

import numpy as np
from numpy.typing import NDArray

from gellight.reconstruction.cast_shadows import EDGE_MM, CastShadows
from gellight.reconstruction.gelnet import BLOCK_ROWS, CELL_PX, COARSE_PX
from gellight.reconstruction.integration import cosines, free_and_far, from_cosines, rest_level
from gellight.reconstruction.led_light import OnCells
from gellight.reconstruction.native.library import Library
from gellight.reconstruction.native.network import SlopeNetwork
from gellight.reconstruction.native.work import WorkMemory, elimination

Floats = NDArray[np.float32]


class NativeShadows:
    """The shadows of one sensor; keeps working memory, so it serves one thread."""

    def __init__(
        self, library: Library, shadows: CastShadows, network: SlopeNetwork, zero: Floats, bulge: float
    ) -> None:
        """Take the parts; zero: (h w, 2) what the network answers at cells to no difference."""
        self._c, self._parts, self._network, self._zero, self._bulge = library, shadows, network, zero, bulge
        h, w = shadows.cells
        self._rays = rays_of(shadows.on_cells)
        self._factors, self._column = elimination((h, w)), np.zeros(h)
        self._means, self._felt, self._change = np.zeros((3, 2, h, w), np.float32)
        self._lost, self._work = np.zeros((3, h, w), np.float32), np.zeros(work_of(h, w), np.float32)
        self._flags = np.zeros(w + h, np.uint8)

    def add_change(self, m: WorkMemory, far: NDArray[np.bool_], limit_grey: float) -> None:
        """Add to the slopes in `m` what the light that the surface changed makes of them.

        far: of `far_cells`. limit_grey: cells that it changes by more are asked about anew.
        """
        parts, (h, w) = self._parts, self._parts.cells
        height, width = m.slopes.shape[1:]
        self._c.call("slope_means", m.slopes, self._means, m.work, width, height)
        of = parts.on_cells
        places = (parts.x_mm, parts.y_mm, of.feet, of.light, len(of.feet), 1 / parts.height_mm)
        seeking = (of.most_mm[1], self._work, self._flags)
        if not parts.by_depth and not self._c.call("may_shade", self._means, *places, *seeking, w, h):
            return
        self._felt[:] = self._means
        for _ in range(parts.rounds):
            if not self._feel_again(m, far, limit_grey):
                return
        self._c.call("add_change", self._change, m.slopes, m.work, width, height)

    def _feel_again(self, m: WorkMemory, far: NDArray[np.bool_], limit_grey: float) -> bool:
        """Find what the light that the felt slopes changed makes of them; return whether it changed any."""
        parts, (h, w), light = self._parts, self._parts.cells, self._parts.light
        of = parts.on_cells
        leds = (parts.x_mm, parts.y_mm, of.feet, of.light, self._rays, len(of.feet))
        given = (self._depth_mm(m, far), self._felt, *leds, 1 / parts.height_mm, *parts.cell_mm, EDGE_MM)
        work = (self._lost, self._work, self._flags, m.near)
        if not self._c.call("lost_light", *given, *work, parts.hide, parts.by_depth, w, h):
            return False
        lost = (m.near, self._lost, parts.rest, light.black, light.gamma, limit_grey)
        count = self._c.call("relit", m.planes, m.cell_rows, *lost, m.index, m.rows, self._change, h * w)
        for start in range(0, count, BLOCK_ROWS):
            rows = m.rows[start : min(start + BLOCK_ROWS, count)]
            answer = (m.index[start:], self._network.slopes(rows), self._zero, m.planes)
            self._c.call("answered", *answer, self._change, len(rows), h * w)
        np.add(self._means, self._change, out=self._felt)
        return True

    def _depth_mm(self, m: WorkMemory, far: NDArray[np.bool_]) -> Floats:
        """Integrate the felt slopes."""
        (h, w), size, seen = self._parts.cells, self._parts.cell_mm, self._parts.perspective
        depth, slopes = np.empty((h, w), np.float32), self._felt
        if seen:
            self._c.call("slopes_by_view", slopes := slopes.copy(), seen.x, seen.y, 1.0, w, h)
        self._c.call("divergence", slopes, depth, *size, m.work, w, h)
        waves = cosines(depth)
        self._c.call("solve_columns", waves, self._factors, self._column, w, h)
        depth = from_cosines(waves)
        at_rest = free_and_far(~m.touched.view(np.bool_), far, COARSE_PX // CELL_PX)
        depth -= rest_level(depth, at_rest, self._bulge)
        if seen:
            self._c.call("depth_by_view", depth, 1 / float(seen.height_mm), w, h)
        return np.clip(depth, *self._parts.on_cells.most_mm, out=depth)


def rays_of(light: OnCells) -> Floats:
    """Return (K, 2, 4, h w) the rays of LEDs, row by row and column by column."""
    rows, columns = light.rays[:, :4], light.rays[:, [0, 1, 2, 4]].swapaxes(2, 3)
    return np.stack([plane.reshape(len(plane), 4, -1) for plane in (rows, columns)], axis=1)


def work_of(h: int, w: int) -> int:
    """Return how many numbers of working memory `lost_light` takes on (h, w) cells."""
    return 5 * h * w + 3 * (w + h + 64)
