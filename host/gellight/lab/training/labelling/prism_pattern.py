"""What a prism does to the colours of the gel: a pattern of few parameters, linear in the response of the light.

The gel lies on both faces: there its slope is the tangent of the angle between a face and the gel at rest, to either
side. Beside the contact the slope falls in a step and a long skirt, as beside a ball; at the edge the coating rounds
it.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import asin, cos, pi, sin, tan

import numpy as np
from numpy.typing import NDArray
from scipy import special

from gellight.lab.training.labelling.fitting import FittedShape, FreeResponse
from gellight.lab.training.labelling.pattern import PixelSample

Array = NDArray[np.float64]
Slopes = tuple[float, float]
"""of the face before the edge and of that behind it"""
SIMPLE = (0, 1, 4)
"""columns of the response without products"""


@dataclass(frozen=True, kw_only=True)
class EdgeShape(FittedShape):
    """The pattern of a prism: its numbers are fitted; lengths in px."""

    turn: float
    """of the edge, rad from x towards y"""
    offset: float
    """of the edge from the middle of the window, across it"""
    before: float
    """width of the face on the side of smaller offsets, in the middle"""
    behind: float
    widening: float = 0.0
    """of both faces per px along the edge"""
    rounding: float = 2.0
    """of the edge: standard deviation of a Gaussian"""
    step_share: float = 0.5
    step_length: float = 3.0
    skirt_length: float = 30.0

    def along_across(self, x: Array, y: Array) -> tuple[Array, Array]:
        """Return how far places lie along the edge and across it, px; x and y from the middle of the window."""
        return x * cos(self.turn) + y * sin(self.turn), y * cos(self.turn) - x * sin(self.turn) - self.offset


def face(shape: EdgeShape) -> float:
    """Return the mean width of both faces, px."""
    return (shape.before + shape.behind) / 2


def slopes_of(angle: float, lean: float) -> Slopes:
    """Return the slopes of a prism that leans; rad."""
    return tan(angle + lean), tan(angle - lean)


def lean_of(shape: EdgeShape, angle: float, thin: float = 0.5) -> float:
    """Return how far a prism leans whose faces touch over these widths, rad; thin: 0 to 1, how thin the gel is.

    Let the slopes be a = tan(angle + lean) before, b = tan(angle - lean) behind, and u = (behind - before) / (behind +
    before). Without friction the pressure on a half space ends at both rims where a (pi / 2 - asin u) = b (pi / 2 +
    asin u) (Johnson, Contact Mechanics, section 5.2), on a bed of springs, as a thin gel is, where a before = b behind:

        sin(2 lean) = sin(2 angle) 2 / pi asin(u),    sin(2 lean) = sin(2 angle) u
    """
    u = (shape.behind - shape.before) / (shape.behind + shape.before)
    return asin(sin(2 * angle) * ((1 - thin) * 2 / pi * asin(u) + thin * u)) / 2


def response(along: Array, across: Array, shape: EdgeShape, slopes: Slopes) -> Array:
    """(N, 5) pattern of the prism: across the edge the lean of the normal, how upright it is, their product; depth."""
    signed, depth = _profile(along, across, shape, slopes)
    cosine = 1 / np.sqrt(1 + signed**2)
    lean, bent = signed * cosine, 1 - cosine
    far = along / max(shape.before, shape.behind)
    return np.stack([lean, bent, lean * bent, lean * far, depth / face(shape)], axis=1)


def _profile(along: Array, across: Array, shape: EdgeShape, slopes: Slopes) -> tuple[Array, Array]:
    """Slope across the edge (falling counts positive) and depth (px, 0 at the rim of the contact)."""
    slope = np.where(across < 0, *slopes)
    wide = np.where(across < 0, shape.before, shape.behind) + shape.widening * along
    distance = np.abs(across)
    beyond = np.maximum(distance - wide, 0)
    step = shape.step_share * np.exp(-beyond / shape.step_length)
    skirt = (1 - shape.step_share) * np.exp(-beyond / shape.skirt_length)
    signed = slope * special.erf(across / shape.rounding / 2**0.5) * (step + skirt)
    depth = np.maximum(wide - distance, 0) + shape.step_length * step + shape.skirt_length * skirt
    return np.asarray(signed), np.asarray(slope * depth)


def columns(pixels: PixelSample, shape: EdgeShape, slopes: Slopes) -> Array:
    """(N, 8) light that drifted, and the response."""
    along, across = shape.along_across(pixels.x, pixels.y)
    reach = face(shape)
    drift = [np.ones_like(pixels.x), pixels.x / reach, pixels.y / reach]
    return np.column_stack([*drift, response(along, across, shape, slopes)])


def _derivatives(pixels: PixelSample, shape: EdgeShape, slopes: Slopes) -> Array:
    """(9, 5, N) derivative of `response` to each number of the shape; what only scales a column is left out."""
    along, across = shape.along_across(pixels.x, pixels.y)
    signed, _ = _profile(along, across, shape, slopes)
    alongs = np.zeros((9, len(along)))
    alongs[0] = across + shape.offset
    signeds, depths = _profile_derivatives(along, across, shape, slopes)
    cosine = 1 / np.sqrt(1 + signed**2)
    lean, bent = signed * cosine, 1 - cosine
    leans, bents = cosine**3 * signeds, signed * cosine**3 * signeds
    fars = (leans * along + lean * alongs) / max(shape.before, shape.behind)
    return np.stack([leans, bents, leans * bent + lean * bents, fars, depths / face(shape)], axis=1)


def _profile_derivatives(along: Array, across: Array, shape: EdgeShape, slopes: Slopes) -> tuple[Array, Array]:
    """Return the (9, N) derivatives of slope and depth to each number of the shape."""
    behind = across >= 0
    beyond = np.abs(across) - np.where(behind, shape.behind, shape.before) - shape.widening * along
    outside, beyond = beyond > 0, np.maximum(beyond, 0)
    fast, slow = np.exp(-beyond / shape.step_length), np.exp(-beyond / shape.skirt_length)
    step, skirt = shape.step_share * fast, (1 - shape.step_share) * slow
    slope = np.where(behind, slopes[1], slopes[0])
    edge = slope * special.erf(across / shape.rounding / 2**0.5)
    sharp = slope * (step + skirt) * (2 / pi) ** 0.5 / shape.rounding * np.exp(-((across / shape.rounding) ** 2) / 2)
    acrosses, gaps = np.zeros((2, 9, len(along)))
    acrosses[0], acrosses[1] = -along, -1.0
    gaps[:2] = np.sign(across) * acrosses[:2]
    gaps[0] -= shape.widening * (across + shape.offset)
    gaps[2], gaps[3], gaps[4] = -1.0 * ~behind, -1.0 * behind, -along
    falling = edge * (step / shape.step_length + skirt / shape.skirt_length)
    signeds = sharp * acrosses - np.where(outside, falling, 0) * gaps
    signeds[5] = -sharp * across / shape.rounding
    signeds[6:] = edge * [fast - slow, step * beyond / shape.step_length**2, skirt * beyond / shape.skirt_length**2]
    depths = -np.where(outside, step + skirt, 1) * gaps
    depths[6:] = (
        shape.step_length * fast - shape.skirt_length * slow,
        step * (1 + beyond / shape.step_length),
        skirt * (1 + beyond / shape.skirt_length),
    )
    return signeds, slope * depths


def free_response(pixels: PixelSample, slopes: Slopes, terms: Sequence[int] = range(5)) -> FreeResponse[EdgeShape]:
    """Return what a prism leaves of the colours around it when the response of the light is free in these columns."""
    seen = [0, 1, 2, *(3 + term for term in terms)]
    return FreeResponse(
        pixels.colour,
        lambda shape: columns(pixels, shape, slopes)[:, seen],
        lambda shape: _derivatives(pixels, shape, slopes)[:, terms],
    )
