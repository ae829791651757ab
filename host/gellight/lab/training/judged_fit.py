"""A calibration that knows its errors: networks that did not learn from some presses are judged on these.

What is kept then learns from every press, for one that was never learnt from is lost to the sensor. So it is a little
better than what was judged.
"""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from pathlib import Path
from threading import Event

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import TrainingError
from gellight.base.one_ahead import one_ahead
from gellight.bundle.bundle import Bundle
from gellight.frame_path.pipeline import Reconstructor
from gellight.frames.view import View
from gellight.lab.training.child import Check, Progress, go_on, silent
from gellight.lab.training.folds import trained_folds
from gellight.lab.training.presses import Ball, Press, cap_depth_mm, contact_circle, sphere_gradient
from gellight.lab.training.skirts import Skirts, find_skirts
from gellight.lab.training.table import images_of
from gellight.lab.training.training import Learning, Reference, fit
from gellight.lab.training.validation import PressError, frame_of, press_errors, summarised
from gellight.reconstruction.confidence import TRAINED_QUANTILE
from gellight.reconstruction.error_bounds import (
    COVERED,
    DEG_FLOOR,
    MM_FLOOR,
    ErrorRecord,
    quadratic,
    signs,
)
from gellight.reconstruction.force import Layer
from gellight.reconstruction.integration import angle_deg, normals

FOLDS = 3  # chosen: three networks more to train
MOST_PIXELS = 2000
"""of a press: pixels beside each other are alike"""
_JUDGES, _CLEARLY = 4, 0.9
"""presses that decide on the plane at rest, and to which part it has to bring the error of the depth"""
_RIDGE = 1e-5  # 1e-3 was tried beside it on real presses; this only keeps the sums solvable
Array = NDArray[np.float64]


def fit_judged(
    presses: Sequence[Press],
    reference: Reference,
    ball: Ball,
    out: Path,
    *,
    sensor: str,
    how: Learning,
    view: View | None = None,
    extra_files: Mapping[str, bytes] | None = None,
    extra_metrics: Mapping[str, object] | None = None,
    layer: Layer | None = None, overwrite: bool = False, progress: Progress = silent, check: Check = go_on,
) -> Bundle:  # fmt: skip
    """Do as `training.fit`, and let the bundle say its errors: in `errors.json`, and in `held_out` of its metrics.

    One press is all learnt from: then nobody knows. layer: the gel, where known: indentations of presses held out are
    compared with what it makes of their circles. progress counts the epochs of all trainings.
    """
    images = int(images_of(presses).max(initial=-1)) + 1
    folds = min(FOLDS, images) if images > 1 else 0
    report, stop = in_parts(progress, folds + 1), Event()
    found = [Found(level_plane=False), Found(level_plane=True)]
    train = partial(trained_folds, progress=report, check=partial(_go_on_unless, stop, check))
    parts = train(presses, reference, ball, folds, how) if folds else iter(())
    for fold in one_ahead(parts, stop.set):  # one fold trains while the one before it is judged
        for one in found:
            one.add(fold.bundle, fold.held_out, ball)
    best = found[found[1].better_than(found[0])]
    skirts = find_skirts(partial(best.errors, ball, layer)) if folds else Skirts(1.0, [])
    figures = {"folds": folds, "depth_mm": _depth_errors(found), **_figures(skirts)} if folds else {}
    return fit(
        presses, reference, ball, out, sensor=sensor, how=how, view=view,
        level_plane=best.level_plane, skirt_share=skirts.share, overwrite=overwrite, progress=report, check=check,
        extra_files={**(extra_files or {}), **(fit_errors(best.samples).files() if best.samples else {})},
        extra_metrics={**(extra_metrics or {}), **({"held_out": figures} if folds else {})},
    )  # fmt: skip


def _go_on_unless(stop: Event, check: Check) -> None:
    check()
    if stop.is_set():
        raise TrainingError("ended before it was done")


@dataclass(eq=False)
class Found:
    """What presses held out say of frames with or without the plane of `rest_plane` taken off."""

    level_plane: bool
    judged: list[tuple[Bundle, Sequence[Press]]] = field(default_factory=list)
    samples: list["Samples"] = field(default_factory=list)

    def add(self, bundle: Bundle, presses: Sequence[Press], ball: Ball) -> None:
        """Reconstruct presses that the bundle did not learn from."""
        with_plane = _changed(bundle, level_plane=self.level_plane)
        self.judged.append((with_plane, presses))
        self.samples += samples_of(with_plane, presses, ball)

    def errors(self, ball: Ball, layer: Layer | None, share: float = 1.0) -> list[PressError]:
        """Compare each of these presses with its label; share: of the felt slopes beside contacts that counts."""
        return [
            error
            for bundle, presses in self.judged
            for error in press_errors(_changed(bundle, skirt_share=share), presses, ball, layer)
        ]

    def depth_mm(self) -> NDArray[np.float64]:
        """(n,) mean error of the depth of each press, without its mean."""
        return np.array([one.shape_mm.mean() for one in self.samples])

    def better_than(self, other: "Found") -> bool:
        """Tell whether the depth is better by a tenth, and in most presses."""
        ours, theirs = self.depth_mm(), other.depth_mm()
        return len(ours) >= _JUDGES and bool(ours.mean() < _CLEARLY * theirs.mean() and np.mean(ours < theirs) > 0.5)


def _changed(bundle: Bundle, **manifest: object) -> Bundle:
    return replace(bundle, manifest=bundle.manifest.model_copy(update=manifest))


def _depth_errors(found: Sequence[Found]) -> dict[str, float]:
    """What the metrics say of the plane."""
    names = {False: "as_integrated", True: "without_the_plane_at_rest"}
    return {names[one.level_plane]: round(float(one.depth_mm().mean()), 4) for one in found if one.samples}


def in_parts(progress: Progress, parts: int) -> Progress:
    """Return what reports several trainings, one after the other, as one of as many times the epochs of the first."""
    part, first = -1, 0

    def report(epoch: int, epochs: int, loss: float) -> None:
        nonlocal part, first
        first = first or epochs
        part += epoch == 1
        progress(round((part + epoch / epochs) * first), parts * first, loss)

    return report


def _figures(skirts: Skirts) -> dict[str, object]:
    """What the metrics say: of how many presses, and the errors inside their circles."""
    found = summarised(skirts.errors)
    return {
        **skirts.record(),
        "presses": len(skirts.errors),
        "normal_error_deg": asdict(found.normal_error_deg),
        "depth_mae_mm": found.depth_mae_mm,
        "contact_iou": found.contact_iou,
        **({"indentation": asdict(found.indentation)} if found.indentation else {}),
    }


@dataclass(frozen=True, kw_only=True, eq=False)
class Samples:
    """Pixels of a press that was not learnt from: what tells their error, and the error."""

    signs: NDArray[np.floating]
    """(n, 3) inside the circle, see `error_bounds.signs`"""
    normal_deg: NDArray[np.floating]
    """(n,)"""
    shape_mm: NDArray[np.floating]
    """(n,) error of the depth, absolute, without the mean, because a circle does not say how deep its rim is"""


def samples_of(bundle: Bundle, presses: Sequence[Press], ball: Ball) -> list[Samples]:
    """Reconstruct presses as the sensor runs, and compare some pixels inside the circle of each with the ball.

    Pixels whose place or colour was not learnt are left out: of these nobody knows the error.
    """
    path, random, found = Reconstructor(bundle, undistorted=False), np.random.default_rng(0), []
    for press in presses:
        frame, shape = path.reconstruct(frame_of(press)), bundle.image_shape
        unknown = frame.confidence.not_learnt if frame.confidence else False
        inside = np.flatnonzero(contact_circle(press, shape) & ~unknown)
        if not len(inside):
            continue
        off_mm = frame.depth_mm.ravel()[inside] - cap_depth_mm(press, ball, shape, inside)
        true = normals(sphere_gradient(press, ball, shape, inside)[np.newaxis])[0]
        angle = angle_deg(frame.normal_map.reshape(-1, 3)[inside], true)
        told = signs(frame.gradient_map, frame.depth_mm, frame.contact.mask).reshape(-1, 3)[inside]
        some = random.choice(len(inside), min(len(inside), MOST_PIXELS), replace=False)
        error_mm = np.abs(off_mm - off_mm.mean())
        found.append(Samples(signs=told[some], normal_deg=angle[some], shape_mm=error_mm[some]))
    return found


def fit_errors(samples: Sequence[Samples]) -> ErrorRecord:
    """Find the bounds that nine in ten pixels keep, of presses that the weights were not fitted to."""
    every = np.concatenate([one.signs for one in samples])
    least, most = np.quantile(every, [0.01, 0.99], axis=0)
    terms = [quadratic(np.clip(one.signs, least, most)) for one in samples]
    return ErrorRecord(
        presses=len(samples),
        steepest=float(np.quantile(every[:, 0], TRAINED_QUANTILE)),
        least=tuple(least.tolist()),
        most=tuple(most.tolist()),
        normal_weights=_weights(terms, [np.log(one.normal_deg + DEG_FLOOR) for one in samples]),
        shape_weights=_weights(terms, [np.log(one.shape_mm + MM_FLOOR) for one in samples]),
    )


def _weights(terms: Sequence[Array], logarithms: Sequence[Array]) -> tuple[float, ...]:
    """Least squares over all presses, raised until 90 % of each press's pixels, by those of the others, lie below.

    Every press counts by its pixels; one left out is judged by the sums of the others.
    """
    squares = np.array([a.T @ a for a in terms])
    products = np.array([a.T @ b for a, b in zip(terms, logarithms, strict=True)])
    square, product = squares.sum(axis=0), products.sum(axis=0)
    eye = _RIDGE * np.trace(square) / len(square) * np.eye(len(square))
    above = [
        b - a @ np.linalg.solve(square - own_square + eye, product - own_product)
        for a, b, own_square, own_product in zip(terms, logarithms, squares, products, strict=True)
    ]
    weights = np.linalg.solve(square + eye, product)
    weights[0] += np.quantile(np.concatenate(above), COVERED)
    return tuple(weights.tolist())
