"""Whether pixels are square: by how much balls have to be stretched along y to look round in a picture.

The pattern of a press (`pattern`) is fitted with y stretched by a ratio k, the response of the light free. The ratio
goes by Gauss and Newton's step over all presses, whose own shapes are eliminated:

    log k += -sum g / sum s,   s = d'w d - d'w J (J'w J)^-1 J'w d,   g = d'w r - d'w J (J'w J)^-1 J'w r

with what is left r, its derivatives d to log k and J to the shape, and the weights w of the robust loss.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import exp

import numpy as np
from numpy.typing import NDArray

from gellight.lab.training.labelling.pattern import (
    PixelSample,
    Residual,
    difference_image,
    fitted,
    free_response,
    jacobian,
    robust_weights,
    sampled_around,
    starts,
)
from gellight.lab.training.presses import Ball, Press

LEAST_PRESSES, _MOST_PRESSES = 4, 9  # chosen: an error by leaving one out; the time grows with presses
_SQUARE, _SURE = 0.03, 4.0
"""how far from 1 square pixels may look, and in standard errors: two samples of one real gel differ by 0.013"""
_ROUNDS, _STEP, _H = 4, 0.1, 0.01  # chosen: of Newton's method, its longest step and where it ends, in log k


@dataclass(frozen=True, kw_only=True)
class PixelRatio:
    """Height of a pixel on the gel over its width, as presses show it."""

    ratio: float
    error: float
    """standard error, by leaving out one press after the other"""

    def remedy(self, image_shape: tuple[int, int]) -> str:
        """Return what is wrong with pictures (H, W), and what to do; nothing where square pixels explain presses."""
        if abs(self.ratio - 1) < max(_SQUARE, _SURE * self.error):
            return ""
        height, width = image_shape
        x, y = width - 0.5, height - 0.5
        return (
            f"pixels are not square: on the gel they are {self.ratio:.3f} +- {self.error:.3f} times as high as wide, so"
            " depth is wrong. Make square ones of all pictures, `gellight calibrate view --corners "
            f'"-0.5,-0.5 {x:g},-0.5 {x:g},{y:g} -0.5,{y:g}" --size {width}x{round(height * self.ratio)}`, and '
            "calibrate again with its --view and the width of a pixel as its size"
        )


def pixel_ratio(presses: Sequence[Press], reference: NDArray[np.number], ball: Ball) -> PixelRatio | None:
    """Return the ratio that some of the presses show, evenly chosen; None where there are too few.

    reference: (H, W, 3) of the untouched gel, grey levels. Raises InputError for a picture that cannot be read.
    """
    some = presses[:: -(-len(presses) // _MOST_PRESSES)]
    if len(some) < LEAST_PRESSES:
        return None
    pixels = [_around(press, reference, ball).few() for press in some]
    total = 0.0
    for _ in range(_ROUNDS):
        pull, square = np.array([_step(*each, exp(total), ball) for each in zip(some, pixels, strict=True)]).T
        step = float(np.clip(pull.sum() / square.sum(), -_STEP, _STEP))
        total += step
        if abs(step) < _H:
            break
    without = (pull.sum() - pull) / (square.sum() - square)
    spread = float(np.sqrt((len(some) - 1) * without.var()))
    return PixelRatio(ratio=exp(total), error=spread)


def _around(press: Press, reference: NDArray[np.number], ball: Ball) -> PixelSample:
    difference = difference_image(press.picture(), reference)
    return sampled_around(difference, (press.center_x_px, press.center_y_px), press.contact_radius_px, ball.radius_px)


def _step(press: Press, pixels: PixelSample, ratio: float, ball: Ball) -> tuple[float, float]:
    """Return -g and s of one press."""
    center, radius = (press.center_x_px, press.center_y_px), ball.radius_px
    residual = _stretched(pixels, center[1], ratio, radius)
    at = fitted(residual, starts(center, press.contact_radius_px, radius)[-1], radius).vector()
    left = residual(at)
    ends = [_stretched(pixels, center[1], ratio * exp(side), radius)(at) for side in (-_H, _H)]
    to_ratio = (ends[1] - ends[0]) / (2 * _H)
    every = np.concatenate([jacobian(residual, at), to_ratio[None]]).reshape(-1, left.size)
    weighted = every * robust_weights(left).ravel()
    square, pull = weighted @ every.T, weighted @ left.ravel()
    own, *_ = np.linalg.lstsq(square[:-1, :-1], np.stack([square[:-1, -1], pull[:-1]], axis=1), rcond=1e-8)
    return float(square[-1, :-1] @ own[:, 1] - pull[-1]), float(square[-1, -1] - square[-1, :-1] @ own[:, 0])


def _stretched(pixels: PixelSample, middle: float, ratio: float, radius: float) -> Residual:
    return free_response(PixelSample(x=pixels.x, y=middle + (pixels.y - middle) * ratio, colour=pixels.colour), radius)
