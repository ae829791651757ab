"""From ball presses to a calibration bundle.

GelNet is trained in a child process, `python -m gelnet.train`; first a tiny network, to see whether any can be trained.
"""

import json
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import TrainingError, first_line
from gellight.bundle.bundle import Bundle, write_bundle
from gellight.frames.camera import EndOfStream
from gellight.frames.dots import Dots, find_dots
from gellight.frames.picture import PictureSteps, PreparedCamera
from gellight.frames.view import View
from gellight.lab.training.child import Check, Progress, go_on, run_module, silent
from gellight.lab.training.level_light import TrainingData, with_lights
from gellight.lab.training.presses import Ball, Press
from gellight.lab.training.table import (
    PressTable,
    TableOptions,
    build_table,
    drift_of_presses,
    rest_of_presses,
    under_light_of,
)
from gellight.opening import open_camera
from gellight.photometric.light_model import LightModel
from gellight.photometric.lights_file import lights_file
from gellight.reconstruction.fine_pattern import pattern_match
from gellight.reconstruction.image_noise import measure_noise, noise_of_one
from gellight.sensor.findings import Finding, ok, warning

Floats = NDArray[np.float32]
MATCHED_PRESSES = 9
"""evenly chosen: they show how well the fine pattern of the unit can be seen"""
HAND_DRAWN = TableOptions(rim_share=0.25)
"""what is trained on of presses whose circles a hand may have drawn"""
_rehearsed: list[str] = []
"""what trained: a process tries it once"""


@dataclass(frozen=True, kw_only=True)
class TrainingOptions:
    """How GelNet is trained; `python -m gelnet.train --help` describes each."""

    recipe: str = "fast"
    width: int = 32
    seed: int = 0
    epochs: int | None = None


@dataclass(frozen=True, kw_only=True)
class Learning:
    """How a calibration learns from its presses."""

    options: TrainingOptions = TrainingOptions()
    like: Bundle | None = None
    """of a unit like this one, whose presses are what few own ones begin with"""
    lights: LightModel | None = None
    """of the LEDs one by one; with it the network learns all slopes at the depth of the gel at rest (`level_light`)"""


AS_A_RULE = Learning()
LIKE = "like"
"""in the metrics: the sensor whose presses helped"""


@dataclass(frozen=True, kw_only=True, eq=False)
class Reference:
    """The untouched gel."""

    image: Floats
    """(H, W, 3) RGB mean of the frames, grey levels"""
    frames: int
    noise_grey: float
    """of one frame, as `image_noise` measures it, grey levels"""
    dots: Dots | None = None
    """the marker dots of the gel, which are filled in `image`; None where it has none"""
    view: View | None = None
    """a smaller one of the pictures, which `image` is in"""

    @property
    def image_shape(self) -> tuple[int, int]:
        """(H, W)"""
        return self.image.shape[0], self.image.shape[1]


def read_reference(source: str | Path, *, bounded: bool = False) -> Reference:
    """Read the untouched gel from one image, or the mean of a folder or pattern of images.

    The noise is the spread between frames (`image_noise.measure_noise`), of a single frame `image_noise.noise_of_one`.
    Marker dots are found and filled. bounded: large pictures are made smaller first (`View.bounded`).
    """
    frames: list[NDArray[np.uint8]] = []
    with open_camera(source) as taken:
        view = View.bounded(taken.image_shape) if bounded else None
        camera = PreparedCamera(taken, PictureSteps.with_view(view)) if view else taken
        while True:
            try:
                frames.append(camera.read().image)
            except EndOfStream:
                break
    mean = np.asarray(np.mean(frames, axis=0, dtype=np.float32))
    dots = find_dots(mean)
    filled = dots.filled_grey(mean, dots.mask(mean)) if dots else mean
    noise = measure_noise(frames, mean).white_grey if len(frames) > 1 else noise_of_one(filled)
    return Reference(image=filled, frames=len(frames), noise_grey=noise, dots=dots, view=view)


def train(
    learnt: TrainingData,
    options: TrainingOptions,
    *,
    untouched: Floats | None = None,
    progress: Progress = silent,
    check: Check = go_on,
) -> tuple[bytes, Mapping[str, object]]:
    """Train GelNet in a child process; TrainingError and interrupts as `run_module`, and for a unit that is not alike.

    untouched: (H, W, 3) picture of the untouched gel, grey levels, where the channels are its colours: GelNet then also
    learns what the lights, or `gelnet.teacher`, say of places where nothing was pressed. The presses of a like unit are
    under this one's light.
    Returns the ONNX file, and the record of the training as it goes into the metrics of a bundle: recipe, what
    trained, losses.
    """
    how = {name: getattr(options, name) for name in ("recipe", "width", "seed", "epochs")}
    chosen = [f"--{name}={value}" for name, value in how.items() if value is not None]
    with tempfile.TemporaryDirectory(prefix="gellight-training-") as folder:
        place = Path(folder)
        more: dict[str, NDArray[np.generic]] = {} if untouched is None else {"untouched": untouched}
        more |= {"like_rows": learnt.like.rows, "like_image": learnt.like.image} if learnt.like else {}
        more |= learnt.lit or {}
        np.savez(place / "table.npz", **learnt.table.arrays(), **more)  # type: ignore[arg-type]
        run_module(
            "gelnet.train",
            ["--table", str(place / "table.npz"), "--out", folder, *chosen],
            progress,
            check=check,
        )
        return (place / "network.onnx").read_bytes(), json.loads((place / "training.json").read_text())


def fit(
    presses: Sequence[Press], reference: Reference, ball: Ball, out: Path, *,
    sensor: str,
    how: Learning = AS_A_RULE,
    view: View | None = None,
    extra_files: Mapping[str, bytes] | None = None,
    extra_metrics: Mapping[str, object] | None = None,
    level_plane: bool = False, skirt_share: float = 1.0,
    overwrite: bool = False, progress: Progress = silent, check: Check = go_on,
) -> Bundle:  # fmt: skip
    """Train on the presses and write the calibration bundle `out`; returns it as it will be loaded.

    The drift of the light is taken off each difference image where the light of the presses differs from the
    reference's by more than the noise of a pixel. What the gel at rest does is measured far from the presses
    (`rest_of_presses`). The rim of circles whose radius no light decided weighs less. The metrics say how well the fine
    pattern of the reference shows (`fine_pattern`).
    Where the LEDs are known they go into the bundle, and the network learns colours as at the depth of the gel at rest,
    and what the LEDs show of all slopes in all places (`level_light`).
    view: how the images were made from pictures as taken. extra_files: more of the bundle. extra_metrics: more, ready
    for JSON. level_plane, skirt_share: as in the manifest.

    Raises InputError, TrainingError or BundleError; then `out` is as it was.
    """
    steps = PictureSteps.of(reference.image_shape, view, reference.dots)
    metrics: dict[str, object] = {"ball_radius_mm": ball.radius_mm, **(extra_metrics or {})}
    metrics["pattern_match"] = _match_of(presses, reference)
    metrics["light_drift_grey"] = drift = drift_of_presses(presses, reference.image)
    follow = drift > reference.noise_grey
    table = build_table(presses, reference.image, ball, HAND_DRAWN, follow_light=follow)
    like = under_light_of(how.like, reference.image) if how.like else None
    size = ball.pixel_size_mm, ball.pixel_size_mm
    learnt = with_lights(table, like, how.lights, reference.image, size, ball.told_height_mm)
    network, record = train(learnt, how.options, untouched=reference.image, progress=progress, check=check)
    metrics |= {LIKE: how.like.manifest.sensor} if how.like else {}
    rest_grey = rest_of_presses(presses, reference.image, noise_grey=reference.noise_grey, follow_light=follow)
    return write_bundle(
        out, sensor=sensor, overwrite=overwrite,
        reference=reference.image, reference_frames=reference.frames, noise_grey=reference.noise_grey,
        rest_grey=rest_grey, follow_light=follow, level_plane=level_plane, skirt_share=skirt_share,
        light_by_depth=learnt.lit is not None, camera_height_mm=ball.told_height_mm,
        network=network, pixel_size_mm=size, presses=table.arrays(like),
        metrics={**metrics, "training": record},
        extra_files={
            **(extra_files or {}), **(steps.files() if steps else {}), **(lights_file(how.lights) if how.lights else {})
        },
    )  # fmt: skip


def learnt_words(metrics: Mapping[str, Any]) -> list[str]:
    """Return what the presses of a like unit, and the measured lights, are worth; nothing where there are none."""
    words, training = [], metrics.get("training", {})
    if LIKE in metrics:
        off = training["unlikeness"]
        words.append(f"begun with the presses of {metrics[LIKE]}, which alone are off by {off:.0%} of the slopes")
    if lights := training.get("lights"):
        learnt = "" if lights["learnt_from"] else "not "
        words.append(f"{learnt}learnt from the measured lights, which are off by {lights['off']:.0%} of the colours")
    return words


def _match_of(presses: Sequence[Press], reference: Reference) -> float:
    """Return how well the fine pattern of the reference shows in some of the presses."""
    some = presses[:: -(-len(presses) // MATCHED_PRESSES)]
    return pattern_match([press.picture() for press in some], reference.image)


def rehearse(*, check: Check = go_on) -> str:
    """Train a network of one unit for one epoch; return what trained it, with its version.

    Raises TrainingError where nothing can be trained.
    """
    if not _rehearsed:
        _rehearsed.append(_trained_by(check))
    return _rehearsed[0]


def _trained_by(check: Check) -> str:
    rows = np.random.default_rng(0).uniform(0, 1, (8, 7)).astype(np.float32)
    table = PressTable(rows=rows, image=np.arange(8, dtype=np.int32) % 2, image_size=(2, 2))
    try:
        _, record = train(TrainingData(table), TrainingOptions(recipe="fast", width=1, epochs=1), check=check)
    except (TrainingError, OSError) as error:
        raise TrainingError(
            f"no network can be trained here ({first_line(error)}): repair what is named there"
        ) from error
    return str(record["trainer"])


def check_trainer() -> Finding:
    """Look whether a network can be trained."""
    try:
        return ok("training", f"{rehearse()} trains networks")
    except TrainingError as error:
        text, _, remedy = str(error).rpartition(": ")
        return warning("training", text, remedy)
