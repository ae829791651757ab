"""What a pressed ball does to the colours of the gel: a pattern of few parameters, linear in the response of the light.

Inside the contact the gel has the shape of the ball, so at a distance r from the centre its normal leans by an angle
phi with sin(phi) = r / R (section 2.4 of the paper); R is known. Outside, the gel leaves the ball: the slope falls in
a sharp step at the rim and a long skirt, here two exponentials. Which colour a normal has is not known before the
first calibration; it is taken to be a low polynomial of the normal (Lambert's law is its linear part) and of the
depth (a gel that is lit white darkens with it), with unknown coefficients for each channel.
"""

from dataclasses import astuple, dataclass, fields
from typing import Self

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
STEEPEST = 0.985
"""largest contact radius over ball radius: 80 degrees, steeper than any gel stays in touch"""


@dataclass(frozen=True, kw_only=True)
class PressShape:
    """Where and how a ball is pressed; lengths in px."""

    center_x: float
    center_y: float
    contact_radius: float
    step_share: float = 0.4
    """of the slope at the rim, what falls off within `step_length`"""
    step_length: float = 7.0
    skirt_length: float = 50.0

    def vector(self) -> Array:
        """The six numbers in this order."""
        return np.array(astuple(self))

    @classmethod
    def of(cls, vector: Array) -> Self:
        """Take the six numbers."""
        return cls(**dict(zip((field.name for field in fields(cls)), vector.tolist(), strict=True)))


def profile(r: Array, shape: PressShape, ball_radius: float) -> tuple[Array, Array]:
    """Return slope (dimensionless, falling from the centre counts positive) and depth (px) at distances r from it."""
    a, share = shape.contact_radius, shape.step_share
    height = np.sqrt(ball_radius**2 - np.minimum(r, a) ** 2)
    beyond = np.maximum(r - a, 0)
    step, skirt = share * np.exp(-beyond / shape.step_length), (1 - share) * np.exp(-beyond / shape.skirt_length)
    rim_height = np.sqrt(ball_radius**2 - a**2)
    rim_slope = a / rim_height
    slope = np.where(r <= a, r / height, rim_slope * (step + skirt))
    depth = height - rim_height + rim_slope * (shape.step_length * step + shape.skirt_length * skirt)
    return slope, depth


def background(x: Array, y: Array, shape: PressShape, ball_radius: float) -> Array:
    """(N, 3) light that drifted since the reference: a constant and a slow change over the view."""
    return np.stack([np.ones_like(x), (x - shape.center_x) / ball_radius, (y - shape.center_y) / ball_radius], axis=1)


def response(x: Array, y: Array, shape: PressShape, ball_radius: float) -> Array:
    """(N, 9) pattern of the press at the pixels (x, y): products of the normal's components, and the depth."""
    dx, dy = x - shape.center_x, y - shape.center_y
    r = np.hypot(dx, dy)
    slope, depth = profile(r, shape, ball_radius)
    cosine = 1 / np.sqrt(1 + slope**2)
    lean = slope * cosine / np.maximum(r, 1e-9)
    nx, ny, bent = lean * dx, lean * dy, 1 - cosine
    columns = [nx, ny, bent, bent * nx, bent * ny, bent**2, nx**2 - ny**2, nx * ny, depth / ball_radius]
    return np.stack(columns, axis=1)
