"""What is known of the light of one sensor, measured on its untouched gel: response of the camera, pattern of each LED.

Response. A grey level g of a channel stands for the light ((g - black) / (255 - black))^gamma, in units of 255; the
light of the three channels is C s, where s is what the LEDs of each colour send and C the crosstalk of the camera's
colour filters, scaled to 1 on its diagonal. A picture is linearised, then unmixed by the least-squares inverse of those
columns of C whose colours are lit.

Pattern. R_k, the light of LED k on the untouched gel, differs from LED to LED only in how it falls off: what they have
in common, such as the tint and dirt of the coating and the vignetting of the lens, cancels in photometric stereo, whose
unknown factor rho takes it up. So R_k is kept as exp(polynomial of the position), which has no noise and no pixels. It
is kept twice: as it is found in pictures of single LEDs, and in pictures of three, taken apart by the same unmixing
that is used later. So an error of the crosstalk or of gamma, which would tilt and bend a gel at rest, cancels there.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray

from gellight.frames.pixel_grid import plane_means
from gellight.photometric.ring_geometry import RingGeometry
from gellight.ring.light_groups import colour_triples, single_leds

Array = NDArray[np.float64]
Floats = NDArray[np.float32]
Bools = NDArray[np.bool_]
WHITE = 255  # of 8 bits
CLIPPED_GREY = 254
"""a channel at this grey level or above may have been brighter"""
DEGREE = 8
"""of the pattern's polynomial; the paper's sensor is met to 0.03 % at every pixel"""


class LightGroups(StrEnum):
    """What is lit together in one exposure."""

    TRIPLES = "triples"
    """a red, a green and a blue LED: 4 exposures for 12 LEDs"""
    SINGLES = "singles"
    """one LED: 12 exposures"""


@dataclass(frozen=True, kw_only=True, eq=False)
class LightModel:
    """The light of a sensor."""

    ring: RingGeometry
    colours: NDArray[np.uint8]
    """(K, 3) RGB of each LED while it was measured, and is to be lit"""
    image_shape: tuple[int, int]
    patterns: Mapping[LightGroups, Array]
    """(K, d + 1, d + 1) Chebyshev coefficients of log R_k, R_k in grey levels, rows and columns from -1 to 1"""
    crosstalk: Array
    """(3, 3): column = colour of the LED, row = channel, 1 on the diagonal"""
    black_grey: Array
    """(3,) grey level of no light"""
    gamma: float = 1.0
    exposure_us: float | None = None
    """at which it was measured; None where the camera does not say"""
    brightest_grey: float = 0.0
    """of one LED in its own channel, above black, as measured"""
    pattern_residual: float = 0.0
    """root mean square of what the polynomials miss over 8 x 8 pixels, as a share of R"""

    def groups(self, kind: LightGroups) -> NDArray[np.uint8]:
        """(G, K, 3) uint8: which LEDs are lit together."""
        return colour_triples(self.colours) if kind is LightGroups.TRIPLES else single_leds(self.colours)

    def references(self, kind: LightGroups) -> Array:
        """(K, H, W) R_k in grey levels, as pictures of such groups show them."""
        pattern = self.patterns[kind]
        degree = pattern.shape[1] - 1
        down, across = (chebyshev.chebvander(np.linspace(-1, 1, n), degree) for n in self.image_shape)
        logs = np.einsum("hi,kij,wj->khw", down, pattern, across, optimize=True)
        return np.asarray(np.exp(logs))

    def linear(self, image: NDArray[np.uint8]) -> Floats:
        """(H, W, 3) uint8 -> (3, H * W) light in grey levels of a linear camera, 0 at black."""
        levels = np.arange(256)[None] - self.black_grey[:, None]
        span = WHITE - self.black_grey[:, None]
        table = (WHITE * np.sign(levels) * (np.abs(levels) / span) ** self.gamma).astype(np.float32)
        pixels = image.reshape(-1, 3)
        return np.stack([np.take(table[channel], pixels[:, channel]) for channel in range(3)])

    def grey(self, light: Floats, shape: tuple[int, int]) -> NDArray[np.uint8]:
        """(3, H * W) linear grey levels -> (H, W, 3) uint8: the inverse of `linear`, rounded and clipped."""
        shares = np.maximum(light, 0) / WHITE
        levels = self.black_grey[:, None] + (WHITE - self.black_grey[:, None]) * shares ** (1 / self.gamma)
        image = np.clip(np.rint(levels), 0, WHITE).astype(np.uint8)
        return np.ascontiguousarray(image.T.reshape(*shape, 3))


def unmixing(group: NDArray[np.uint8], ring: RingGeometry, crosstalk: Array) -> tuple[list[int], Array]:
    """Return which LEDs a light group (K, 3) lights, and the (LEDs, 3) matrix that takes their light apart."""
    lit: list[int] = np.flatnonzero(group.any(axis=1)).tolist()
    channels = [ring.channels[led] for led in lit]
    if len(set(channels)) != len(channels):
        raise ValueError(f"LEDs {lit} of one light group have the same colour: a camera cannot tell them apart")
    # One LED alone is read in its own channel: the others are nearly dark, where cut-off noise looks like light.
    result = np.zeros((len(lit), 3))
    result[:, channels] = np.linalg.inv(crosstalk[np.ix_(channels, channels)])
    return lit, result


@dataclass(frozen=True, eq=False)
class Signals:
    """The light that each LED alone brings to each pixel."""

    grey: Floats
    """(K, P) linear grey levels; 0 for LEDs of no group"""
    valid: Bools
    """(K, P) neither in shadow nor clipped"""
    deviation: Array
    """(K,) standard deviation of the noise, for a linear camera"""
    light: Floats
    """(3, P) sum of all exposures: what the whole ring would show"""


DARK_DEVIATIONS = 1.0
"""a signal is a shadow when its mean over a few pixels is at most this multiple of the noise of one pixel above black;
noise that is cut off at 0 has a mean of 0.4 by itself"""
SHADOW_DEVIATIONS = 3.0  # measured, with the share: normals of ten objects 0.42 -> 0.25 degrees off
SHADOW_SHARE = 0.2
"""a single pixel is in shadow, too, when it is at most 3 standard deviations above black and below a fifth of what the
untouched gel shows there: the edge of a shadow is sharper than a mean, and a LED far away is dim without one"""
SHADOW_PX = 5
"""side of the square over which the signal is averaged before it is compared with `DARK_DEVIATIONS`. Compared pixel by
pixel, those that noise made darker would be left out and the rest would be too bright on average: a gel at rest would
look bent."""


@dataclass(frozen=True, eq=False)
class GroupSignals:
    """What the pictures of one light group say of its LEDs; names as in `Signals`, (n, P) for its n LEDs."""

    leds: list[int]
    grey: Floats
    valid: Bools
    deviation: Array
    light: Floats


def group_signals(
    taken: Sequence[NDArray[np.uint8]],
    group: NDArray[np.uint8],
    model: LightModel,
    noise_grey: float,
    block_px: int = 1,
) -> GroupSignals:
    """Take apart the pictures of one light group (K, 3), each (H, W, 3) uint8; several are averaged.

    noise_grey: standard deviation of one pixel of one picture. block_px: P is the means over squares of this side.
    """
    from scipy.ndimage import uniform_filter  # SciPy takes longer than all else of a start

    shape = (model.image_shape[0] // block_px, model.image_shape[1] // block_px)
    light: Floats = np.sum([model.linear(image) for image in taken], axis=0) / np.float32(len(taken))
    unclipped = np.all([image[..., channel] < CLIPPED_GREY for image in taken for channel in range(3)], axis=0)
    if block_px > 1:
        light = plane_means(light.reshape(3, *model.image_shape), block_px).reshape(3, -1)
        unclipped = plane_means(unclipped[None].astype(np.float32), block_px)[0] == 1
    lit, matrix = unmixing(group, model.ring, model.crosstalk)
    noise = np.sqrt((noise_grey**2 + 1 / 12) / len(taken)) / block_px
    deviation = noise * np.linalg.norm(matrix, axis=1)
    grey = matrix.astype(np.float32) @ light
    around = uniform_filter(grey.reshape(-1, *shape), (1, *[SHADOW_PX // block_px | 1] * 2)).reshape(len(lit), -1)
    valid = (around > DARK_DEVIATIONS * deviation[:, None]) & unclipped.ravel()
    return GroupSignals(lit, grey, valid, deviation, light)


def joined(parts: Sequence[GroupSignals], leds: int) -> Signals:
    """Return the signals of a ring of `leds` LEDs from those of each of its light groups."""
    pixels = parts[0].light.shape[1]
    found, valid, deviation = np.zeros((leds, pixels), np.float32), np.zeros((leds, pixels), np.bool_), np.zeros(leds)
    for part in parts:
        found[part.leds], valid[part.leds], deviation[part.leds] = part.grey, part.valid, part.deviation
    return Signals(found, valid, deviation, sum((part.light for part in parts), np.zeros((3, pixels), np.float32)))


def signals_of(
    pictures: Sequence[Sequence[NDArray[np.uint8]]], groups: NDArray[np.uint8], model: LightModel, noise_grey: float
) -> Signals:
    """Take apart the pictures of all light groups (G, K, 3); see `group_signals`."""
    pairs = zip(groups, pictures, strict=True)
    return joined([group_signals(taken, group, model, noise_grey) for group, taken in pairs], len(model.colours))


def without_shadows(signals: Signals, references: Floats) -> Signals:
    """Return signals of which those are invalid, too, that are far darker than on the untouched gel, (K, P)."""
    step = 97
    brightness = np.median(signals.grey[:, ::step]) / np.median(references[:, ::step])
    noise = SHADOW_DEVIATIONS * signals.deviation[:, None].astype(np.float32)
    lit = signals.grey > np.minimum(noise, np.float32(SHADOW_SHARE * brightness) * references)
    return replace(signals, valid=signals.valid & lit)
