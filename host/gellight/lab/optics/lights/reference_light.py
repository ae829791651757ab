"""The light model of a sensor from pictures of its untouched gel: dark, each LED alone, and the whole ring.

Flat gel has the normal (0, 0, 1) everywhere, so each picture of one LED is its light itself. Three unknowns of the
camera are found too. Black is what it shows in the dark. Crosstalk is what a channel shows of an LED of another colour.
Gamma makes light add up: the sum of g^gamma over the pictures of single LEDs is that of the picture of the whole ring.
"""

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray
from scipy.optimize import brentq

from gellight.base.errors import BundleError
from gellight.frames.pixel_grid import plane_means
from gellight.lab.optics.lights.ring_fit import STEP_PX, coarse_points, flat_light, own_light
from gellight.photometric.light_model import CLIPPED_GREY, DEGREE, WHITE, LightGroups, LightModel, unmixing
from gellight.photometric.ring_geometry import RingGeometry
from gellight.photometric.static_scene import BLOCK_PX
from gellight.ring.light_groups import colour_triples, single_leds

Array = NDArray[np.float64]
GAMMAS = (0.3, 4.0)  # chosen: wider than cameras have; sRGB is near 2.2
LINEAR_WITHIN = 0.01
"""a gamma this near to 1 is 1: the difference is that of the measurement"""
LEAST_GREY = 8.0
"""a picture of one LED that is darker than this somewhere in its own channel cannot be told from noise"""
LARGEST_RESIDUAL = 0.05  # chosen: the paper's sensor leaves 0.03 %
BRIGHT_SHARE = 0.6  # chosen: of the brightest, for crosstalk to stand out of the noise
GLINTS = 0.001
"""share of the grey levels that may be clipped: medians and smooth patterns do not see a few"""


@dataclass(frozen=True, kw_only=True, eq=False)
class ReferencePictures:
    """Mean pictures of the untouched gel at one exposure, (H, W, 3) grey levels with fraction."""

    dark: Array
    """with all LEDs off: the median of frames, not the mean, which noise that is cut off at 0 would lift"""
    singles: tuple[Array, ...]
    """each LED alone"""
    triples: tuple[Array, ...]
    """a red, a green and a blue LED each, as `light_groups.colour_triples` has them"""
    whole: Array
    """the whole ring"""


def light_model(
    pictures: ReferencePictures,
    ring: RingGeometry,
    colours: NDArray[np.uint8],
    pixel_size_mm: tuple[float, float],
    *,
    exposure_us: float | None = None,
) -> LightModel:
    """Make the light model of a sensor from the pictures of its untouched gel.

    Raises BundleError where a picture is too dark or clipped, where the fall-off of an LED is no smooth pattern,
    or where the LEDs shine from other places than `ring` says.
    """
    black = np.median(pictures.dark.reshape(-1, 3), axis=0)
    singles, triples, whole = (
        np.maximum(np.stack(images) - black, 0) for images in (pictures.singles, pictures.triples, (pictures.whole,))
    )
    _check_brightness(pictures, singles, ring)
    gamma = find_gamma(singles, whole[0])
    taken = {
        kind: WHITE * (images / (WHITE - black)) ** gamma
        for kind, images in ((LightGroups.SINGLES, singles), (LightGroups.TRIPLES, triples))
    }
    crosstalk = find_crosstalk(taken[LightGroups.SINGLES], ring)
    patterns, residual = _patterns(taken, colours, ring, crosstalk)
    model = LightModel(
        ring=ring,
        colours=colours,
        image_shape=(whole.shape[1], whole.shape[2]),
        patterns=patterns,
        crosstalk=crosstalk,
        black_grey=black,
        gamma=gamma,
        exposure_us=exposure_us,
        brightest_grey=max(float(singles[k][..., channel].max()) for k, channel in enumerate(ring.channels)),
        pattern_residual=residual,
    )
    check_places(model, pixel_size_mm)
    return model


def _patterns(
    taken: dict[LightGroups, Array], colours: NDArray[np.uint8], ring: RingGeometry, crosstalk: Array
) -> tuple[dict[LightGroups, Array], float]:
    """Fit the light of the LEDs from linear pictures of both kinds of groups; BundleError where it is rough."""
    lit = {LightGroups.SINGLES: single_leds(colours), LightGroups.TRIPLES: colour_triples(colours)}
    fits = {kind: fit_pattern(_levels(images, lit[kind], ring, crosstalk)) for kind, images in taken.items()}
    residual = max(missed for _, missed in fits.values())
    if residual > LARGEST_RESIDUAL:
        raise BundleError(
            f"the light of single LEDs does not fall off smoothly over the gel ({residual:.1%} beside a smooth "
            "pattern): is something touching it? Lift it off, clean the gel, and take the lights again"
        )
    return {kind: pattern for kind, (pattern, _) in fits.items()}, residual


def find_gamma(singles: Array, whole: Array) -> float:
    """Return the gamma under which pictures (K, H, W, 3) of single LEDs add up to the (H, W, 3) of all, black at 0.

    The sum of (single / whole)^gamma falls with gamma and has to be 1. Raises BundleError where no gamma from 0.3
    to 4 makes it so: the pictures are not of one exposure.
    """
    step = 4
    shares = np.maximum(singles[:, ::step, ::step], 0) / np.maximum(whole[::step, ::step], 1)

    def excess(gamma: float) -> float:
        return float(np.log(np.median((shares**gamma).sum(axis=0))))

    if not excess(GAMMAS[0]) > 0 > excess(GAMMAS[1]):
        raise BundleError(
            f"the pictures of single LEDs add up to {np.exp(excess(1.0)):.2f} of the whole ring's, which no camera "
            "curve explains: fix exposure, gain and white balance, keep other light out, and take the lights again"
        )
    gamma = float(brentq(excess, *GAMMAS, xtol=1e-4))
    return 1.0 if abs(gamma - 1) < LINEAR_WITHIN else round(gamma, 4)


def find_crosstalk(linear: Array, ring: RingGeometry) -> Array:
    """Return the (3, 3) crosstalk from linear pictures (K, H, W, 3) of single LEDs; 1 on the diagonal."""
    columns = []
    for channel in range(3):
        light = linear[[k for k, own in enumerate(ring.channels) if own == channel]].reshape(-1, 3)
        # Only where it is bright: in the dark, noise that is cut off at 0 looks like light of every colour.
        most = np.quantile(light[:, channel], 1 - GLINTS)
        bright = light[(light[:, channel] > BRIGHT_SHARE * most) & (light[:, channel] <= most)].sum(axis=0)
        columns.append(bright / bright[channel])
    return np.stack(columns, axis=1)


def _levels(linear: Array, groups: NDArray[np.uint8], ring: RingGeometry, crosstalk: Array) -> Array:
    """(K, H, W) light of each LED from linear pictures (G, H, W, 3) of light groups (G, K, 3)."""
    levels = np.zeros((groups.shape[1], *linear.shape[1:3]))
    for image, group in zip(linear, groups, strict=True):
        lit, matrix = unmixing(group, ring, crosstalk)
        levels[lit] = np.moveaxis(image @ matrix.T, 2, 0)
    return levels


def fit_pattern(levels: Array) -> tuple[Array, float]:
    """Fit the light of each LED (K, H, W), as `LightModel` keeps it; return coefficients and relative residual.

    The residual is that of means of 8 x 8 pixels, which leave little of the noise of the pictures.
    """
    # Means first, logarithms then: the logarithm of noise is not 0 on average.
    logs = np.log(np.maximum(plane_means(levels.astype(np.float32), BLOCK_PX).astype(np.float64), 0.5))
    common = logs.mean(axis=0)
    tall, wide = (chebyshev.chebvander(_block_places(pixels), DEGREE) for pixels in levels.shape[1:])
    down, across = np.linalg.pinv(tall), np.linalg.pinv(wide)
    # What all LEDs have in common is fitted apart: its dirt and texture then do not count as a residual.
    own = np.einsum("ih,khw,jw->kij", down, logs - common, across, optimize=True)
    shared = down @ common @ across.T
    missed = logs - common - np.einsum("hi,kij,wj->khw", tall, own, wide, optimize=True)
    return own + shared, float(np.sqrt((missed**2).mean()))


def _block_places(pixels: int) -> Array:
    """Centres of the blocks of `plane_means` along an axis of `pixels`, which is from -1 to 1."""
    centres = np.arange(pixels // BLOCK_PX) * BLOCK_PX + (BLOCK_PX - 1) / 2
    return np.asarray(2 * centres / (pixels - 1) - 1)


def check_places(model: LightModel, pixel_size_mm: tuple[float, float]) -> None:
    """Raise BundleError where an LED's pattern fits another LED's place better than its own.

    Patterns are compared as logarithms, without what they have in common, on a coarse grid.
    """
    measured = _unit(own_light(np.log(model.references(LightGroups.SINGLES)[:, ::STEP_PX, ::STEP_PX])))
    light = flat_light(*coarse_points(model.image_shape, pixel_size_mm), model.ring)
    expected = _unit(own_light(np.log(light).reshape(measured.shape)))
    likeness = np.einsum("khw,jhw->kj", measured, expected)
    best = likeness.argmax(axis=1)
    wrong = np.flatnonzero(best != np.arange(len(best)))
    if len(wrong):
        led = int(wrong[0])
        raise BundleError(
            f"LED {led} shines as if it were in the place of LED {int(best[led])} ({len(wrong)} of {len(best)} LEDs "
            "are elsewhere than [geometry] says): turn the ring or the camera, so that LED 0 is at the right of the "
            "picture and the others follow anticlockwise, and take the lights again"
        )


def _unit(light: Array) -> Array:
    """(K, h, w) scaled to unit length."""
    return np.asarray(light / np.linalg.norm(light, axis=(1, 2), keepdims=True))


def _check_brightness(pictures: ReferencePictures, singles: Array, ring: RingGeometry) -> None:
    brightest = float(np.quantile(pictures.whole, 1 - GLINTS))
    if brightest >= CLIPPED_GREY:
        raise BundleError(
            f"the picture under the whole ring reaches {brightest:.0f} of 255 grey levels: "
            "shorten the exposure and take the lights again"
        )
    for led, channel in enumerate(ring.channels):
        own = float(np.median(singles[led][..., channel]))
        if own < LEAST_GREY:
            raise BundleError(
                f"LED {led} alone shows {own:.1f} grey levels above black in its own channel "
                f"{'RGB'[channel]}: is it lit? Lengthen the exposure, or see `gellight ring`"
            )
