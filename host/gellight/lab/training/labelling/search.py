"""The first guess: a matched filter for the pattern of a pressed ball, over all places and a few radii."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from gellight.frames.pixel_grid import block_means
from gellight.lab.training.labelling.pattern import PressShape, response

Array = NDArray[np.float64]
_COARSE_BALL_PX = 10.0
"""radius of the ball in the shrunken image that is searched"""
_SHARES = np.linspace(0.25, 0.95, 8)
_SUPPORT = 1.8
"""in contact radii: how far the pattern is looked for"""
_APART = 1.5
"""in ball radii: two balls are at least 2 apart"""


@dataclass(frozen=True, kw_only=True)
class Candidate:
    """A place where the pattern explains much of the difference image."""

    center_x: float
    center_y: float
    contact_radius: float
    gain: float
    """what the pattern explains: sum of squares over the image and its channels, grey levels squared"""


def best_candidate(difference: Array, ball_radius: float) -> Candidate:
    """Return where the pattern lowers the sum of squares of the (H, W, 3) difference image most.

    At each place and for each radius the best response of the light is solved for by least squares, so no light
    direction need be known (generalised likelihood ratio). ball_radius in px.
    """
    side = max(1, round(ball_radius / _COARSE_BALL_PX))
    image: Array = block_means(difference, side)
    gains = np.stack([_gain(image, share * ball_radius / side, ball_radius / side) for share in _SHARES])
    number, row, column = (int(n) for n in np.unravel_index(int(gains.argmax()), gains.shape))
    return _candidate(gains, number, row, column, side, ball_radius)


def candidates(difference: Array, ball_radius: float) -> Iterator[Candidate]:
    """Yield places where there may be balls, the likeliest first, each at least 1.5 ball radii from those before.

    Between two balls a pattern explains some of both. So what counts here is what it explains times the square of the
    share that this is of all that changed there.
    """
    side = max(1, round(ball_radius / _COARSE_BALL_PX))
    image: Array = block_means(difference, side)
    gains = np.stack([_gain(image, share * ball_radius / side, ball_radius / side) for share in _SHARES])
    changed = np.stack([_changed(image, share * ball_radius / side) for share in _SHARES])
    score = gains * (gains / np.maximum(changed, 1e-9 + 1e-3 * changed.max())) ** 2
    rows, columns = np.indices(score.shape[1:])
    while (score > 0).any():
        number, row, column = (int(n) for n in np.unravel_index(int(score.argmax()), score.shape))
        yield _candidate(gains, number, row, column, side, ball_radius)
        score[:, np.hypot(rows - row, columns - column) < _APART * ball_radius / side] = 0


def _changed(image: Array, contact_radius: float) -> Array:
    """(H, W) sum of squares of a (H, W, C) image around each pixel, as far as the pattern is looked for."""
    reach = min(int(np.ceil(_SUPPORT * contact_radius)), min(image.shape[:2]) // 2)
    y, x = np.mgrid[-reach : reach + 1, -reach : reach + 1]
    disc = (np.hypot(x, y) < _SUPPORT * contact_radius).astype(np.float64)
    return np.asarray(_correlated((image**2).sum(axis=2, keepdims=True), disc[None])[0])


def _candidate(gains: Array, number: int, row: int, column: int, side: int, ball_radius: float) -> Candidate:
    return Candidate(
        center_x=(column + 0.5) * side - 0.5,
        center_y=(row + 0.5) * side - 0.5,
        contact_radius=float(_SHARES[number]) * ball_radius,
        gain=float(gains[number, row, column]) * side**2,
    )


def _gain(image: Array, contact_radius: float, ball_radius: float) -> Array:
    """(H, W) sum of squares that the pattern explains when its centre is at each pixel."""
    reach = min(int(np.ceil(_SUPPORT * contact_radius)), min(image.shape[:2]) // 2)
    y, x = (axis.ravel() for axis in np.mgrid[-reach : reach + 1, -reach : reach + 1].astype(np.float64))
    shape = PressShape(
        center_x=0, center_y=0, contact_radius=contact_radius, step_share=0.0, skirt_length=0.6 * contact_radius
    )
    # The linear part of the response and the depth are enough to find the place.
    pattern = response(x, y, shape, ball_radius)[:, [0, 1, 2, -1]]
    pattern *= (np.hypot(x, y) < _SUPPORT * contact_radius)[:, None]
    return explained(image, pattern)


def explained(image: Array, pattern: Array) -> Array:
    """(H, W) sum of squares of (H, W, C) that the columns of (n * n, K) explain when they are centred at each pixel."""
    side = round(len(pattern) ** 0.5)
    orthogonal, _ = np.linalg.qr(pattern)
    kernels = orthogonal.T.reshape(-1, side, side)
    return np.asarray((_correlated(image, kernels) ** 2).sum(axis=0))


def _correlated(image: Array, kernels: Array) -> Array:
    """(K * C, H, W) sums of products of each channel of (H, W, C) with each of (K, n, n) kernels, centred, by FFT."""
    height, width = image.shape[:2]
    size = kernels.shape[1]
    shape = [fft.next_fast_len(length + size - 1, real=True) for length in (height, width)]
    seen = [fft.rfft2(image[..., channel], shape) for channel in range(image.shape[2])]
    wanted = [fft.rfft2(kernel[::-1, ::-1], shape) for kernel in kernels]
    found = [fft.irfft2(channel * kernel, shape) for kernel in wanted for channel in seen]
    return np.stack(found)[:, size // 2 : size // 2 + height, size // 2 : size // 2 + width]
