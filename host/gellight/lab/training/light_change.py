"""How the light of a sensor has changed since its calibration, from the untouched gel alone.

Two explanations are tried on cells of 8 x 8 pixels: a gain of each channel, and, where the bundle knows its LEDs, a
share for each LED (`watch.light`), by least squares. The LEDs are believed where they halve what the gains leave.

Nothing else is allowed for. A 3 x 3 matrix between the channels is not determined by untouched gel, whose three colours
differ little over the view: between two real units it made normals worse by 1.6 and 2.9 degrees. A smooth field that is
fitted beside it takes the change of the light, as the light is smooth itself.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import InputError
from gellight.bundle.bundle import Bundle
from gellight.reconstruction.image_noise import REST_TIMES
from gellight.watch.cells import Cells, cell_means
from gellight.watch.explanation import BELIEVED, REST_LEFT
from gellight.watch.light import RingLight
from gellight.watch.untouched_model import OUTLIER_NOISES, UntouchedModel

Array = NDArray[np.float64]

LEAST_GAIN, MOST_GAIN = 0.3, 1.5
"""of a channel: with less light noise hides slopes, with more they clip"""
MOST_LEFT_GREY = 0.6
"""rms that is not understood; a dead LED leaves 0.4"""
UNEVEN_SHARE, CHANGE_SHARE = 0.1, 0.01
"""of the change beyond one gain a channel, and of all of it: by that much the light of a cell may be misjudged"""
FREE_CELLS = 2
"""as many cells may be misjudged by more"""
_REMEDY = "lift everything off and clean the gel; if nothing is on it, calibrate the sensor again"


@dataclass(frozen=True, kw_only=True, eq=False)
class LightChange:
    """The light now, beside that of the calibration."""

    gains: Array
    """(3,) of the channels, shares"""
    leds: Array | None
    """(12,) light of each LED, a share; None where the gains say all"""
    left_grey: float
    """rms of what is not explained"""
    ring: RingLight | None
    ratio: Cells
    """(h, w, 3) the untouched gel now over what it was"""

    def as_json(self) -> dict[str, object]:
        """Return the figures, rounded for people."""
        leds = None if self.leds is None else np.round(self.leds, 3).tolist()
        return {"gains": np.round(self.gains, 4).tolist(), "leds": leds, "left_grey": round(self.left_grey, 3)}


def light_change(bundle: Bundle, untouched: NDArray[np.floating], frames: int) -> LightChange:
    """Explain the (H, W, 3) mean of `frames` pictures of the gel now; InputError, saying why, where light cannot."""
    model = UntouchedModel(bundle)
    now, was = cell_means(np.asarray(untouched, np.float32)), np.maximum(model.reference, 1)
    ratio: Cells = np.asarray(now / was, np.float32)
    gains = np.asarray(np.median(ratio, axis=(0, 1)), np.float64)
    if not LEAST_GAIN <= gains.min() <= gains.max() <= MOST_GAIN:
        raise InputError(
            f"the channels have {', '.join(f'{gain:.0%}' for gain in gains)} of their light, allowed are "
            f"{LEAST_GAIN:.0%} to {MOST_GAIN:.0%}: set camera and light as the bundle says, or calibrate again"
        )
    noise_grey = model.noise_grey / np.sqrt(frames)
    left, leds = _left(now, gains, was), None
    if model.ring is not None:
        found, left_by_leds = _by_leds(model.ring, ratio, was)
        _refuse_plate(model, ratio, was, left_by_leds, noise_grey)
        if _rms(left_by_leds) < BELIEVED * _rms(left) and _rms(left) > 2 * noise_grey:
            leds, left = found, left_by_leds
    _refuse_rest(model, now - was, _left(now, gains, was) - left, left, noise_grey)
    return LightChange(gains=gains, leds=leds, left_grey=_rms(left), ring=model.ring, ratio=ratio)


def _left(now: Cells, gains: Array, was: Cells) -> Cells:
    return np.asarray(now - gains * was, np.float32)


def _by_leds(ring: RingLight, ratio: Cells, was: Cells, more: tuple[Cells, ...] = ()) -> tuple[Array, Cells]:
    """Return the (12,) share of each LED and what it leaves; more: other changes that are fitted beside them."""
    total = np.maximum(ring.fields.sum(axis=0), 1)
    columns = np.stack([*ring.fields, *(column * total / was for column in more)]).astype(np.float64)
    rows = columns.reshape(len(columns), -1)
    weights = np.linalg.lstsq(rows.T, (ratio * total).ravel().astype(np.float64), rcond=None)[0]
    fitted = np.tensordot(weights, columns, axes=1) / total
    return np.maximum(weights[: len(ring.fields)], 0), np.asarray((ratio - fitted) * was, np.float32)


def _refuse_plate(model: UntouchedModel, ratio: Cells, was: Cells, left: Cells, noise_grey: float) -> None:
    """Raise InputError where a plate that presses the whole gel explains much of what the LEDs leave."""
    assert model.ring is not None
    beside = _rms(_by_leds(model.ring, ratio, was, tuple(model.pressed))[1])
    if _rms(left) > 2 * noise_grey and beside < BELIEVED * _rms(left):
        raise InputError(f"the picture changed as if something flat pressed the whole gel: {_REMEDY}")


def _refuse_rest(model: UntouchedModel, change: Cells, uneven: Cells, left: Cells, noise_grey: float) -> None:
    """Raise InputError where cells show what light cannot do, or too much is left all over."""
    least = float(np.hypot(OUTLIER_NOISES * noise_grey, REST_TIMES * model.at_rest.rest_grey))
    limit = least + UNEVEN_SHARE * float(np.abs(uneven).max()) + CHANGE_SHARE * float(np.abs(change).max())
    cells = int((np.abs(left) > limit).any(axis=2).sum())
    if cells > FREE_CELLS:
        raise InputError(
            f"{cells / left[..., 0].size:.1%} of the gel has changed as light cannot change it, by up to "
            f"{np.abs(left).max():.1f} grey levels: {_REMEDY}"
        )
    if _rms(left) > np.hypot(MOST_LEFT_GREY, REST_LEFT * model.at_rest.rest_grey):
        raise InputError(f"{_rms(left):.1f} grey levels of the change are not understood: {_REMEDY}")


def _rms(change: Cells) -> float:
    return float(np.sqrt((change**2).mean()))
