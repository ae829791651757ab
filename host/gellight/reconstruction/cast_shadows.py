"""Cast shadows: which LEDs the felt surface hides from the gel, and what the network answers with their light.

The steep wall of a deep press keeps the light of single LEDs from the gel beside it. The colour of one pixel cannot
tell that from a slope, so the gel there is found too steep and the contact too deep. Where the bundle knows its LEDs
(`lights.json`), the surface that was found first tells the shadows, on means of 4 x 4 pixels (cells):

1. Seen from a point at the distance r from the foot of a LED, the LED stands at the slope s = (z_led - z) / r. The
   point is in shadow where a nearer point of the same ray has a smaller s. The smallest is found by doubling the
   distance that is looked over.
2. `photometric.solver.light_row` says how much light a hidden LED would bring to gel of the slope that was found.
3. The network answers to the colour of the cell with that light and without it. The difference is added to the slopes
   of the pixels, which the frame path then smooths and integrates once more.

More rounds, single pixels in place of cells, or the true surface in place of the found one, make the depth no better.
"""

from dataclasses import dataclass, replace
from typing import Self

import cv2
import numpy as np
from numpy.typing import NDArray

from gellight.bundle.bundle import Bundle
from gellight.frames.pixel_grid import between_blocks, block_means, bounding_box, gel_points_mm
from gellight.photometric.light_model import WHITE, LightGroups, LightModel
from gellight.photometric.lights_file import has_lights, read_lights
from gellight.photometric.solver import Points, light_row
from gellight.reconstruction.gelnet import CELL_PX, GradientNetwork
from gellight.reconstruction.lens.lens_file import has_lens

Floats = NDArray[np.float32]
Indices = NDArray[np.intp]

EDGE_MM = 0.06
"""Where the ray to a LED passes the surface by less than half of this, a part of the cell is in shadow."""
TURNED_AWAY = 0.1
"""Gel that is turned away from a LED by more than this sine has no light of it to lose."""
FEWEST_CELLS = 64
"""Smaller shadows are left: they change the depth in contact by less than half a micrometre."""
_BEYOND = 1e3
"""slope at which a LED stands where nothing is known of the surface: nothing hides it"""


@dataclass(frozen=True, eq=False)
class Shadows:
    """Where which LEDs are hidden."""

    cell: Indices
    """(M,) numbers of the cells in shadow"""
    hidden: Floats
    """(K, M) share of each LED that is hidden there, 0 to 1"""


class CastShadows:
    """The shadows of one sensor's LEDs."""

    def __init__(self, bundle: Bundle, model: LightModel, network: GradientNetwork) -> None:
        """Take the light of the sensor and the network that is asked again."""
        self._network, self._black, self._gamma = network, model.black_grey, model.gamma
        self._leds, self._axes = model.ring.positions_mm().astype(np.float32), model.ring.axes().astype(np.float32)
        self._exponent = model.ring.emission_exponent
        self._cell_mm = CELL_PX * bundle.pixel_size_mm[0], CELL_PX * bundle.pixel_size_mm[1]
        self._cells = bundle.image_shape[0] // CELL_PX, bundle.image_shape[1] // CELL_PX
        self._points = np.moveaxis(gel_points_mm(self._cells, self._cell_mm), 2, 0).astype(np.float32)
        self._reference = block_means(bundle.reference.astype(np.float32), CELL_PX).reshape(-1, 3)
        self._shares = _shares(model, self._cells).reshape(3, len(self._leds), -1)
        x, y = (led[:, None, None] - at for led, at in zip(self._leds.T, self._points, strict=False))
        self._farthest_mm = np.hypot(x, y).max(axis=0)
        """(h, w) from the foot of the LED that is farthest away"""

    @classmethod
    def of_bundle(cls, bundle: Bundle, network: GradientNetwork) -> Self | None:
        """Return those of a bundle; None where it does not know its LEDs, or has a lens, which moves the shadows.

        Raises BundleError for a damaged `lights.json`.
        """
        if not has_lights(bundle) or has_lens(bundle):
            return None
        return cls(bundle, read_lights(bundle), network)

    def change(self, difference: Floats, depth_mm: Floats, slopes: Floats) -> Floats | None:
        """Return what is to be added to the slopes of every pixel, (2, H, W); None without shadows.

        difference: (H, W, 3). depth_mm: (H, W) as found from `slopes`, (2, H, W), smoothed.
        """
        depth = block_means(depth_mm, CELL_PX)
        shadows = self.shadows(depth)
        if len(shadows.cell) < FEWEST_CELLS:
            return None
        found = np.stack([block_means(plane, CELL_PX).ravel()[shadows.cell] for plane in slopes])
        seen = block_means(difference, CELL_PX).reshape(-1, 3)[shadows.cell]
        planes = np.zeros((2, *self._cells), np.float32)
        planes.reshape(2, -1)[:, shadows.cell] = self._changed(seen, self.lost(shadows, depth, found), shadows.cell).T
        change = np.zeros((2, *depth_mm.shape), np.float32)
        for whole, plane in zip(change, planes, strict=True):
            pixels = between_blocks(plane, CELL_PX, whole.shape)
            whole[: len(pixels), : pixels.shape[1]] = pixels
        return change

    def lost(self, shadows: Shadows, depth_mm: Floats, slope: Floats) -> Floats:
        """Return the light that cells in shadow lack, (M, 3), in shares of the light at rest.

        depth_mm: (h, w) of all cells. slope: (2, M) of those in shadow.
        """
        lost = np.zeros((3, len(shadows.cell)), np.float32)
        x, y, z = (values.reshape(-1)[shadows.cell] for values in (*self._points, depth_mm))
        normal = np.stack([-slope[0], -slope[1], np.ones_like(z)]) / np.sqrt(1 + (slope**2).sum(axis=0))
        for led in np.flatnonzero(shadows.hidden.any(axis=1)).tolist():
            position, axis = self._leds[led].tolist(), self._axes[led].tolist()
            light = light_row(Points(x, y, z), shadows.hidden[led], position, axis, self._exponent)
            lost += self._shares[:, led, shadows.cell] * np.maximum((light * normal).sum(axis=0), 0)
        return lost.T

    def shadows(self, depth_mm: Floats) -> Shadows:
        """Return the shadows on the means (h, w) of the depth over cells."""
        down, across = np.gradient(depth_mm, *self._cell_mm[::-1])
        height_mm = float(self._leds[0, 2] - depth_mm.max())
        steep = np.hypot(across, down) * self._farthest_mm > height_mm
        if height_mm <= 0 or not steep.any():
            return Shadows(np.zeros(0, np.intp), np.zeros((len(self._leds), 0), np.float32))
        longest_mm = np.ptp(depth_mm) / height_mm * self._farthest_mm.max()
        reach = int(np.ceil(longest_mm / min(self._cell_mm)))
        box = bounding_box(steep, reach)
        patch = _Patch(*(values[box] for values in (depth_mm, across, down, *self._points)))
        hidden = np.zeros((len(self._leds), *self._cells), np.float32)
        for led, share in enumerate(hidden):
            self._hide(led, patch, reach, share[box])
        cell = np.flatnonzero(hidden.any(axis=0))
        return Shadows(cell, hidden.reshape(len(hidden), -1)[:, cell])

    def _hide(self, led: int, patch: "_Patch", reach: int, share: Floats) -> None:
        """Write into `share` (h, w) how much of a LED the patch hides; reach: of the longest shadow, cells."""
        x, y, z = (at - values for at, values in zip(self._leds[led], (patch.x, patch.y, patch.depth_mm), strict=True))
        facing = z - patch.across * x - patch.down * y
        away = facing < 0
        if not away.any():  # a smooth surface casts no shadow where all of it faces the light
            return
        box = bounding_box(away, reach)
        x, y, z, facing = (values[box] for values in (x, y, z, facing))
        sideways = np.maximum(np.hypot(x, y), min(self._cell_mm))
        one = min(self._cell_mm) / sideways
        least = _least_ahead(z / sideways, one * x / self._cell_mm[0], one * y / self._cell_mm[1], reach)
        hidden = np.clip(0.5 + (z - least * sideways) / EDGE_MM, 0, 1)
        share[box] = np.where(facing > -TURNED_AWAY * np.hypot(sideways, z), hidden, 0)

    def _changed(self, seen: Floats, lost: Floats, cell: Indices) -> Floats:
        """(M, 2) what `lost` (M, 3), in shares of the light at rest, changes of the answers to `seen` (M, 3)."""
        span, rest = WHITE - self._black, self._reference[cell]
        at_rest, now = (np.maximum((grey - self._black) / span, 0) ** self._gamma for grey in (rest, rest + seen))
        lit = self._black + span * (now + lost * at_rest) ** (1 / self._gamma) - rest
        middle = np.stack([cell % self._cells[1], cell // self._cells[1]], axis=1) * CELL_PX + (CELL_PX - 1) / 2
        with_light, without = (self._network.infer(np.asarray(grey, np.float32), middle) for grey in (lit, seen))
        return with_light - without


@dataclass(frozen=True, eq=False)
class _Patch:
    """A part of the surface on cells, (h, w) each."""

    depth_mm: Floats
    across: Floats
    """d(depth)/dx"""
    down: Floats
    """d(depth)/dy"""
    x: Floats
    """mm"""
    y: Floats


def _least_ahead(stands: Floats, step_x: Floats, step_y: Floats, reach: int) -> Floats:
    """Return the smallest of `stands` (h, w) in the next `reach` cells or more; steps (h, w) lead to the next one."""
    y, x = np.indices(stands.shape, dtype=np.float32)

    def ahead(values: Floats, steps: int) -> Floats:
        to = x + steps * step_x, y + steps * step_y
        return np.asarray(cv2.remap(values, *to, cv2.INTER_LINEAR, borderValue=_BEYOND), np.float32)

    least, steps = ahead(stands, 1), 1
    while steps < reach:
        least = np.minimum(least, ahead(least, steps))
        steps *= 2
    return least


def _shares(model: LightModel, cells: tuple[int, int]) -> Floats:
    """(3, K, h, w) share of the light at rest in each channel that each LED brings, at cells."""
    alone = replace(model, image_shape=cells).references(LightGroups.SINGLES)
    seen = model.crosstalk[:, model.ring.channels, None, None] * alone
    return np.asarray(seen / seen.sum(axis=1, keepdims=True), np.float32)
