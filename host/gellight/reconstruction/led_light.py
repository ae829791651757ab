"""The light of single LEDs on gel of any depth and slope, and what a picture shows with more or less of it.

LED k brings a point with the unit normal n a share of what it brings to the gel at rest: L_k n, with L_k of
`photometric.solver.light_row` for R_k = 1. L_k depends on the depth z of the point, which is pressed towards the LEDs:
under the ring of the paper a slope looks 5 % steeper 1 mm deep. With w_kc the share of LED k in the light of channel c
on the gel at rest, the point has

    sum over k of w_kc (L_k(0) n - L_k(z) n)

less than the same slope would have at the depth of the gel at rest, in shares of the light at rest; negative numbers
say that it has more.
"""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from gellight.photometric.light_model import WHITE, LightGroups, LightModel
from gellight.photometric.solver import Points, light_row

Floats = NDArray[np.float32]


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
        )

    def on(self, led: int, points: Points, normal: Floats, part: Floats) -> Floats:
        """Return what `part` (N,) of a LED brings to points with unit normals (3, N), in shares of that at rest."""
        position, axis = self.leds[led, :3].tolist(), self.leds[led, 3:].tolist()
        light = light_row(points, part, position, axis, self.exponent)
        return np.asarray(np.maximum((light * normal).sum(axis=0), 0), np.float32)

    def lost_by_depth(self, points: Points, slopes: Floats, shares: Floats) -> Floats:
        """Return the light that points lack against gel of their slopes at the depth of the gel at rest, (3, N).

        slopes: (N, 2). shares: (K, 3, N), as at each point. In shares of the light at rest.
        """
        normal, one = unit_normals(slopes), np.ones_like(points.z_mm)
        level = replace(points, z_mm=np.zeros_like(points.z_mm))
        lost = np.zeros(shares.shape[1:], np.float32)
        for led, share in enumerate(shares):
            lost += share * (self.on(led, level, normal, one) - self.on(led, points, normal, one))
        return lost

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
