"""How deep a ball stands in the gel, by the circle of its contact: contact mechanics, which no light enters.

A rigid ball of radius R touches an elastic layer without friction in a circle of radius a. Below the circle the gel has
the depth u(r) = d - R + sqrt(R^2 - r^2). With the layer's compliance G(k) = 2 (1 - nu^2) / (E k) (1 - w(k h)), see
`reconstruction.force`, and a pressure whose Hankel transform is int_0^a phi(t) cos(k t) dt, Abel's transform makes of
this an integral equation of one variable (Lebedev and Ufliand 1958; Sneddon 1966):

    phi(s) - (2 / pi) int_0^a M(s, t) phi(t) dt = d - s / 2 ln((R + s) / (R - s)),
    M(s, t) = int_0^inf w(k h) cos(k s) cos(k t) dk.

Where a smooth body lets go the pressure is 0, so phi(a) = 0, which tells d. In a half space, w = 0, that is Sneddon's
d = a / 2 ln((R + a) / (R - a)); on a thin layer that is squeezed flat it falls to a^2 / (2 R).

That is for small strains. Finite elements of a gel that yields without end (neo-Hookean, 4.25 mm thick, balls of 2.35
to 4.7 mm) let a ball stand less deep in its circle: by .16 (a / R)^3, within 3 %.
"""

from dataclasses import dataclass
from functools import lru_cache
from math import sqrt

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import InputError
from gellight.lab.training.presses import Ball, Press, cap_depth_mm, contact_circle, on_ball
from gellight.reconstruction.force import Layer, bonded

Array = NDArray[np.float64]
LARGE_STRAIN = 0.16
"""by finite elements, see above"""
_NODES, _WAVES, _FARTHEST = 48, 400, 25.0
"""points of Gauss's rule along a and along k h, and the k h from which a layer answers as a half space to 1e-16"""


@lru_cache(maxsize=1024)
def expected_indentation_mm(contact_radius_mm: float, ball_radius_mm: float, layer: Layer) -> float:
    """Return how deep the lowest point of a ball lies under the gel at rest; see the module's text.

    Raises InputError for a circle that is not smaller than the ball.
    """
    a, radius = contact_radius_mm, ball_radius_mm
    if not 0 < a < radius:
        raise InputError(f"a contact {a:g} mm in radius under a ball of {radius:g} mm: check ball and pixel size")
    points, share = _rule(_NODES, a)
    points, share = np.append(points, a), np.append(share, 0.0)
    waves, step = _rule(_WAVES, _FARTHEST / layer.thickness_mm)
    cosines = np.cos(waves * points[:, None])
    softer = step * (1 - bonded(waves * layer.thickness_mm, layer.poisson_ratio))
    system = np.eye(len(points)) - 2 / np.pi * ((cosines * softer) @ cosines.T) * share
    ball = points / 2 * np.log((radius + points) / (radius - points))
    flat, round_ = np.linalg.solve(system, np.stack([np.ones_like(points), ball], axis=1))[-1].tolist()
    return float(round_ / flat) * (1 - LARGE_STRAIN * (a / radius) ** 3)


def _rule(count: int, end: float) -> tuple[Array, Array]:
    """Return points and weights of Gauss's rule from 0 to `end`."""
    points, weights = np.polynomial.legendre.leggauss(count)
    return (points + 1) * end / 2, weights * end / 2


@dataclass(frozen=True, kw_only=True)
class Indentation:
    """How deep the lowest point of a ball lies under the gel at rest."""

    felt_mm: float
    expected_mm: float

    @property
    def share(self) -> float:
        """Felt over expected."""
        return self.felt_mm / self.expected_mm


def indentation_of(press: Press, ball: Ball, depth_mm: NDArray[np.floating], layer: Layer) -> Indentation:
    """Compare a (H, W) depth map with what the labelled circle says, which is as large as it is on the gel.

    Felt is the lowest point of the ball that fits into the circle: a mean over all of its pixels.
    """
    shape = (depth_mm.shape[0], depth_mm.shape[1])
    inside, rim_px = contact_circle(press, shape), on_ball(press, ball, shape, np.zeros(1), np.zeros(1)).rim
    cap_mm = cap_depth_mm(press, ball, shape, np.flatnonzero(inside))
    radius_mm = sqrt(ball.radius_px**2 - rim_px**2) * ball.pixel_size_mm
    return Indentation(
        felt_mm=float((depth_mm[inside] - cap_mm).mean()) + ball.radius_mm - rim_px * ball.pixel_size_mm,
        expected_mm=expected_indentation_mm(round(radius_mm, 4), ball.radius_mm, layer),
    )
