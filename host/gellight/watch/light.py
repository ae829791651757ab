"""Where the light of each LED falls on the untouched gel, learned from the reference image alone.

LED k sits at azimuth 30 degrees * k on a ring of radius r, a height h above the gel. It lights the gel at (x, y) with

    E_k(x, y) = (h / d)^n / d^2,    d^2 = (x - r cos a_k)^2 + (y + r sin a_k)^2 + h^2

(inverse square law; n covers the tilt of the gel against the ray and the beam of the LED). The reference image is the
sum over the LEDs, each with its colour, and each colour with its share in each channel of the camera:

    channel c = sum over colours q of X[q, c] * sum over LEDs k of rgb[k, q] / 255 * E_k

r, h and n are fitted by least squares, the shares X in closed form. On the simulated sensor, whose LEDs are tilted and
are seen through overlapping filters, the fit leaves 0.5 % of the picture. It serves to name an LED, not to measure
light: gains and shifts are fitted to the reference image itself, whatever this fit leaves.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gellight.bundle.bundle import Bundle
from gellight.watch.cells import Cells, cell_means, positions_mm

Array = NDArray[np.float64]
Leds = int | NDArray[np.int_]

NAMEABLE_SHARE = 0.1
"""an LED is named only where the fit leaves less than this share of the picture"""
LEAST_GREY = 1.0
"""of light: less than that says nothing of the share"""
_STARTS = ((20.0, 15.0, 1.0), (40.0, 25.0, 1.0), (15.0, 8.0, 2.0))
"""radius mm, height mm, exponent"""
_EVERY = 3
"""every third cell of every third row is enough for three numbers"""


@dataclass(frozen=True, kw_only=True, eq=False)
class RingLight:
    """The light of each LED, as the untouched gel shows it."""

    fields: NDArray[np.float32]
    """(12, h, w, 3) grey levels that each LED adds to each cell"""
    nearer: NDArray[np.float32]
    """(h, w, 3) grey levels that each cell gains per mm that the gel comes nearer to the ring"""
    shape: Array
    """(3,) radius and height, mm, and exponent"""
    brightness: Array
    """(12, 3) grey levels of each LED in each channel on gel straight below it"""

    def share(self, leds: Array, x_mm: Array, y_mm: Array, slopes: Array) -> Array:
        """Return the light that (N, 2) slopes at (N,) places show, (N, 3), where each LED gives a share of its own.

        leds: (12,) that share. The result is a share, too, of the light that they show where nothing changed. On gel of
        slope g, before its place by u, v seen from it, the light of a LED changes by (1 - g_x u / h - g_y v / h) / |n|
        beside flat gel; what is common to all LEDs cancels.
        """
        radius, height, _ = self.shape
        now = then = np.zeros((len(x_mm), 3))
        for led, (part, grey) in enumerate(zip(leds, self.brightness, strict=True)):
            azimuth = np.radians(30.0 * led)
            u, v = radius * np.cos(azimuth) - x_mm, -radius * np.sin(azimuth) - y_mm
            facing = np.maximum(1 - (slopes[:, 0] * u + slopes[:, 1] * v) / height, 0)
            light = (facing * _irradiance(self.shape, x_mm, y_mm, led))[:, None] * grey
            now, then = now + part * light, then + light
        return np.asarray((now + LEAST_GREY) / (then + LEAST_GREY))


def fit_ring_light(bundle: Bundle) -> RingLight | None:
    """Fit the ring to the reference image of a bundle; None where it names no LEDs or the fit is too poor for that."""
    if not bundle.manifest.led:
        return None
    reference = cell_means(bundle.reference)
    x_mm, y_mm = positions_mm(bundle.image_shape, bundle.pixel_size_mm)
    colours = np.array([led.rgb for led in bundle.manifest.led]) / 255
    coarse = (slice(None, None, _EVERY), slice(None, None, _EVERY))

    def left(shape: Array) -> Array:
        by_colour, shares = _by_colour(shape, x_mm[coarse], y_mm[coarse], colours, reference[coarse])
        return np.asarray((by_colour @ shares - reference[coarse]).ravel())

    from scipy import optimize  # takes longer than all else here, and the first frame does without

    fits = [optimize.least_squares(left, start, bounds=([3, 2, -3], [200, 200, 12]), x_scale=_STARTS[0])
            for start in _STARTS]  # fmt: skip
    best = min(fits, key=lambda fit: fit.cost)
    leds = _every_led(colours)
    lit = _irradiance(best.x, x_mm, y_mm, leds)
    _, shares = _by_colour(best.x, x_mm, y_mm, colours, reference)
    brightness = colours @ shares
    fields = lit[..., None] * brightness[:, None, None]
    if np.sqrt(((fields.sum(axis=0) - reference) ** 2).mean() / (reference**2).mean()) >= NAMEABLE_SHARE:
        return None
    nearer = (_gain_per_mm(best.x, x_mm, y_mm, leds)[..., None] * fields).sum(axis=0)
    return RingLight(
        fields=fields.astype(np.float32),
        nearer=np.asarray(nearer, np.float32),
        shape=np.asarray(best.x),
        brightness=np.asarray(brightness),
    )


def _by_colour(shape: Array, x_mm: Array, y_mm: Array, colours: Array, reference: Cells) -> tuple[Array, Array]:
    """Light of each colour at each cell, (h, w, 3), for (radius, height, exponent), and its (3, 3) shares."""
    lit = np.einsum("khw,kq->hwq", _irradiance(shape, x_mm, y_mm, _every_led(colours)), colours)
    shares = np.linalg.lstsq(lit.reshape(-1, 3), reference.reshape(-1, 3).astype(np.float64), rcond=None)[0]
    return lit, shares


def _every_led(colours: Array) -> NDArray[np.int_]:
    return np.arange(len(colours))[:, None, None]


def _irradiance(shape: Array, x_mm: Array, y_mm: Array, led: Leds) -> Array:
    _, height, exponent = shape
    square = _distance2(shape, x_mm, y_mm, led)
    return np.asarray(height ** (2 + exponent) * square ** (-1 - exponent / 2))


def _gain_per_mm(shape: Array, x_mm: Array, y_mm: Array, led: Leds) -> Array:
    """Share by which h^n / d^(n + 2) grows per mm that h shrinks: its logarithm by -h is h (n + 2) / d^2 - n / h."""
    _, height, exponent = shape
    return np.asarray(height * (exponent + 2) / _distance2(shape, x_mm, y_mm, led) - exponent / height)


def _distance2(shape: Array, x_mm: Array, y_mm: Array, led: Leds) -> Array:
    radius, height, _ = shape
    azimuth = np.radians(30.0 * led)
    return np.asarray((x_mm - radius * np.cos(azimuth)) ** 2 + (y_mm + radius * np.sin(azimuth)) ** 2 + height**2)
