"""Which cause explains the change of the untouched picture: all light alike, single LEDs, a camera that moved, a plate.

They are compared by what they leave of the change (rms over the cells that nothing touches, beyond the noise of the
mean): a gain for each channel of the camera and each colour of the light alone; gains and a shift; gains and the light
of one, two or three single LEDs; gains and a gel that came nearer to the ring all over, perhaps on one side more: a
flat plate on it. A shift, a plate, and each further LED, is believed when it halves what was left.
"""

import itertools
import math
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from gellight.watch.cells import Cells
from gellight.watch.untouched_model import Mask, UntouchedModel

Array = NDArray[np.float64]

BELIEVED = 0.5
"""what a cause may leave, as a share of what is left without it"""
MOST_LEDS = 3  # chosen: where more LEDs have changed, the light is told to be uneven
REST_LEFT = 1.5
"""times what the gel at rest differs by in any case (`rest_grey` of the bundle) needs no explanation"""
SEEN = 0.3
"""what is left beyond the noise is not looked into below this share of the noise"""


@dataclass(frozen=True, kw_only=True)
class Explanation:
    """What happened to light and camera since the calibration."""

    size_grey: float
    """rms of the change"""
    left_grey: float
    """rms of what is not explained, the noise taken off"""
    gains: tuple[float, float, float]
    """mean of red, green and blue now, as a share of what it was; without the single LEDs below"""
    shift_px: tuple[float, float] = (0.0, 0.0)
    """by which the picture's content moved right and down; only where that is the cause"""
    leds: dict[int, float] = field(default_factory=dict)
    """light of single LEDs as a share of what it was, by number; only where that is the cause"""
    pressed_mm: float = 0.0
    """by which the gel came nearer to the ring, at most over the view; only where that is the cause"""

    def leaves(self, most_grey: float, rest_grey: float) -> bool:
        """Tell whether more is left than this limit, and than the gel at rest differs by in any case."""
        return self.left_grey > math.hypot(most_grey, REST_LEFT * rest_grey)


def explain(model: UntouchedModel, change: Cells, kept: Mask, *, noise_grey: float) -> Explanation:
    """Explain the mean (h, w, 3) change of the cells in `kept`, (h, w); at least a few must be kept.

    noise_grey: standard deviation of that mean of a cell.
    """
    fit = _Fit(model, change, kept, noise_grey)
    gain_left = fit.by_gains.left_grey
    if gain_left <= SEEN * noise_grey:
        return fit.by_gains
    weights, moved_left = fit.left(fit.gains + fit.shifts)
    leds, led_left = fit.leds(gain_left)
    plate, pressed_left = fit.left(fit.gains + fit.pressed)
    least = min(moved_left, led_left, pressed_left)
    if least > BELIEVED * gain_left:
        return fit.by_gains
    if fit.pressed and pressed_left == least:
        most_mm = float(plate[-3] + abs(plate[-2]) + abs(plate[-1]))
        return replace(fit.by_gains, left_grey=pressed_left, pressed_mm=most_mm)
    if leds and led_left < moved_left:
        common, strengths = fit.strengths(leds)
        return replace(fit.by_gains, left_grey=led_left, gains=(common, common, common), leds=strengths)
    return replace(fit.by_gains, left_grey=moved_left, shift_px=(float(weights[-2]), float(weights[-1])))


class _Fit:
    """Least squares of the change by any choice of columns; their products are computed once for all choices."""

    def __init__(self, model: UntouchedModel, change: Cells, kept: Mask, noise_grey: float) -> None:
        self._noise = noise_grey
        fields = list(model.ring.fields) if model.ring else []
        parts = [[model.reference], model.gains, model.shifts, model.pressed, fields]
        at = np.cumsum([0, *map(len, parts)])
        self._all, self.gains, self.shifts, self.pressed, self._leds = (
            list(range(start, end)) for start, end in itertools.pairwise(at.tolist())
        )
        columns = np.stack([one[kept].astype(np.float64).ravel() for part in parts for one in part])
        values = change[kept].astype(np.float64).ravel()
        # By einsum, as in `UntouchedModel`: threads of BLAS spin between two looks.
        self._products, self._moments = np.einsum("in,jn->ij", columns, columns), np.einsum("in,n->i", columns, values)
        self._square, self._count = float(np.einsum("n,n->", values, values)), len(values)
        red, green, blue = (1 + change[kept].mean(axis=0) / model.reference[kept].mean(axis=0)).tolist()
        size_grey, left_grey = float(np.sqrt(self._square / self._count)), self.left(self.gains)[1]
        self.by_gains = Explanation(size_grey=size_grey, left_grey=left_grey, gains=(red, green, blue))

    def left(self, chosen: list[int]) -> tuple[Array, float]:
        """Weights of the chosen columns, and the rms of what they leave beyond the noise."""
        products, moments = self._products[np.ix_(chosen, chosen)], self._moments[chosen]
        weights = np.linalg.lstsq(products, moments, rcond=None)[0]
        square = (self._square - 2 * weights @ moments + weights @ products @ weights) / self._count
        return np.asarray(weights), float(np.sqrt(max(square - self._noise**2, 0.0)))

    def leds(self, gain_left: float) -> tuple[list[int], float]:
        """The single LEDs to believe in, by number, and what they leave; none, and what gains leave."""
        chosen: list[int] = []
        believed: tuple[list[int], float] = [], gain_left
        before = gain_left
        for _ in range(min(MOST_LEDS, len(self._leds))):
            more = [[*chosen, led] for led in range(len(self._leds)) if led not in chosen]
            left, chosen = min((self.left(self.gains + [self._leds[k] for k in leds])[1], leds) for leds in more)
            if left <= BELIEVED * before:
                believed = chosen, left
            before = left
            if left <= SEEN * self._noise:
                break
        return believed

    def strengths(self, leds: list[int]) -> tuple[float, dict[int, float]]:
        """Gain of all light, and the light of each of these LEDs as a share of what the gain leaves it.

        A gain for each colour, four LEDs of twelve, would take a part of what a single LED has lost.
        """
        weights, _ = self.left(self._all + [self._leds[led] for led in leds])
        common = 1 + float(weights[0])
        return common, {led: max(0.0, 1 + float(w) / common) for led, w in zip(leds, weights[1:], strict=True)}
