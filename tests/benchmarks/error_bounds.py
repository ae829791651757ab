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
from gellight.lab.training.judged_fit import Samples, fit_judged, samples_of
from gellight.lab.training.training import Learning, TrainingOptions
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


OBJECTS = (("BALL", 0.6), ("BALL", 1.2), ("BALLVEX", 0.8), ("PCONVEX", 0.8), ("TSTEP", 0.4), ("WAVE", 0.4))


def judge_objects(calibration: str) -> None:
    """Print how many pixels of contacts keep the bounds where the surface is known."""
    for name, press_mm in OBJECTS:
        with gellight.connect(f"sim://?object={name}&depth={press_mm}&x=2&y=-1", calibration=calibration) as sensor:
            frame = sensor.next_frame()
        truth, bounds = frame.camera_frame.truth, frame.error_bounds
        assert truth is not None
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
    parser.add_argument("--simulated", metavar="BUNDLE", help="judge this bundle of the simulated sensor")
    given = parser.parse_args()
    if given.simulated:
        judge_objects(given.simulated)
        return
    for name in given.sets or SETS:
        for refine in (False, True):
            with tempfile.TemporaryDirectory() as place:
                folds = list(judged(SETS[name](Path(place)), refine=refine))
            for unit, which in (("deg", 0), ("mm", 1)):
                show(f"{name}{', refined' if refine else ''}", unit, [fold[which] for fold in folds])


if __name__ == "__main__":
    main()
