"""From ball presses to a calibration bundle.

GelNet is trained in a child process, `python -m gelnet.train`: the host itself never loads torch.
"""

import importlib.util
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import InputError, TrainingError
from gellight.bundle.bundle import Bundle, write_bundle
from gellight.frames.camera import EndOfStream
from gellight.opening import open_camera
from gellight.reconstruction.image_noise import measure_noise
from gellight.training.baselines import Baseline, fit_lookup_table, fit_polynomial
from gellight.training.labelling.refinement import FirstFits, refine_others
from gellight.training.labelling.refinement import refine as refinement_of
from gellight.training.presses import Ball, Press, PressTable, TableOptions, build_table, drift_of_presses
from gellight.training.validation import PressError, felt_by, press_error, press_errors, summarised

Floats = NDArray[np.float32]
Progress = Callable[[int, int, float], None]
"""Called with (epoch, epochs, loss)."""
_REMEDY = 'pip install "gellight[train]"'
_FOLD_SEED = 1
RECIPES = ("fast", "thorough", "paper")


def silent(epoch: int, epochs: int, loss: float) -> None:
    """Report to nobody."""


@dataclass(frozen=True, kw_only=True)
class TrainingOptions:
    """How GelNet is trained; `python -m gelnet.train --help` describes each."""

    recipe: str = "fast"
    width: int = 32
    seed: int = 0
    epochs: int | None = None
    threads: int = 1


@dataclass(frozen=True, kw_only=True)
class Reference:
    """The untouched gel."""

    image: Floats
    """(H, W, 3) RGB mean of the frames, grey levels"""
    frames: int
    noise_grey: float
    """of one frame, as `image_noise` measures it, grey levels"""

    @property
    def image_shape(self) -> tuple[int, int]:
        """(H, W)"""
        return self.image.shape[0], self.image.shape[1]


def read_reference(source: str | Path) -> Reference:
    """Read the untouched gel from one image, or the mean of a folder or pattern of images.

    The noise is the spread between frames (`image_noise.measure_noise`); of a single frame it is estimated from the
    difference of neighbouring pixels, which fixed texture of the gel raises.
    """
    frames: list[NDArray[np.uint8]] = []
    with open_camera(source) as camera:
        while True:
            try:
                frames.append(camera.read().image)
            except EndOfStream:
                break
    mean = np.asarray(np.mean(frames, axis=0, dtype=np.float32))
    noise = measure_noise(frames, mean).white_grey if len(frames) > 1 else _noise_of_one(mean)
    return Reference(image=mean, frames=len(frames), noise_grey=noise)


def _noise_of_one(image: Floats) -> float:
    """Robust estimate from second differences along the rows: (1, -2, 1) has variance 6 sigma^2."""
    second = image[:, :-2] - 2 * image[:, 1:-1] + image[:, 2:]
    return float(1.4826 * np.median(np.abs(second)) / np.sqrt(6))


def train(table: PressTable, options: TrainingOptions, *, progress: Progress = silent) -> tuple[bytes, dict[str, Any]]:
    """Train GelNet in a child process; returns the ONNX file and what training says of itself.

    Raises TrainingError with the child's own message. An interrupt ends the child as well.
    """
    with tempfile.TemporaryDirectory(prefix="gellight-training-") as folder:
        place = Path(folder)
        np.savez(place / "table.npz", **table.arrays())  # type: ignore[arg-type]
        run_module("gelnet.train", _arguments(place, options), progress)
        record: dict[str, Any] = json.loads((place / "training.json").read_text())
        return (place / "network.onnx").read_bytes(), record


def _arguments(place: Path, options: TrainingOptions) -> list[str]:
    arguments = ["--table", str(place / "table.npz"), "--out", str(place)]
    for name in ("recipe", "width", "seed", "threads", "epochs"):
        value = getattr(options, name)
        if value is not None:
            arguments += [f"--{name}", str(value)]
    return arguments


def run_module(module: str, arguments: list[str], progress: Progress) -> None:
    """Run a module of gelnet in a child process and hand its progress on.

    Raises TrainingError with the child's last words unless it ends well. An interrupt ends the child as well.
    """
    if importlib.util.find_spec("torch") is None:
        raise TrainingError(f"training needs torch, which is not installed: {_REMEDY}")
    _run_child([sys.executable, "-m", module, *arguments], progress)


def _run_child(command: list[str], progress: Progress) -> None:
    """Run the command, hand its progress on, and raise TrainingError with its last words unless it ends well."""
    with (
        tempfile.TemporaryFile("w+") as complaints,
        subprocess.Popen(command, stdout=subprocess.PIPE, stderr=complaints, text=True, env=_environment()) as child,
    ):
        try:
            for line in child.stdout or ():
                step = json.loads(line)
                progress(step["epoch"], step["epochs"], step["loss"])
        except BaseException:
            child.kill()
            raise
        status = child.wait()
        complaints.seek(0)
        words = complaints.read().strip()
    if status:
        raise TrainingError(_last_words(words, status))


def _last_words(words: str, status: int) -> str:
    last = words.splitlines()[-1] if words else "it said nothing"
    if "No module named" in last:
        return f"training cannot start ({last}): {_REMEDY}"
    if status < 0:
        return f"training was ended by signal {-status} ({last}): is there enough memory?"
    return last.split(": ", 1)[-1] if status == 2 else f"training failed with status {status}: {last}"


def _environment() -> dict[str, str]:
    """The environment in which the child finds the `gelnet` that the host finds."""
    spec = importlib.util.find_spec("gelnet")
    if spec is None or not spec.submodule_search_locations:
        raise TrainingError("the package gelnet is not installed beside gellight: reinstall gellight")
    places = [str(Path(next(iter(spec.submodule_search_locations))).parent), os.environ.get("PYTHONPATH", "")]
    return {**os.environ, "PYTHONPATH": os.pathsep.join(place for place in places if place)}


def fit(
    presses: Sequence[Press],
    reference: Reference,
    ball: Ball,
    out: Path,
    *,
    sensor: str,
    options: TrainingOptions | None = None,
    table_options: TableOptions | None = None,
    follow_light: bool | None = None,
    refine: bool = False,
    extra_metrics: dict[str, Any] | None = None,
    overwrite: bool = False,
    progress: Progress = silent,
) -> Bundle:
    """Train on the presses and write the calibration bundle `out`; returns it as it will be loaded.

    follow_light: whether to take the drift of the light off each difference image; None: if the light of the presses
    differs from the reference's by more than the noise of a pixel. refine: refit the circles together with the light
    first (`labelling.refinement`); the metrics then say by how much.
    Raises InputError, TrainingError or BundleError; then `out` is as it was.
    """
    refinement: dict[str, Any] = {}
    if refine:
        refined = refinement_of(presses, reference.image, ball)
        presses, refinement = refined.presses, {"refinement": refined.record()}
    drift = drift_of_presses(presses, reference.image)
    follow = drift > reference.noise_grey if follow_light is None else follow_light
    table = build_table(presses, reference.image, ball, table_options or TableOptions(), follow_light=follow)
    network, record = train(table, options or TrainingOptions(), progress=progress)
    metrics = {"ball_radius_mm": ball.radius_mm, "light_drift_grey": drift, "training": record}
    return write_bundle(
        out,
        sensor=sensor,
        reference=reference.image,
        reference_frames=reference.frames,
        noise_grey=reference.noise_grey,
        pixel_size_mm=(ball.pixel_size_mm, ball.pixel_size_mm),
        network=network,
        follow_light=follow,
        metrics={**metrics, **refinement, **(extra_metrics or {})},
        presses=table.arrays(),
        overwrite=overwrite,
    )


def cross_validate(
    presses: Sequence[Press],
    reference: Reference,
    ball: Ball,
    *,
    folds: int = 5,
    options: TrainingOptions | None = None,
    table_options: TableOptions | None = None,
    refine: bool = False,
    progress: Progress = silent,
) -> dict[str, Any]:
    """Train `folds` times without a part of the presses and evaluate each time on that part.

    Every press is evaluated once, by a network that never saw its image. Returns the figures of
    `evaluation.evaluate` over all presses, training_cpu_seconds of each fold, and under baselines the same figures of
    the look-up table and the polynomial in the same folds. progress is called after each fold with (fold, folds, mean
    normal error of that fold, deg).

    With `refine` each fold trains on circles that were refined among themselves. The figures are still against the
    labels as given; under refined are those against the labels of the part held out after they, too, were refined, by
    the response of the light to the training presses. No response and no network ever saw the image whose label it
    refines or judges.
    """
    if not 2 <= folds <= len(presses) // 2:
        raise InputError(f"{folds} folds of {len(presses)} presses: give between 2 and {len(presses) // 2}")
    order = np.random.default_rng(_FOLD_SEED).permutation(len(presses))
    errors: dict[str, list[PressError]] = {}
    seconds: list[float] = []
    first = FirstFits(reference.image, ball)
    with tempfile.TemporaryDirectory(prefix="gellight-folds-") as folder:
        for fold in range(folds):
            part = set(order[fold::folds].tolist())
            training, held_out = _divided(presses, part, reference.image, ball, first if refine else None)
            place = Path(folder) / f"fold-{fold}"
            bundle = fit(
                training, reference, ball, place, sensor=f"fold {fold}", options=options, table_options=table_options
            )
            found = _errors_of_fold(bundle, held_out, reference, ball)
            for name, of_fold in found.items():
                errors.setdefault(name, []).extend(of_fold)
            seconds.append(bundle.metrics["training"]["cpu_seconds"])
            progress(fold + 1, folds, float(np.mean([error.mean_deg for error in found[""]])))
    return {**_arranged(errors), "folds": folds, "training_cpu_seconds": seconds}


def _divided(
    presses: Sequence[Press], part: set[int], reference: Floats, ball: Ball, first: FirstFits | None
) -> tuple[Sequence[Press], dict[str, list[Press]]]:
    """Presses to train on, and those of the part held out by their labels: "" as given, "refined" given first fits."""
    training: Sequence[Press] = [press for i, press in enumerate(presses) if i not in part]
    held_out = {"": [press for i, press in enumerate(presses) if i in part]}
    if first is not None:
        refined = refinement_of(training, reference, ball, first=first)
        training = refined.presses
        held_out["refined"] = refine_others(refined, held_out[""], reference, ball, first=first)
    return training, held_out


def _errors_of_fold(
    bundle: Bundle, held_out: dict[str, list[Press]], reference: Reference, ball: Ball
) -> dict[str, list[PressError]]:
    """Errors of the network and of each baseline, by names "labels/way"; as labelled and GelNet are ""."""
    arrays = bundle.presses()
    width, height = (int(n) for n in arrays["image_size"])
    table = PressTable(rows=arrays["rows"], image=arrays["image"], image_size=(width, height))
    baselines: dict[str, Baseline] = {
        "lookup_table": fit_lookup_table(table),
        "polynomial": fit_polynomial(table),
        "polynomial_ratio": fit_polynomial(table, reference=reference.image),
    }
    follow = bundle.manifest.follow_light
    errors = {labels: press_errors(bundle, presses, ball) for labels, presses in held_out.items()}
    for name, baseline in baselines.items():
        felt = felt_by(baseline, held_out[""], reference.image, ball, follow_light=follow)
        for labels, presses in held_out.items():
            judged = zip(presses, felt, strict=True)  # the same images, whatever their labels
            errors[f"{labels}/{name}"] = [press_error(press, ball, answer) for press, answer in judged]
    return errors


def _arranged(errors: dict[str, list[PressError]]) -> dict[str, Any]:
    """The figures as `cross_validate` documents them."""
    figures = {name: summarised(sorted(of, key=lambda error: error.image)) for name, of in errors.items()}
    arranged: dict[str, Any] = {}
    for labels in ("refined", ""):
        if labels not in figures:
            continue
        prefix = f"{labels}/"
        baselines = {name.removeprefix(prefix): of for name, of in figures.items() if name.startswith(prefix)}
        for of in baselines.values():
            del of["images"]
        arranged = {**figures[labels], "baselines": baselines, **({"refined": arranged} if arranged else {})}
    return arranged
