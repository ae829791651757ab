"""The light that the felt surface takes from the gel or brings to it, and what the network answers without that.

The steep wall of a deep press keeps the light of single LEDs from the gel beside it. The colour of one pixel cannot
tell that from a slope, so the gel there is found too steep and the contact too deep. Where the bundle knows its LEDs
(`lights.json`), the slopes that were found tell the shadows, on means over 4 x 4 pixels (cells):

1. The slopes are integrated to a surface of cells.
2. Light comes to a point at the distance r from the foot of a LED at the slope s = (z_led - z) / r; through a window
   it leaves the LED at such a slope, which it keeps. The point is in shadow where a nearer point of the same ray has a
   smaller s. Rays that cross more rows than columns are followed away from the LED row by row: the smallest s up to
   there, between the two cells of the row before that a ray passes, is that row's, or s there. The other rays are
   followed column by column. In a picture that is taken from a height rays do not come from the LED's foot, but from
   where the camera would see the LED.
3. `led_light` says how much light a hidden LED would bring to gel of the slope that was found, and at which s.
4. By how much the network answers otherwise to the colour of the cell with that light is added to the slopes of the
   pixels, linear between cells, before they are smoothed and integrated. Cells that nothing touches lie as the gel at
   rest, whatever depth is found there, and stay as they are.

Behind a window light comes from above 45 degrees, and shadows are shorter than two cells: of a surface that is known, a
half of what they take is found (nine tenths by cells half as wide, which make no felt surface better).

Depth does the same everywhere: gel that is pressed in lies nearer to the LEDs. A network that learnt from balls as they
look shows gentle slopes deep, because a ball has them in its middle, and reads the gel beside a contact too flat. Where
the manifest says `light_by_depth`, the network learnt colours as they would be at the depth of the gel at rest, and in
step 3 each cell gets the light, too, that it would have there. All is then done twice, for the depth of the first round
is felt in the wrong light.
"""

from dataclasses import dataclass, field
from functools import lru_cache
from math import inf
from typing import Self

import cv2
import numpy as np
from numpy.typing import NDArray

from gellight.bundle.bundle import Bundle
from gellight.frames.pixel_grid import between_blocks
from gellight.photometric.light_model import LightModel
from gellight.photometric.lights_file import FILE_NAME, has_lights, read_lights
from gellight.reconstruction.gelnet import CELL_PX, COARSE_PX, GradientNetwork, block_middles, cell_means
from gellight.reconstruction.integration import far_from_touch
from gellight.reconstruction.led_light import LedLight, OnCells
from gellight.reconstruction.lens.undistortion import has_lens
from gellight.reconstruction.perspective import Perspective, depth_seen

Floats = NDArray[np.float32]
Bools = NDArray[np.bool_]

EDGE_MM = 0.08
"""Where the ray to a LED passes the surface by less than half of this, a part of the cell is in shadow."""
ROUNDS = 2
"""where depth changes the light: after one alone walls are felt up to six times as far off; a third one brings steep
objects normals that are a tenth better, and waves a depth that is half as far off again"""
_BEYOND = np.float32(1e3)
"""slope at which a LED stands where nothing is known of the surface: nothing hides it"""
_NEIGHBOURS = np.ones((3, 3), np.uint8)
_DIAGONAL = 1.00001
"""columns per row: up to that, rays are followed row by row"""


@dataclass(frozen=True)
class _Lit:
    """Cells at float32 x and y, seen from a height, and the light of a bundle's file on them."""

    file: bytes
    x_mm: bytes
    y_mm: bytes
    height_mm: float
    model: LightModel = field(compare=False)


@lru_cache(maxsize=2)
def _light_on(lit: _Lit) -> tuple[LedLight, OnCells]:
    """Return the light; kept, for it takes most of the time in which a reconstruction is begun."""
    x, y = (np.frombuffer(axis, np.float32) for axis in (lit.x_mm, lit.y_mm))
    light = LedLight.of(lit.model, (len(y), len(x)))
    return light, light.on_cells(x, y, lit.height_mm)


class CastShadows:
    """What the surface does to the light of one sensor's LEDs."""

    def __init__(self, bundle: Bundle, model: LightModel, network: GradientNetwork, *, hide: bool = True) -> None:
        """Take the light of the sensor and the network that is asked again; hide: LEDs can be hidden by the surface."""
        self._network, self._bulge, self.hide = network, bundle.manifest.bulge, hide
        self.by_depth = bundle.manifest.light_by_depth
        self.rounds = ROUNDS if self.by_depth else 1
        self.cell_mm = CELL_PX * bundle.pixel_size_mm[0], CELL_PX * bundle.pixel_size_mm[1]
        self.cells = -(-bundle.image_shape[0] // CELL_PX), -(-bundle.image_shape[1] // CELL_PX)
        self.middle = block_middles(bundle.image_shape, CELL_PX)
        place = (self.middle - (np.array(bundle.image_shape[::-1]) - 1) / 2) * bundle.pixel_size_mm
        x, y = np.moveaxis(place.reshape(*self.cells, 2), 2, 0).astype(np.float32)
        self.x_mm, self.y_mm = np.ascontiguousarray(x[0]), np.ascontiguousarray(y[:, 0])
        self.height_mm = bundle.manifest.camera_height_mm or inf
        axes = self.x_mm.tobytes(), self.y_mm.tobytes()
        self.light, self.on_cells = _light_on(_Lit(bundle.files[FILE_NAME], *axes, self.height_mm, model))
        self.perspective = Perspective(self.x_mm, self.y_mm, self.height_mm) if self.height_mm < inf else None
        self.rest = cell_means(bundle.reference.astype(np.float32), CELL_PX).reshape(-1, 3)
        """(h w, 3) grey levels at rest"""

    @classmethod
    def of_bundle(cls, bundle: Bundle, network: GradientNetwork, *, wanted: bool = True) -> Self | None:
        """Return those of a bundle; None where there is nothing to do.

        Nothing is hidden where it is not `wanted`, where the bundle does not know its LEDs, and in one with a lens,
        which moves the shadows. Raises BundleError for a damaged or missing `lights.json`.
        """
        hide = wanted and has_lights(bundle) and not has_lens(bundle)
        if not hide and not bundle.manifest.light_by_depth:
            return None
        return cls(bundle, read_lights(bundle), network, hide=hide)

    def change(self, difference: Floats, slopes: Floats, touched: Bools) -> Floats | None:
        """Return what is to be added to the slopes of every pixel, (H, W, 2); None where it is nothing.

        difference: (H, W, 3). slopes: (H, W, 2) as found, not smoothed. touched: (h, w) cells.
        """
        means = cell_means(slopes, CELL_PX)
        if not self.by_depth and not self._may_shade(means):
            return None
        near, change = cv2.dilate(touched.view(np.uint8), _NEIGHBOURS).view(np.bool_), np.zeros_like(means)
        seen, middle = cell_means(difference, CELL_PX)[near], self.middle[near.ravel()]
        answered = self._network.infer(seen, middle)
        for _ in range(self.rounds):
            felt = means + change
            lost = self.lost(self.depth_mm(felt, touched), felt)[near]
            lit = self.light.with_light(seen, lost, self.rest[near.ravel()])
            change[near] = self._network.infer(lit, middle) - answered
        return between_blocks(change, CELL_PX, slopes.shape)

    def _may_shade(self, slopes: Floats) -> bool:
        """Whether some cell would be turned away from a LED as deep as gel is pressed at most."""
        deepest = np.full(self.cells, self.on_cells.most_mm[1], np.float32)
        return any(self._facing(led, deepest, slopes)[1].min() < 0 for led in range(len(self.on_cells.feet)))

    def depth_mm(self, slopes: Floats, touched: Bools) -> Floats:
        """Integrate the (h, w, 2) slopes of cells."""
        at_rest = far_from_touch(touched, COARSE_PX // CELL_PX)
        depth = depth_seen(slopes, self.cell_mm, self.perspective, at_rest=at_rest, bulge=self._bulge)
        return np.clip(depth, *self.on_cells.most_mm)

    def lost(self, depth_mm: Floats, slopes: Floats) -> Floats:
        """Return the light that each cell lacks, (h, w, 3), in shares of the light at rest.

        depth_mm: (h, w). slopes: (h, w, 2).
        """
        upright = 1 / np.sqrt(1 + (slopes**2).sum(axis=2))
        lost = np.zeros((3, *self.cells), np.float32)
        for led, light in enumerate(self.on_cells.light):
            level, now = self._facing(led, depth_mm, slopes)
            b_1, b_2, b_3 = light[3:6]
            lit = np.maximum(1 + depth_mm * (b_1 + depth_mm * (b_2 + depth_mm * b_3)), 0) * np.maximum(now, 0)
            less = np.maximum(level, 0) - lit if self.by_depth else np.zeros_like(lit)
            if self.hide and now.min() < 0:  # a smooth surface casts no shadow where all of it faces the light
                less += self._hidden(led, depth_mm, now < 0) * lit
            lost += light[6:] * (upright * less)
        return np.moveaxis(lost, 0, 2)

    def _facing(self, led: int, depth_mm: Floats, slopes: Floats) -> tuple[Floats, Floats]:
        """Return a - slopes . way to the foot (see `OnCells`), at the depth of rest and as deep as it is, (h, w)."""
        (x, y), (a_0, a_1, a_2) = self.on_cells.feet[led, :2], self.on_cells.light[led, :3]
        across, down = slopes[..., 0], slopes[..., 1]
        level = a_0 - across * (x - self.x_mm) - down * (y - self.y_mm[:, None])
        moved = across * self.x_mm + down * self.y_mm[:, None]
        return level, level + depth_mm * (a_1 + depth_mm * a_2 - moved / np.float32(self.height_mm))

    def _hidden(self, led: int, depth_mm: Floats, away: Bools) -> Floats:
        """Return the share of a LED that is hidden from each cell, (h, w); away: cells that are turned away from it."""
        (x, y, from_x, from_y), (v_0, v_1, v_2, per_row, per_column) = self.on_cells.feet[led], self.on_cells.rays[led]
        slant = v_0 + depth_mm * (v_1 + depth_mm * v_2)
        sideways = np.maximum(np.hypot(x - self.x_mm, y - self.y_mm[:, None]), min(self.cell_mm))
        hidden = np.zeros_like(depth_mm)
        rows, columns = np.stack([slant, sideways, per_row]), np.stack([slant.T, sideways.T, per_column.T])
        for forward, order in ((True, slice(None)), (False, slice(None, None, -1))):
            below, beside = ((at[order] >= of) == forward for at, of in ((self.y_mm, from_y), (self.x_mm, from_x)))
            _follow_rays(rows[:, order], away[order], below, _DIAGONAL, hidden[order])
            _follow_rays(columns[:, order], away.T[order], beside, 1 / _DIAGONAL, hidden.T[order])
        return hidden


def _follow_rays(rays: Floats, away: Bools, beyond: Bools, furthest: float, hidden: Floats) -> None:
    """Write how much of a LED is hidden from the cells (h, w) of the rows beyond it, from the first row to the last.

    rays: (3, h, w) slope at which light leaves the LED, distance from its foot, and cells along the row that a ray
    crosses in a row. furthest: as many it may cross.
    """
    rows = np.flatnonzero(away.any(axis=1) & beyond)
    if not len(rows):
        return
    least = np.full(away.shape[1] + 2, _BEYOND)
    # One row that faces the light before the first that does not.
    for row in range(max(rows[0] - 1, int(np.argmax(beyond))), len(away)):
        slant, sideways, ahead = rays[:, row]
        right, left = np.clip(ahead, 0, 1), np.clip(-ahead, 0, 1)
        before = least[1:-1] + right * (least[2:] - least[1:-1]) + left * (least[:-2] - least[1:-1])
        least[1:-1] = np.minimum(before, slant)
        part = np.clip(0.5 + (slant - before) * sideways / EDGE_MM, 0, 1)
        part[np.abs(ahead) > furthest] = 0
        if row > rows[-1] and not part.any():
            return
        hidden[row] += part
