"""The error on presses that were not trained on: each press once, by a network that never saw its image."""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import InputError
from gellight.lab.training.baselines import Baseline, fit_lookup_table, fit_polynomial
from gellight.lab.training.child import Progress, silent
from gellight.lab.training.folds import GIVEN, REFINED, Fold, trained_folds
from gellight.lab.training.presses import Ball, Press
from gellight.lab.training.table import PressTable, images_of
from gellight.lab.training.training import AS_A_RULE, Learning, Reference
from gellight.lab.training.validation import PressError, PressFigures, frames_by, press_error, press_errors, summarised

Floats = NDArray[np.float32]
_NETWORK = "network"
Errors = dict[tuple[str, str], list[PressError]]
"""by labels (given or refined) and way (the network or the name of a baseline)"""


@dataclass(frozen=True, kw_only=True)
class Comparison:
    """GelNet and the simpler models, judged by the same labels in the same folds."""

    network: PressFigures
    baselines: Mapping[str, PressFigures]

    def as_json(self) -> dict[str, object]:
        """Return the figures of the network and, under `baselines`, those of each baseline without its images."""
        baselines = {name: figures.as_json() for name, figures in self.baselines.items()}
        for figures in baselines.values():
            del figures["images"]
        return {**self.network.as_json(), "baselines": baselines}


@dataclass(frozen=True, kw_only=True)
class CrossValidation:
    """The errors over all folds."""

    given: Comparison
    """against the labels as given"""
    refined: Comparison | None
    """against the labels as refined; None where none were"""
    folds: int
    training_cpu_seconds: tuple[float, ...]
    """of each fold"""

    def as_json(self) -> dict[str, object]:
        """Return the figures by name, those against refined labels under `refined`."""
        refined = {"refined": self.refined.as_json()} if self.refined else {}
        return {
            **self.given.as_json(),
            **refined,
            "folds": self.folds,
            "training_cpu_seconds": list(self.training_cpu_seconds),
        }


def cross_validate(
    presses: Sequence[Press],
    reference: Reference,
    ball: Ball,
    *,
    folds: int = 5,
    how: Learning = AS_A_RULE,
    progress: Progress = silent,
) -> CrossValidation:
    """Train `folds` times without a part of the presses and measure the error on that part.

    progress is called after each fold with (fold, folds, mean normal error of that fold, deg).

    Where circles are refined, the part held out is judged by its labels as given and as refined. Raises InputError for
    too few presses, and as `fit`.
    """
    images = int(images_of(presses).max(initial=-1)) + 1
    if not 2 <= folds <= images // 2:
        raise InputError(f"{folds} folds of {images} presses: give between 2 and {images // 2}")
    errors: Errors = defaultdict(list)
    seconds: list[float] = []
    for number, fold in enumerate(trained_folds(presses, reference, ball, folds, how)):
        found = _errors_of_fold(fold, reference.image, ball)
        for key, of_fold in found.items():
            errors[key] += of_fold
        seconds.append(fold.bundle.metrics["training"]["cpu_seconds"])
        progress(number + 1, folds, float(np.mean([error.mean_deg for error in found[GIVEN, _NETWORK]])))
    return CrossValidation(
        given=_compared(errors, GIVEN),
        refined=_compared(errors, REFINED) if how.refine else None,
        folds=folds,
        training_cpu_seconds=tuple(seconds),
    )


def _errors_of_fold(fold: Fold, reference: Floats, ball: Ball) -> Errors:
    """Errors of the network and of each baseline."""
    bundle, held_out = fold.bundle, fold.held_out
    table = PressTable.of(bundle)
    baselines: dict[str, Baseline] = {
        "lookup_table": fit_lookup_table(table),
        "polynomial": fit_polynomial(table),
        "polynomial_ratio": fit_polynomial(table, reference=reference),
    }
    errors = {(labels, _NETWORK): press_errors(bundle, presses, ball) for labels, presses in held_out.items()}
    for name, baseline in baselines.items():
        # The images are the same whatever their labels, so they are reconstructed once.
        frames = frames_by(baseline, held_out[GIVEN], reference, ball, follow_light=bundle.manifest.follow_light)
        for labels, presses in held_out.items():
            judged = zip(presses, frames, strict=True)
            errors[labels, name] = [press_error(press, ball, frame) for press, frame in judged]
    return errors


def _compared(errors: Errors, labels: str) -> Comparison:
    """The figures of all ways under these labels, images in the order of their names."""
    figures = {
        way: summarised(sorted(found, key=lambda error: error.image))
        for (judged_by, way), found in errors.items()
        if judged_by == labels
    }
    return Comparison(network=figures.pop(_NETWORK), baselines=figures)
