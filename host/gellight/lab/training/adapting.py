"""A bundle adapted to light that has changed, from the untouched gel alone: nothing is pressed.

With B the untouched gel of the calibration, B' that of now, a pixel that showed I when a slope g was pressed shows

    I' = (B' / B) t I

under the light of now. t is 1 where all light of a channel changed alike; else it is what the LEDs, each with its own
share, show of g, beside what they show of flat gel (`RingLight.share`). What depth, shadows and the camera do to
the light stays in I. So the presses that a bundle keeps are turned into presses of now, and its network learns from
them again, as it did.

How the light has changed has two explanations, which are tried on cells of 8 x 8 pixels: a gain of each channel, and,
where the bundle knows its LEDs, a share for each LED (`watch.light`), by least squares. The LEDs are believed where
they halve what the gains leave. Nothing else is allowed for. A 3 x 3 matrix between the channels is not determined by
untouched gel, whose three colours differ little over the view: between two real units it made normals worse by 1.6 and
2.9 degrees. A smooth field that is fitted beside it takes the change of the light, as the light is smooth itself.
"""

import json
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import BundleError, InputError
from gellight.bundle.bundle import Bundle, save_bundle
from gellight.bundle.contents import npz
from gellight.bundle.manifest import METRICS
from gellight.frames.camera import Camera, EndOfStream
from gellight.lab.training.child import Progress, silent
from gellight.lab.training.level_light import TrainingData, with_lights
from gellight.lab.training.table import COLOURS, LIKE_UNIT, PressTable
from gellight.lab.training.training import LIKE, Reference, TrainingOptions, train
from gellight.photometric.light_model import LightModel
from gellight.photometric.lights_file import has_lights, lights_file, read_lights
from gellight.reconstruction.image_noise import REST_TIMES, measure_noise
from gellight.reconstruction.measures import PRESSES
from gellight.watch.cells import Cells, cell_means, spread
from gellight.watch.explanation import BELIEVED, REST_LEFT
from gellight.watch.light import RingLight
from gellight.watch.other_unit import UnitCheck
from gellight.watch.untouched_model import OUTLIER_NOISES, UntouchedModel

FRAMES = 30  # chosen: one second at 30 frames/s; the noise of the mean is a fifth
MOST_NOISE = 2.0
"""times the noise of the bundle: beyond it something moves"""
DARKEST_LED = 1e-3  # chosen: a dead LED has a logarithm
ADAPTED = "adapted"
"""in the metrics of such a bundle: from which bundle, and how the light has changed"""
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


def untouched_now(camera: Camera, bundle: Bundle) -> Reference:
    """Average up to `FRAMES` pictures of the untouched gel, prepared as the bundle says.

    A simulated sensor lifts what it presses. Raises InputError where something moves, BundleError where the pictures do
    not fit the bundle or show another unit, CameraError.
    """
    bundle.check_fits(camera.url, camera.image_shape)
    if camera.stage is not None:
        camera.stage.take_over()
    images: list[NDArray[np.uint8]] = []
    try:
        while len(images) < FRAMES:
            images.append(camera.read().image)
    except EndOfStream:
        pass
    mean = np.asarray(np.mean(images, axis=0, dtype=np.float64), np.float32)
    noise_grey = measure_noise(images, mean).white_grey if len(images) > 1 else bundle.manifest.noise_grey
    if noise_grey > MOST_NOISE * bundle.manifest.noise_grey:
        raise InputError(
            f"pictures of the untouched gel differ by {noise_grey:.1f} grey levels, at the calibration by "
            f"{bundle.manifest.noise_grey:.1f}: touch nothing, and wait until the light is steady"
        )
    UnitCheck(bundle).refuse(np.clip(np.rint(mean), 0, 255).astype(np.uint8))
    return Reference(image=mean, frames=len(images), noise_grey=noise_grey)


def adapt(
    bundle: Bundle, untouched: Reference, out: Path, *, overwrite: bool = False, progress: Progress = silent
) -> tuple[Bundle, LightChange]:
    """Write the bundle for the light of now to `out`; return it, and how the light has changed.

    Raises InputError where light does not explain the untouched gel, BundleError for a bundle that keeps no presses or
    is of several lights, TrainingError; then `out` is as it was.
    """
    kinds = ("", LIKE_UNIT) if LIKE in bundle.metrics else ("",)
    kept, options = [PressTable.of(bundle, kind) for kind in kinds], _as_it_was_trained(bundle)
    change = light_change(bundle, untouched.image, untouched.frames)
    kept = [replace(table, rows=rows_of_now(table, bundle, change)) for table in kept]
    learnt, lights = TrainingData(kept[0], kept[1] if len(kept) > 1 else None), _lights_of_now(bundle, change)
    if lights and bundle.manifest.light_by_depth:
        size, height_mm = bundle.pixel_size_mm, bundle.manifest.camera_height_mm
        learnt = with_lights(learnt.table, learnt.like, lights, untouched.image, size, height_mm)
    network, record = train(learnt, options, untouched=untouched.image, progress=progress)
    told = {"from": bundle.identity, "frames": untouched.frames, **change.as_json()}
    metrics = {**bundle.metrics, "training": record, ADAPTED: told}
    files = {
        bundle.manifest.network: network,
        PRESSES: npz(kept[0].arrays(*kept[1:])),
        METRICS: (json.dumps(metrics, indent=2, sort_keys=True, allow_nan=False) + "\n").encode(),
        **(lights_file(lights) if lights else {}),
    }
    made = bundle.with_files(files).with_reference(untouched.image, frames=untouched.frames)
    created = datetime.now(UTC).replace(microsecond=0)
    made = replace(made, manifest=made.manifest.model_copy(update={"created": created}))
    return save_bundle(made, out, overwrite), change


def rows_of_now(table: PressTable, bundle: Bundle, change: LightChange) -> NDArray[np.float32]:
    """Return the rows of a table with the colours that its slopes have in the light of now."""
    rows = table.rows.copy()
    column, row = rows[:, COLOURS].astype(np.intp), rows[:, COLOURS + 1].astype(np.intp)
    was = np.maximum(bundle.reference[row, column], 1)
    now = was * spread(change.ratio, bundle.image_shape)[row, column]
    turned = np.ones_like(was)
    if change.leds is not None and change.ring is not None:
        middle = (np.array(bundle.image_shape[::-1]) - 1) / 2
        x_mm, y_mm = ((rows[:, COLOURS : COLOURS + 2] - middle) * bundle.pixel_size_mm).T
        slopes = rows[:, COLOURS + 2 :].astype(np.float64)
        turned = change.ring.share(change.leds, x_mm, y_mm, slopes)
        turned /= change.ring.share(change.leds, x_mm, y_mm, np.zeros_like(slopes))
    rows[:, :COLOURS] = now * (turned * (1 + rows[:, :COLOURS] / was) - 1)
    return rows


def _as_it_was_trained(bundle: Bundle) -> TrainingOptions:
    """Return how the network of a bundle was trained; BundleError where it does not say, or has several lights."""
    if bundle.presses()["rows"].shape[1] != COLOURS + 4:
        raise BundleError(f"{bundle.source} is of several lights: calibrate the sensor again")
    try:
        record = bundle.metrics["training"]
        return TrainingOptions(**{name: record[name] for name in ("recipe", "width", "seed", "epochs")})
    except (KeyError, TypeError) as error:
        raise BundleError(
            f"{bundle.source} does not say how it was trained ({error}): calibrate the sensor again"
        ) from error


def _lights_of_now(bundle: Bundle, change: LightChange) -> LightModel | None:
    """Return the light model with each LED as bright as it is now; None where the bundle has none."""
    if not has_lights(bundle):
        return None
    model = read_lights(bundle)
    leds = change.gains[model.colours.argmax(axis=1)] if change.leds is None else change.leds
    patterns = {kind: pattern.copy() for kind, pattern in model.patterns.items()}
    for pattern in patterns.values():
        pattern[:, 0, 0] += np.log(np.maximum(leds, DARKEST_LED))
    return replace(model, patterns=patterns)


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
