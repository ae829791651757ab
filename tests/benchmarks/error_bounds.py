"""Are 90 % of the pixels within the bounds that a bundle tells: `python -m tests.benchmarks.error_bounds [SET ...]`.

Each fold calibrates as `fit` does, which finds its bounds on presses of its own, and judges them on the presses held
out: share within the bound, rank correlation of bound and error, and mean error by tenths of the bound. With
`--simulated BUNDLE` a bundle of `gellight calibrate --auto` is judged instead, by objects that were never pressed.
"""

import argparse
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.stats import spearmanr

import gellight
from gellight.frame_path.pipeline import Reconstructor
from gellight.frames.frames import TactileFrame
from gellight.lab.training.judged_fit import Samples, fit_judged, samples_of
from gellight.lab.training.labelling.refinement import refine
from gellight.lab.training.presses import Ball, Press, contact_circle, sphere_gradient
from gellight.lab.training.training import Learning, TrainingOptions
from gellight.lab.training.validation import frame_of
from gellight.reconstruction.error_bounds import DEG_FLOOR, MM_FLOOR, ErrorRecord, quadratic, read_errors
from gellight.reconstruction.integration import angle_deg, normals
from tests.benchmarks.real_presses import GIVEN, REFINED, folds_of
from tests.benchmarks.real_sets import SETS, RealSet

Pairs = tuple[NDArray[np.floating], NDArray[np.floating]]
"""bounds and errors, (n,) each"""


def judged(images: RealSet, *, refine: bool) -> Iterator[tuple[Pairs, Pairs]]:
    """Yield bounds and errors of each fold, of normals (deg) and depth (mm)."""
    how = Learning(options=TrainingOptions(recipe="thorough"), refine=refine)
    for fold in folds_of(images):
        with tempfile.TemporaryDirectory() as place:
            bundle = fit_judged(fold.training, images.reference, images.ball, Path(place) / "b", sensor="real", how=how)
            record = read_errors(bundle)
            assert record is not None
            samples = samples_of(bundle, fold.judges[REFINED if refine else GIVEN], images.ball)
        yield _pairs(record, samples)


def _pairs(record: ErrorRecord, samples: list[Samples]) -> tuple[Pairs, Pairs]:
    terms = quadratic(np.clip(np.concatenate([one.signs for one in samples]), record.least, record.most))
    deg, mm = (np.exp(terms @ np.array(weights)) for weights in (record.normal_weights, record.shape_weights))
    errors = (np.concatenate([getattr(one, name) for one in samples]) for name in ("normal_deg", "shape_mm"))
    first, second = errors
    return (deg - DEG_FLOOR, first), (mm - MM_FLOOR, second)


def show(name: str, unit: str, folds: list[Pairs]) -> None:
    """Print what the bounds of all folds are worth."""
    within = [float((error <= bound).mean()) for bound, error in folds]
    bound, error = (np.concatenate(parts) for parts in zip(*folds, strict=True))
    tenths = " ".join(f"{error[part].mean():.3g}" for part in np.array_split(np.argsort(bound), 10))
    print(
        f"{name:24} {unit:4} within {np.mean(error <= bound):.3f} (folds {min(within):.2f} to {max(within):.2f}), "
        f"rank correlation {spearmanr(bound, error)[0]:.2f}, error by tenths of the bound {tenths}",
        flush=True,
    )


def judge_halves(name: str, images: RealSet) -> None:
    """Print what frames say where the calibration has no press: presses of one half, judged by the other.

    Circles are refined with the light of all presses: as good as the labels of this sensor can be.
    """
    presses = sorted(refine(images.presses, images.reference.image, images.ball).presses, key=lambda p: p.center_x_px)
    half = len(presses) // 2
    for side, learnt, judges in (("left", presses[:half], presses[half:]), ("right", presses[half:], presses[:half])):
        how = Learning(options=TrainingOptions(recipe="thorough"))
        with tempfile.TemporaryDirectory() as place:
            bundle = fit_judged(learnt, images.reference, images.ball, Path(place) / "b", sensor="real", how=how)
        record, path = read_errors(bundle), Reconstructor(bundle, undistorted=False)
        felt = [(press, path.reconstruct(frame_of(press))) for press in judges]
        inside = [contact_circle(press, bundle.image_shape) for press, _ in felt]
        told = np.concatenate([_told(frame)[at] for (_, frame), at in zip(felt, inside, strict=True)])
        wrong_deg = np.concatenate([_wrong_deg(*one, images.ball)[at] for one, at in zip(felt, inside, strict=True)])
        samples = samples_of(bundle, judges, images.ball)
        within = "nobody knows" if record is None else f"{_share_within(record, samples):.0%}"
        print(
            f"{name}, learnt {side}: not learnt is said of {told.mean():.0%} of the contacts; off by "
            f"{wrong_deg[told].mean():.2f} deg there, {wrong_deg[~told].mean():.2f} elsewhere; bounds keep {within}",
            flush=True,
        )


def _told(frame: TactileFrame) -> NDArray[np.bool_]:
    return frame.confidence.not_learnt


def _wrong_deg(press: Press, frame: TactileFrame, ball: Ball) -> NDArray[np.floating]:
    return angle_deg(frame.normal_map, normals(sphere_gradient(press, ball, frame.depth_mm.shape)))


def _share_within(record: ErrorRecord, samples: list[Samples]) -> float:
    (bound, error), _ = _pairs(record, samples)
    return float((error <= bound).mean())


OBJECTS = (("BALL", 0.6), ("BALL", 1.2), ("BALLVEX", 0.8), ("PCONVEX", 0.8), ("TSTEP", 0.4), ("WAVE", 0.4))


def judge_objects(calibration: str) -> None:
    """Print how many pixels of contacts keep the bounds where the surface is known."""
    for name, press_mm in OBJECTS:
        with gellight.connect(f"sim://?object={name}&depth={press_mm}&x=2&y=-1", calibration=calibration) as sensor:
            frame = sensor.next_frame()
        truth, bounds = frame.camera_frame.truth, frame.error_bounds
        assert bounds is not None, f"{calibration} does not tell its errors: make it by gellight calibrate --auto"
        touched = frame.contact.mask
        known = touched & np.isfinite(bounds.normal_deg)
        angle = angle_deg(frame.normal_map, normals(truth.gradient_map))[known]
        off_mm = (frame.depth_mm - truth.depth_mm)[known]
        shape_mm = np.abs(off_mm - off_mm.mean())
        within = [np.mean(angle <= bounds.normal_deg[known]), np.mean(shape_mm <= bounds.shape_mm[known])]
        print(
            f"{name:8} {press_mm} mm: known {known.sum() / touched.sum():.0%} of the contact; within, normals "
            f"{within[0]:.0%}, shape {within[1]:.0%}; mean error {angle.mean():.2f} deg, {shape_mm.mean():.4f} mm, "
            f"level {off_mm.mean():+.4f} mm"
        )


def main() -> None:
    """Print the figures of each set, as labelled and by circles of the light."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sets", nargs="*", choices=[*SETS, []], metavar="SET", help="all where none is named")
    parser.add_argument("--halves", action="store_true", help="learn from one half of the picture, judge by the other")
    parser.add_argument("--simulated", metavar="BUNDLE", help="judge this bundle of the simulated sensor")
    given = parser.parse_args()
    if given.simulated:
        judge_objects(given.simulated)
        return
    for name in given.sets or SETS:
        if given.halves:
            with tempfile.TemporaryDirectory() as place:
                judge_halves(name, SETS[name](Path(place)))
            continue
        for refined in (False, True):
            with tempfile.TemporaryDirectory() as place:
                folds = list(judged(SETS[name](Path(place)), refine=refined))
            for unit, which in (("deg", 0), ("mm", 1)):
                show(f"{name}{', refined' if refined else ''}", unit, [fold[which] for fold in folds])


if __name__ == "__main__":
    main()
