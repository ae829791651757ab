"""Cast shadows on the C library; what it computes is what `cast_shadows.CastShadows` computes."""

import numpy as np
from numpy.typing import NDArray

from gellight.reconstruction.at_rest import free_and_far
from gellight.reconstruction.cast_shadows import EDGE_MM, FEWEST_CELLS, LEAST_LOST, CastShadows
from gellight.reconstruction.gelnet import BLOCK_ROWS, CELL_PX, COARSE_PX
from gellight.reconstruction.integration import rest_level
from gellight.reconstruction.native.cosine import CosineRows
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
        turned = np.ascontiguousarray(shadows.shares.swapaxes(2, 3))
        self._shares = np.concatenate([shadows.shares.ravel(), turned.ravel()])
        self._cosines = CosineRows(library, (h, w))
        self._factors, self._column = elimination((h, w)), np.zeros(h)
        self._means, self._change = np.zeros((2, 2, h, w), np.float32)
        self._lost, self._work = np.zeros((3, h, w), np.float32), np.zeros(8 * h * w + 4 * (w + h + 64), np.float32)
        self._flags = np.zeros(w + h, np.uint8)

    def add_change(self, m: WorkMemory, far: NDArray[np.bool_]) -> None:
        """Add to the slopes in `m` what the light that their shadows took changes of them; far: of `far_cells`."""
        parts, (h, w) = self._parts, self._parts.cells
        height, width = m.slopes.shape[1:]
        self._c.call("slope_means", m.slopes, self._means, m.work, width, height)
        places = (parts.x_mm, parts.y_mm, parts.leds, len(parts.leds))
        if not self._c.call("may_shade", self._means, *places, parts.deepest_mm, self._work, self._flags, w, h):
            return
        light = (self._shares, *parts.cell_mm, EDGE_MM, parts.exponent, self._lost, self._work, self._flags)
        if not self._c.call("lost_light", self._depth_mm(m, far), self._means, *places, *light, w, h):
            return
        lost = (self._lost, parts.rest, parts.black, parts.gamma, LEAST_LOST)
        dark = self._c.call("lit_rows", m.cell_rows, *lost, m.index, m.rows, h * w)
        if dark < FEWEST_CELLS:
            return
        rows = m.rows[:dark]
        blocks = [self._network.slopes(rows[at : at + BLOCK_ROWS]) for at in range(0, dark, BLOCK_ROWS)]
        answer = np.concatenate(blocks)
        given = (m.index, answer, self._zero, self._means, self._change, m.slopes, m.work)
        self._c.call("add_change", *given, dark, width, height)

    def _depth_mm(self, m: WorkMemory, far: NDArray[np.bool_]) -> Floats:
        """Integrate the means of the slopes."""
        (h, w), size = self._parts.cells, self._parts.cell_mm
        depth = np.empty((h, w), np.float32)
        self._c.call("divergence", self._means, depth, *size, m.work, w, h)
        waves = self._cosines.forwards(depth)
        self._c.call("solve_columns", waves, self._factors, self._column, w, h)
        depth = self._cosines.backwards(waves)
        at_rest = free_and_far(~m.touched.view(np.bool_), far, COARSE_PX // CELL_PX)
        depth -= rest_level(depth, at_rest, self._bulge)
        return depth
