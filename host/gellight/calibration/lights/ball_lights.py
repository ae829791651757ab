"""The vectors of any lights from balls of known radius: there every normal is known.

With the normals known, I_k / R_k = v_k . n is linear in v_k (see `reconstruction.photometric.directions`): least
squares, repeated without what is far darker than the answer, which lies in shadow. From the flat gel alone a light
cannot be found: how it falls off there hardly tells a low light from a high one.
"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from gellight.base.errors import InputError
from gellight.reconstruction.integration import angle_deg, normals
from gellight.reconstruction.photometric.directions import LightDirections, view_places
from gellight.reconstruction.photometric.solver import LEAST_LIGHTS
from gellight.training.presses import Ball, Press, distance_px, sphere_gradient

Array = NDArray[np.float64]
Floats = NDArray[np.float32]
LEAST_BALLS = 4
NEAR_BALLS = 6
"""with fewer a light has one vector for the whole view"""
_INNER = 0.9
"""of the contact radius: what is learnt from"""
_ROUNDS = 4
_SHADOW = 0.12
"""a pixel that is darker by this share of the untouched gel than its normal says is shadowed"""
_WORST_DEG = 12.0
_LEAST_LEAN = 0.1
"""length of a light's sideways part: with less for all of them, slopes change nothing"""


@dataclass(frozen=True, kw_only=True)
class HeldOutBalls:
    """How balls are felt that had no part in finding the lights."""

    balls: int
    normal_deg: float
    """mean angle between the normals within 0.8 ball radii of the contact"""
    wide_normal_deg: float
    """the same within 0.95 of it"""
    felt_radius_mm: float
    """median over the balls"""

    def as_json(self) -> dict[str, object]:
        """Return the figures, rounded for people."""
        return {name: round(value, 4) for name, value in asdict(self).items()}


def lights_from_balls(
    levels: Floats, untouched: Floats, presses: Sequence[Press], ball: Ball, noise_grey: float
) -> LightDirections:
    """Find the lights from pictures (K, H, W) of balls, one a light, and of the untouched gel, grey levels.

    The circles of `presses` are in all pictures. Raises InputError for fewer than three lights or four balls, and
    where the lights do not explain the balls.
    """
    if len(levels) < LEAST_LIGHTS or levels.shape != untouched.shape:
        raise InputError(
            f"{len(levels)} pictures of balls and {len(untouched)} of the untouched gel: give one of each for every "
            f"light, at least {LEAST_LIGHTS} lights"
        )
    if len(presses) < LEAST_BALLS:
        raise InputError(f"{len(presses)} balls are too few to find lights by: give at least {LEAST_BALLS}")
    smooth = ndimage.gaussian_filter(untouched, (0, 0.4 * ball.radius_px, 0.4 * ball.radius_px), mode="nearest")
    if smooth.min() < 1:
        raise InputError("the untouched gel is dark somewhere: every light has to reach all of the view; crop it")
    shape = (levels.shape[1], levels.shape[2])
    pixels, normal = _known(presses, ball, shape, _INNER)
    places = view_places(shape, pixels)[: 3 if len(presses) >= NEAR_BALLS else 1]
    columns = (normal.T[:, :, None] * places.T[:, None, :]).reshape(len(pixels), -1)
    vectors = np.zeros((len(levels), 3, 3))
    for light, (seen, rest) in enumerate(zip(levels, smooth, strict=True)):
        share = (seen.ravel()[pixels] / rest.ravel()[pixels]).astype(np.float64)
        vectors[light, :, : len(places)] = _lit_fit(columns, share).reshape(3, -1)
    if np.hypot(*vectors[:, :2, 0].T).max() < _LEAST_LEAN:
        raise InputError("all lights come from straight above: slopes change nothing; light the gel from the sides")
    return LightDirections(vectors=vectors, untouched=smooth, noise_grey=noise_grey, pixel_size_mm=ball.pixel_size_mm)


def check_lights(lights: LightDirections, levels: Floats, presses: Sequence[Press], ball: Ball) -> HeldOutBalls:
    """Feel balls that the lights were not found from; InputError where they are felt badly."""
    gradient_map, _ = lights.gradient_map(levels)
    angles = {}
    for share in (0.8, 0.95):
        pixels, normal = _known(presses, ball, lights.image_shape, share)
        felt = normals(gradient_map).reshape(-1, 3)[pixels]
        angles[share] = float(angle_deg(felt, normal.T.astype(np.float32)).mean())
    felt_mm = float(np.median([felt_radius_px(gradient_map, press) for press in presses])) * ball.pixel_size_mm
    found = HeldOutBalls(
        balls=len(presses), normal_deg=angles[0.8], wide_normal_deg=angles[0.95], felt_radius_mm=felt_mm
    )
    if found.normal_deg > _WORST_DEG:
        raise InputError(
            f"balls that were held out are felt {found.normal_deg:.1f} degrees off, {_WORST_DEG:g} are allowed: check "
            "the circles, the radius of the ball, and that the pictures are of one press and in the order of the lights"
        )
    return found


def _known(
    presses: Sequence[Press], ball: Ball, shape: tuple[int, int], share: float
) -> tuple[NDArray[np.intp], Array]:
    """Pixels inside a share of the contact circles, counted row by row, and their normals (3, N)."""
    pixels, found = [], []
    for press in presses:
        inside = np.flatnonzero(distance_px(press, shape) < share * press.contact_radius_px)
        pixels.append(inside)
        found.append(normals(sphere_gradient(press, ball, shape)).reshape(-1, 3)[inside])
    return np.concatenate(pixels), np.concatenate(found).T.astype(np.float64)


def _lit_fit(columns: Array, share: Array) -> Array:
    lit = share > 0.15
    amounts = np.zeros(columns.shape[1])
    for _ in range(_ROUNDS):
        amounts = np.asarray(np.linalg.lstsq(columns[lit], share[lit], rcond=None)[0], np.float64)
        lit = share > np.maximum(columns @ amounts - _SHADOW, 0.15)
    return amounts


def felt_radius_px(gradient_map: Floats, press: Press) -> float:
    """Least squares of sin(slope) = distance / R inside 0.8 of the contact."""
    shape = (gradient_map.shape[0], gradient_map.shape[1])
    inside = distance_px(press, shape) < 0.8 * press.contact_radius_px
    rows, columns = np.nonzero(inside)
    normal = normals(gradient_map)[inside]
    x, y = columns - press.center_x_px, rows - press.center_y_px
    return float((x * x + y * y).sum() / (normal[:, 0] * x + normal[:, 1] * y).sum())
