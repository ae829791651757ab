"""The light of single LEDs on gel of any depth and slope, and what a picture shows with more or less of it.

LED k brings a point with the unit normal n a share of what it brings to the gel at rest: L_k n, with L_k of
`photometric.solver.light_row` for R_k = 1. L_k depends on the depth z of the point, which is pressed towards the LEDs:
under the ring of the paper a slope looks 5 % steeper 1 mm deep. With w_kc the share of LED k in the light of channel c
on the gel at rest, the point has

    sum over k of w_kc (L_k(0) n - L_k(z) n)

less than the same slope would have at the depth of the gel at rest, in shares of the light at rest; negative numbers
say that it has more. A camera above the gel sees the point elsewhere than the gel at rest in that pixel (`Points`).

On cells (`OnCells`) the light of a LED, the height at which it seems to stand and the slope at which its light leaves
it are polynomials of the depth, to 1e-3 of the light from 0.05 of the LEDs' height above the gel at rest to 0.15 of it
below: one form for light that goes straight and for light that a window bends.
"""

from dataclasses import dataclass, replace
from math import inf
from typing import Self

import numpy as np
from numpy.typing import NDArray

from gellight.photometric.light_model import WHITE, LightGroups, LightModel
from gellight.photometric.solver import Points, light_row
from gellight.photometric.window import bent

Floats = NDArray[np.float32]
NODES = -0.05, 0.07, 0.15
"""depths, in heights of the LEDs, at which the light on cells is computed, beside that at rest"""


@dataclass(frozen=True, eq=False)
class OnCells:
    """The light of K LEDs on (h, w) cells, as polynomials of the depth z."""

    feet: Floats
    """(K, 4) x, y of each LED, and of the place of the picture from which its shadows fall, mm"""
    light: Floats
    """(K, 9, h, w): the height a = a_0 + a_1 z + a_2 z^2 at which it seems to stand above the point; b_1, b_2, b_3 of
    b = 1 + b_1 z + ...; and its share in each channel over a_0. With the way (x, y) along the gel to its foot it brings
    b (a - slopes . (x, y)) / a_0 of its light at rest, where the slopes are upright enough to be lit"""
    rays: Floats
    """(K, 5, h, w): the slope v = v_0 + v_1 z + v_2 z^2 at which the light leaves it; and how many cells along a row
    its light comes from in a row's step towards it, and along a column in a column's step"""
    most_mm: tuple[float, float]
    """the least and the largest depth that this is for"""


@dataclass(frozen=True, eq=False)
class LedLight:
    """The LEDs of one sensor, at blocks of its pictures, and how its camera answers to their light."""

    leds: Floats
    """(K, 6) position, mm, and axis"""
    exponent: float
    """of the cosine in the emission of a LED"""
    shares: Floats
    """(K, 3, h, w) share of each LED in the light of each channel at rest"""
    black: Floats
    """(3,) grey level of no light"""
    gamma: float
    window_mm: float = 0.0
    """of what bends the light"""

    @classmethod
    def of(cls, model: LightModel, blocks: tuple[int, int]) -> Self:
        """Return that of a light model at (h, w) blocks of the picture."""
        ring, alone = model.ring, replace(model, image_shape=blocks).references(LightGroups.SINGLES)
        seen = model.crosstalk[:, ring.channels, None, None] * alone
        shares = (seen / seen.sum(axis=1, keepdims=True)).swapaxes(0, 1)
        return cls(
            leds=np.concatenate([ring.positions_mm(), ring.axes()], axis=1).astype(np.float32),
            exponent=ring.emission_exponent,
            shares=np.ascontiguousarray(shares, np.float32),
            black=np.asarray(model.black_grey, np.float32),
            gamma=model.gamma,
            window_mm=ring.window_mm,
        )

    def lost_by_depth(self, points: Points, slopes: Floats, shares: Floats) -> Floats:
        """Return the light that points lack against gel of their slopes at the depth of the gel at rest, (3, N).

        slopes: (N, 2). shares: (K, 3, N), as in each pixel. In shares of the light at rest.
        """
        normal, lost = unit_normals(slopes), np.zeros(shares.shape[1:], np.float32)
        for led, share in enumerate(shares):
            level, now = (self._brought(led, at, normal) for at in (points.at_rest, points))
            lost += share * (level - now)
        return lost

    def lit(self, points: Points, slopes: Floats, shares: Floats) -> Floats:
        """Return the light of points at the depth of the gel at rest with slopes (N, 2), (3, N), of that at rest."""
        normal, light = unit_normals(slopes), np.zeros(shares.shape[1:], np.float32)
        for led, share in enumerate(shares):
            light += share * self._brought(led, points.at_rest, normal)
        return light

    def _brought(self, led: int, points: Points, normal: Floats) -> Floats:
        """Return what a LED brings to points with unit normals (3, N), in shares of that at rest."""
        light = self._row(led, points)
        return np.asarray(np.maximum((light * normal).sum(axis=0), 0), np.float32)

    def _row(self, led: int, points: Points) -> Floats:
        position, axis = self.leds[led, :3].tolist(), self.leds[led, 3:].tolist()
        one = np.ones_like(points.z_mm)
        return np.asarray(light_row(points, one, position, axis, self.exponent, self.window_mm))

    def on_cells(self, x_mm: Floats, y_mm: Floats, camera_height_mm: float = inf) -> OnCells:
        """Return it on cells that lie at x_mm (w,) and y_mm (h,) of the gel at rest, seen from such a height."""
        x, y = (axis.astype(np.float64).ravel() for axis in np.meshgrid(x_mm, y_mm))
        lowest = float(self.leds[:, 2].min())
        at = [Points.seen_at(x, y, np.full(x.shape, depth * lowest), camera_height_mm) for depth in (0, *NODES)]
        cell = float(x_mm[1] - x_mm[0]), float(y_mm[1] - y_mm[0])
        found = [self._polynomials(led, at, camera_height_mm, cell) for led in range(len(self.leds))]
        feet, light, rays = (np.stack(part).astype(np.float32) for part in zip(*found, strict=True))
        shape = len(y_mm), len(x_mm)
        light = light.reshape(len(light), 6, *shape)
        light = np.concatenate([light, self.shares / light[:, :1]], axis=1)
        most = NODES[0] * lowest, NODES[-1] * lowest
        return OnCells(feet, light, rays.reshape(len(rays), 5, *shape), most)

    def _polynomials(
        self, led: int, at: list[Points], camera_height_mm: float, cell_mm: tuple[float, float]
    ) -> tuple[Floats, Floats, Floats]:
        """Return foot (4,), light without its shares (6, N) and rays (5, N) of one LED; see `OnCells`."""
        rest, *deeper = at
        z = np.array([points.z_mm[0] for points in deeper])
        powers = np.vander(z, 4, increasing=True)[:, 1:]
        heights, slants = zip(*(self._stands(led, points, min(cell_mm)) for points in at), strict=True)
        rows = [self._row(led, points)[2] * heights[0] / height for points, height in zip(at, heights, strict=True)]
        b = np.linalg.solve(powers, np.stack(rows[1:]) - 1)
        a, v = (
            np.vstack([of[0], np.linalg.lstsq(powers[:, :2], np.stack(of[1:]) - of[0], rcond=None)[0]])
            for of in (heights, slants)
        )
        foot = self.leds[led, :2].astype(np.float64)
        to_x, to_y = ((foot[axis] - p) / a[0] + p / camera_height_mm for axis, p in enumerate((rest.x_mm, rest.y_mm)))
        per_row, per_column = (
            step * cell_mm[1 - n] / (np.maximum(np.abs(other), 1e-9) * cell_mm[n])
            for n, (step, other) in enumerate(((to_x, to_y), (to_y, to_x)))
        )
        below = Points(*np.append(foot, 0.0)[:, None])
        under = self._stands(led, below, min(cell_mm))[0][0]
        from_mm = foot / max(1 - under / camera_height_mm, 1e-6)
        return np.concatenate([foot, from_mm]), np.vstack([a, b]), np.vstack([v, per_row, per_column])

    def _stands(self, led: int, points: Points, least_mm: float) -> tuple[Floats, Floats]:
        """Return how high a LED seems to stand above points, (N,), and the slope at which the light to them leaves it.

        Points nearer to its foot than `least_mm` are taken to be as far away.
        """
        x, y, height = self.leds[led, :3].tolist()
        sideways = np.hypot(x - points.x_mm, y - points.y_mm)
        below = above = height - points.z_mm
        if self.window_mm:
            rays = bent(sideways, height - self.window_mm, self.window_mm - points.z_mm)
            below, above = rays.below_mm, rays.above_mm
        return above, np.asarray(below / np.maximum(sideways, least_mm))

    def with_light(self, seen: Floats, lost: Floats, rest: Floats) -> Floats:
        """Return the differences (M, 3) that points with the light `lost` (M, 3) would show, seen: without it.

        rest: (M, 3) grey levels at rest.
        """
        span = WHITE - self.black
        at_rest, now = (np.maximum((grey - self.black) / span, 0) ** self.gamma for grey in (rest, rest + seen))
        light = np.maximum(now + lost * at_rest, 0)
        return np.asarray(self.black + span * light ** (1 / self.gamma) - rest, np.float32)


def unit_normals(slopes: Floats) -> Floats:
    """Return the unit normals (3, ...) of slopes (..., 2)."""
    normal = np.stack([-slopes[..., 0], -slopes[..., 1], np.ones_like(slopes[..., 0])])
    return np.asarray(normal / np.sqrt((normal**2).sum(axis=0)), np.float32)
