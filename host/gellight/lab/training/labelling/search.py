"""The first guess: a matched filter for the pattern of a pressed ball, over all places and a few radii."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from gellight.frames.pixel_grid import block_means
from gellight.lab.training.labelling.pattern import SIMPLE, PressShape, response

Array = NDArray[np.float64]
_COARSE_BALL_PX = 10.0
"""radius of the ball in the shrunken image that is searched"""
_SHARES = np.linspace(0.25, 0.95, 8)
_SUPPORT = 1.8
"""in contact radii: how far the pattern is looked for"""
_LONGEST_PX = 40.0
"""longer side of the shrunken image at least, where balls are large"""
_RARE = 0.05
"""of a pattern: a place that shows less of it explains little"""


@dataclass(frozen=True, kw_only=True)
class Candidate:
    """A place where the pattern explains much of the difference image."""

    center_x: float
    center_y: float
    contact_radius: float
    gain: float
    """what the pattern explains: sum of squares over the image and its channels, grey levels squared"""


def best_candidate(difference: Array, ball_radius: float, beyond: float = 0.0) -> Candidate:
    """Return where the pattern lowers the sum of squares of the (H, W, 3) difference image most.

    At each place and for each radius the best response of the light is solved for by least squares, so no light
    direction need be known (generalised likelihood ratio). ball_radius in px; beyond: of it, how far off the picture
    the centre may lie.
    """
    side = max(1, round(min(ball_radius / _COARSE_BALL_PX, max(difference.shape[:2]) / _LONGEST_PX)))
    radius, margin = ball_radius / side, round(beyond * ball_radius / side)
    image: Array = block_means(difference, side)
    seen = np.pad(np.ones(image.shape[:2]), margin)
    image = np.pad(image, ((margin, margin), (margin, margin), (0, 0)))  # 0 beyond the border
    gains = np.stack([_gain(image, seen, share * radius, radius) for share in _SHARES])
    number, row, column = (int(n) for n in np.unravel_index(int(gains.argmax()), gains.shape))
    return Candidate(
        center_x=(column - margin + 0.5) * side - 0.5,
        center_y=(row - margin + 0.5) * side - 0.5,
        contact_radius=float(_SHARES[number]) * radius * side,
        gain=float(gains[number, row, column]) * side**2,
    )


def _gain(image: Array, seen: Array, contact_radius: float, ball_radius: float) -> Array:
    """(H, W) sum of squares that the pattern explains when its centre is at each pixel."""
    reach = min(int(np.ceil(_SUPPORT * contact_radius)), max(image.shape[:2]) // 2)
    y, x = (axis.ravel() for axis in np.mgrid[-reach : reach + 1, -reach : reach + 1].astype(np.float64))
    shape = PressShape(
        center_x=0, center_y=0, contact_radius=contact_radius, step_share=0.0, skirt_length=0.6 * contact_radius
    )
    pattern = response(x, y, shape, ball_radius)[:, SIMPLE]
    pattern *= (np.hypot(x, y) < _SUPPORT * contact_radius)[:, None]
    return explained(image, seen, pattern)


def explained(image: Array, seen: Array, pattern: Array) -> Array:
    """(H, W) sum of squares of (H, W, C) that the columns of (n * n, K) explain when they are centred at each pixel.

    seen: (H, W) 1 inside the picture, 0 beyond its border, where the image is 0 too and counts for nothing.
    """
    side = round(len(pattern) ** 0.5)
    orthogonal, _ = np.linalg.qr(pattern)
    number = orthogonal.shape[1]
    kernels = orthogonal.T.reshape(-1, side, side)
    products = (kernels[:, None] * kernels).reshape(-1, side, side)
    along = _correlated(image, kernels).reshape(number, -1, *seen.shape).transpose(2, 3, 0, 1)
    square = _correlated(seen[..., None], products).reshape(number, number, *seen.shape).transpose(2, 3, 0, 1)
    amounts = np.linalg.solve(square + _RARE * np.eye(number), along)
    return np.asarray((along * amounts).sum(axis=(2, 3)))


def _correlated(image: Array, kernels: Array) -> Array:
    """(K * C, H, W) sums of products of each channel of (H, W, C) with each of (K, n, n) kernels, centred, by FFT."""
    height, width = image.shape[:2]
    size = kernels.shape[1]
    shape = [fft.next_fast_len(length + size - 1, real=True) for length in (height, width)]
    seen = [fft.rfft2(image[..., channel], shape) for channel in range(image.shape[2])]
    wanted = [fft.rfft2(kernel[::-1, ::-1], shape) for kernel in kernels]
    found = [fft.irfft2(channel * kernel, shape) for kernel in wanted for channel in seen]
    return np.stack(found)[:, size // 2 : size // 2 + height, size // 2 : size // 2 + width]
