"""The light that the felt surface takes from the gel or brings to it, and what the network answers without that.

The steep wall of a deep press keeps the light of single LEDs from the gel beside it. The colour of one pixel cannot
tell that from a slope, so the gel there is found too steep and the contact too deep. Where the bundle knows its LEDs
(`lights.json`), the slopes that were found tell the shadows, on means over 4 x 4 pixels (cells):

1. The slopes are integrated to a surface of cells.
2. Seen from a point at the distance r from the foot of a LED, the LED stands at the slope s = (z_led - z) / r. The
   point is in shadow where a nearer point of the same ray has a smaller s. Rays that cross more rows than columns are
   followed away from the LED row by row: the smallest s up to there, between the two cells of the row before that a ray
   passes, is that row's, or s there. The other rays are followed column by column.
3. `led_light` says how much light a hidden LED would bring to gel of the slope that was found.
4. By how much the network answers otherwise to the colour of the cell with that light is added to the slopes of the
   pixels, linear between cells, before they are smoothed and integrated. Where the colour changes little, the Jacobian
   that `linearised` has of the cell tells it; only where it changes by more than `LIMIT_GREY` is the network asked.
   Cells that nothing touches lie as the gel at rest, whatever depth is found there, and stay as they are.

Depth does the same everywhere: gel that is pressed in lies nearer to the LEDs. A network that learnt from balls as they
look shows gentle slopes deep, because a ball has them in its middle, and reads the gel beside a contact too flat. Where
the manifest says `light_by_depth`, the network learnt colours as they would be at the depth of the gel at rest, and in
step 3 each cell gets the light, too, that it would have there (`LedLight.lost_by_depth`). All is then done twice, for
the depth of the first round is felt in the wrong light.
"""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from gellight.bundle.bundle import Bundle
from gellight.frames.pixel_grid import between_blocks
from gellight.photometric.light_model import LightModel
from gellight.photometric.lights_file import has_lights, read_lights
from gellight.photometric.solver import Points
from gellight.reconstruction.at_rest import far_from_touch
from gellight.reconstruction.gelnet import CELL_PX, COARSE_PX, cell_means
from gellight.reconstruction.integration import integrate
from gellight.reconstruction.led_light import LedLight, unit_normals
from gellight.reconstruction.lens.lens_file import has_lens
from gellight.reconstruction.linearised import LIMIT_GREY, CellNetwork, widened

Floats = NDArray[np.float32]
Bools = NDArray[np.bool_]

EDGE_MM = 0.08
"""Where the ray to a LED passes the surface by less than half of this, a part of the cell is in shadow."""
ROUNDS = 2
"""where depth changes the light: after one alone walls are felt up to six times as far off; a third one brings steep
objects normals that are a tenth better, and waves a depth that is half as far off again"""
DEEPEST = 0.15
"""of the height of the LEDs: gel is not pressed in further, so nothing is sought where nothing so deep would shade"""
_BEYOND = np.float32(1e3)
"""slope at which a LED stands where nothing is known of the surface: nothing hides it"""
_DIAGONAL = 1.00001
"""columns per row: up to that, rays are followed row by row"""


class CastShadows:
    """What the surface does to the light of one sensor's LEDs."""

    def __init__(self, bundle: Bundle, model: LightModel, network: CellNetwork, *, hide: bool = True) -> None:
        """Take the light of the sensor and the network that is asked again; hide: LEDs can be hidden by the surface."""
        self._network, self._bulge, self.hide = network, bundle.manifest.bulge, hide
        self.by_depth = bundle.manifest.light_by_depth
        self.rounds = ROUNDS if self.by_depth else 1
        self.cell_mm = CELL_PX * bundle.pixel_size_mm[0], CELL_PX * bundle.pixel_size_mm[1]
        self.cells = -(-bundle.image_shape[0] // CELL_PX), -(-bundle.image_shape[1] // CELL_PX)
        self.light = LedLight.of(model, self.cells)
        self.deepest_mm = DEEPEST * float(self.light.leds[:, 2].min())
        place = (network.middle - (np.array(bundle.image_shape[::-1]) - 1) / 2) * bundle.pixel_size_mm
        x, y = np.moveaxis(place.reshape(*self.cells, 2), 2, 0).astype(np.float32)
        self.x_mm, self.y_mm = np.ascontiguousarray(x[0]), np.ascontiguousarray(y[:, 0])
        self.rest = cell_means(bundle.reference.astype(np.float32), CELL_PX).reshape(-1, 3)
        """(h w, 3) grey levels at rest"""

    @classmethod
    def of_bundle(cls, bundle: Bundle, network: CellNetwork, *, wanted: bool = True) -> Self | None:
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
        near, change = widened(touched), np.zeros_like(means)
        planes = self._network.planes(cell_means(difference, CELL_PX), near)
        for _ in range(self.rounds):
            felt = means + change
            change[near] = self._changed(planes, self.lost(self.depth_mm(felt, touched), felt), near)
        return between_blocks(change, CELL_PX, slopes.shape)

    def _changed(self, planes: Floats, lost: Floats, near: Bools) -> Floats:
        """Return by how much the network answers otherwise to the M cells that are near with the light lost, (M, 2).

        planes: (h, w, 11), as `CellNetwork.planes` has them. lost: (h, w, 3).
        """
        cell, network = np.flatnonzero(near), self._network
        half, seen, jacobian = np.split(planes[near], (2, 5), axis=1)
        lit = self.light.with_light(seen, lost[near], self.rest[cell])
        by_grey = jacobian.reshape(-1, 2, 3)
        change = np.einsum("nij,nj->ni", by_grey, lit - seen)
        strong = np.flatnonzero((np.abs(lit - seen) > LIMIT_GREY).any(axis=1))
        at = cell[strong]
        answer = network.network.infer(lit[strong], network.middle[at]) - network.zero[at]
        change[strong] = answer - half[strong] - np.einsum("nij,nj->ni", by_grey, seen)[strong] / 2
        return np.asarray(change, np.float32)

    def _may_shade(self, slopes: Floats) -> bool:
        deepest = self._surface(np.full(self.cells, self.deepest_mm, np.float32), slopes)
        return any(deepest.away_from(led).any() for led in self.light.leds)

    def depth_mm(self, slopes: Floats, touched: Bools) -> Floats:
        """Integrate the (h, w, 2) slopes of cells."""
        at_rest = far_from_touch(touched, COARSE_PX // CELL_PX)
        return np.asarray(integrate(slopes, self.cell_mm, at_rest=at_rest, bulge=self._bulge), np.float32)

    def lost(self, depth_mm: Floats, slopes: Floats) -> Floats:
        """Return the light that each cell lacks, (h, w, 3), in shares of the light at rest.

        depth_mm: (h, w). slopes: (h, w, 2).
        """
        surface, light = self._surface(depth_mm, slopes), self.light
        points = Points(surface.x.ravel(), surface.y.ravel(), depth_mm.ravel())
        shares = light.shares.reshape(*light.shares.shape[:2], -1)
        normal = unit_normals(slopes).reshape(3, -1)
        lost = np.zeros((3, depth_mm.size), np.float32)
        if self.by_depth:
            lost += light.lost_by_depth(points, slopes.reshape(-1, 2), shares)
        for number, led in enumerate(light.leds if self.hide else ()):
            away = surface.away_from(led)
            if away.any():  # a smooth surface casts no shadow where all of it faces the light
                hidden = surface.hidden_from(led, away, self.cell_mm).ravel()
                lost += shares[number] * light.on(number, points, normal, hidden)
        return np.moveaxis(lost.reshape(3, *self.cells), 0, 2)

    def _surface(self, depth_mm: Floats, slopes: Floats) -> "_Surface":
        return _Surface(depth_mm, slopes[..., 0], slopes[..., 1], *np.meshgrid(self.x_mm, self.y_mm))


@dataclass(frozen=True, eq=False)
class _Surface:
    """A surface on cells, (h, w) each."""

    depth_mm: Floats
    across: Floats
    """d(depth)/dx"""
    down: Floats
    """d(depth)/dy"""
    x: Floats
    """mm"""
    y: Floats

    def away_from(self, led: Floats) -> Bools:
        """Mark the cells that are turned away from a LED (6,)."""
        x, y, z = led[0] - self.x, led[1] - self.y, led[2] - self.depth_mm
        return np.asarray(z - self.across * x - self.down * y < 0)

    def hidden_from(self, led: Floats, away: Bools, cell_mm: tuple[float, float]) -> Floats:
        """Return the share of a LED that is hidden from each cell, (h, w); away: of `away_from`."""
        hidden = np.zeros_like(self.depth_mm)
        surface = np.stack([self.x, self.y, self.depth_mm])
        turned = surface[[1, 0, 2]].swapaxes(1, 2)
        for rows in (slice(None), slice(None, None, -1)):
            _follow_rays(surface[:, rows], led[:3], away[rows], cell_mm, _DIAGONAL, hidden[rows])
            _follow_rays(turned[:, rows], led[[1, 0, 2]], away.T[rows], cell_mm[::-1], 1 / _DIAGONAL, hidden.T[rows])
        return hidden


def _follow_rays(
    surface: Floats, led: Floats, away: Bools, cell_mm: tuple[float, float], furthest: float, hidden: Floats
) -> None:
    """Write how much of a LED is hidden from the cells (h, w) beyond it, from the first row to the last.

    surface: (3, h, w) and led: (3,) in x, y, z. furthest: columns that a ray may cross in a row.
    """
    x, y, depth_mm = surface
    forward = y[0, 0] < y[-1, 0]
    beyond = y[:, 0] >= led[1] if forward else y[:, 0] < led[1]
    rows = np.flatnonzero(away.any(axis=1) & beyond)
    if not len(rows):
        return
    least = np.full(depth_mm.shape[1] + 2, _BEYOND)
    # One row that faces the light before the first that does not.
    for row in range(max(rows[0] - 1, int(np.argmax(beyond))), len(depth_mm)):
        to_x, to_y, to_z = led[0] - x[row], led[1] - y[row, 0], led[2] - depth_mm[row]
        ahead = to_x * (cell_mm[1] / (max(abs(to_y), 1e-6) * cell_mm[0]))
        right, left = np.clip(ahead, 0, 1), np.clip(-ahead, 0, 1)
        before = least[1:-1] + right * (least[2:] - least[1:-1]) + left * (least[:-2] - least[1:-1])
        sideways = np.maximum(np.hypot(to_x, to_y), min(cell_mm))
        least[1:-1] = np.minimum(before, to_z / sideways)
        part = np.clip(0.5 + (to_z - before * sideways) / EDGE_MM, 0, 1)
        part[np.abs(ahead) > furthest] = 0
        if row > rows[-1] and not part.any():
            return
        hidden[row] += part
