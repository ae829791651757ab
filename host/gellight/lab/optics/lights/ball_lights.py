"""The vectors of any lights from balls of known radius: there every normal is known.

With the normals known, I_k / R_k = v_k . n is linear in v_k (see `photometric.directions`): least
squares, repeated without what is far darker than the answer, which lies in shadow. From the flat gel alone a light
cannot be found: how it falls off there hardly tells a low light from a high one.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from gellight.base.errors import InputError
from gellight.lab.optics.lights.ball_series import LEAST_BALLS, BallSeries, HeldOutBalls, count, held_out
from gellight.lab.training.presses import Ball
from gellight.photometric.directions import LightDirections, view_places
from gellight.photometric.solver import LEAST_LIGHTS

Array = NDArray[np.float64]
Floats = NDArray[np.float32]
NEAR_BALLS = 6
"""with fewer a light has one vector for the whole view"""
_INNER = 0.9
"""of the contact radius: what is fitted to"""
_ROUNDS = 4  # chosen: of leaving out what the one before shows to be shadowed
_SHADOW = 0.12
"""a pixel that is darker by this share of the untouched gel than its normal says is shadowed"""
_WORST_DEG = 12.0  # measured: six real lights give 2.35, a ring that is not theirs 18.5
_LEAST_LEAN = 0.1
"""length of a light's sideways part: with less for all of them, slopes change nothing"""


def smoothed(untouched: Floats, ball: Ball) -> Floats:
    """Return (K, H, W) the light on the untouched gel without noise and dirt; InputError where it is dark."""
    smooth: Floats = ndimage.gaussian_filter(untouched, (0, *[0.4 * ball.radius_px] * 2), mode="nearest")
    if smooth.min() < 1:
        raise InputError("the untouched gel is dark somewhere: every light has to reach all of the view; crop it")
    return smooth


def lights_from_balls(
    series: Sequence[BallSeries], untouched: Floats, ball: Ball, noise_grey: float
) -> LightDirections:
    """Find the lights from pictures of balls, and (K, H, W) of the untouched gel, one a light, grey levels.

    Raises InputError for fewer than three lights or four balls, and where the lights do not explain the balls.
    """
    shape = (untouched.shape[1], untouched.shape[2])
    if len(untouched) < LEAST_LIGHTS or any(one.levels.shape != untouched.shape for one in series):
        raise InputError(
            f"{len(untouched)} pictures of the untouched gel: give one each, at least {LEAST_LIGHTS} lights, and "
            "pictures of balls under the same lights, of the same size"
        )
    if count(series) < LEAST_BALLS:
        raise InputError(f"{count(series)} balls are too few to find lights by: give at least {LEAST_BALLS}")
    smooth = smoothed(untouched, ball)
    known = [(one, *one.inside(ball, _INNER)) for one in series]
    places = [view_places(shape, pixels)[: 3 if count(series) >= NEAR_BALLS else 1] for _, pixels, _ in known]
    columns = np.concatenate(
        [
            (normal.T[:, :, None] * place.T[:, None, :]).reshape(len(pixels), -1)
            for (_, pixels, normal), place in zip(known, places, strict=True)
        ]
    )
    vectors = np.zeros((len(untouched), 3, 3))
    for light, rest in enumerate(smooth):
        share = [one.levels[light].ravel()[pixels] / rest.ravel()[pixels] for one, pixels, _ in known]
        vectors[light, :, : len(places[0])] = _lit_fit(columns, np.concatenate(share).astype(np.float64)).reshape(3, -1)
    if np.hypot(*vectors[:, :2, 0].T).max() < _LEAST_LEAN:
        raise InputError("all lights come from straight above: slopes change nothing; light the gel from the sides")
    return LightDirections(
        vectors=vectors,
        untouched=smooth,
        noise_grey=noise_grey,
        pixel_size_mm=ball.pixel_size_mm,
        camera_height_mm=ball.told_height_mm,
    )


def check_lights(lights: LightDirections, series: Sequence[BallSeries], ball: Ball) -> HeldOutBalls:
    """Feel balls that the lights were not found from; InputError where they are felt badly."""
    found = held_out(lambda levels: lights.gradient_map(levels)[0], series, ball)
    if found.normal_deg > _WORST_DEG:
        raise InputError(
            f"balls that were held out are felt {found.normal_deg:.1f} degrees off, {_WORST_DEG:g} are allowed: check "
            "the circles, the radius of the ball, and that the pictures are of one press and in the order of the lights"
        )
    return found


def _lit_fit(columns: Array, share: Array) -> Array:
    lit = share > 0.15
    amounts = np.zeros(columns.shape[1])
    for _ in range(_ROUNDS):
        amounts = np.asarray(np.linalg.lstsq(columns[lit], share[lit], rcond=None)[0], np.float64)
        lit = share > np.maximum(columns @ amounts - _SHADOW, 0.15)
    return amounts
