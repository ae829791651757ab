"""A bundle adapted to light that has changed, from the untouched gel alone: nothing is pressed.

With B the untouched gel of the calibration, B' that of now, a pixel that showed I when a slope g was pressed shows

    I' = (B' / B) t I

under the light of now. t is 1 where all light of a channel changed alike; else it is what the LEDs, each with its own
share, show of g, beside what they show of flat gel (`RingLight.share`). What depth, shadows and the camera do to
the light stays in I. So the presses that a bundle keeps are turned into presses of now, and its network learns from
them again, as it did.
"""

import json
from dataclasses import replace
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
from gellight.lab.training.level_light import at_rest_depth
from gellight.lab.training.light_change import LightChange, light_change
from gellight.lab.training.table import COLOURS, LIKE_UNIT, PressTable
from gellight.lab.training.training import LIKE, Reference, TrainingOptions, train
from gellight.photometric.light_model import LightModel
from gellight.photometric.lights_file import has_lights, lights_file, read_lights
from gellight.reconstruction.image_noise import measure_noise
from gellight.reconstruction.measures import PRESSES
from gellight.watch.cells import spread
from gellight.watch.other_unit import UnitCheck

FRAMES = 30
MOST_NOISE = 2.0
"""times the noise of the bundle: beyond it something moves"""
DARKEST_LED = 1e-3
ADAPTED = "adapted"
"""in the metrics of such a bundle: from which bundle, and how the light has changed"""


def untouched_now(camera: Camera, bundle: Bundle, *, frames: int = FRAMES) -> Reference:
    """Average up to `frames` pictures of the untouched gel, prepared as the bundle says.

    A simulated sensor lifts what it presses. Raises InputError where something moves, BundleError where the pictures do
    not fit the bundle or show another unit, CameraError.
    """
    bundle.check_fits(camera.url, camera.image_shape)
    if camera.stage is not None:
        camera.stage.take_over()
    images: list[NDArray[np.uint8]] = []
    try:
        while len(images) < frames:
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
    learnt, lights = kept, _lights_of_now(bundle, change)
    if lights and bundle.manifest.light_by_depth:
        seen = bundle.pixel_size_mm, bundle.manifest.camera_height_mm
        learnt = [at_rest_depth(table, lights, untouched.image, *seen) for table in kept]
    like = learnt[1] if len(learnt) > 1 else None
    network, record = train(learnt[0], options, untouched=untouched.image, like=like, progress=progress)
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
