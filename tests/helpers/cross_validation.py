"""The error on presses that were not trained on: each press once, by a network that never saw its image."""

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gellight.base.errors import InputError
from gellight.lab.training.child import Progress, silent
from gellight.lab.training.judged_fit import GIVEN, REFINED, trained_folds
from gellight.lab.training.presses import Ball, Press
from gellight.lab.training.table import images_of
from gellight.lab.training.training import AS_A_RULE, Learning, Reference
from gellight.lab.training.validation import PressError, PressFigures, press_errors, summarised


@dataclass(frozen=True, kw_only=True)
class CrossValidation:
    """The errors over all folds."""

    given: PressFigures
    """against the labels as given"""
    refined: PressFigures | None
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
    errors: dict[str, list[PressError]] = defaultdict(list)
    seconds: list[float] = []
    for number, fold in enumerate(trained_folds(presses, reference, ball, folds, how)):
        found = {labels: press_errors(fold.bundle, judged, ball) for labels, judged in fold.held_out.items()}
        for labels, of_fold in found.items():
            errors[labels] += of_fold
        seconds.append(fold.bundle.metrics["training"]["cpu_seconds"])
        progress(number + 1, folds, float(np.mean([error.mean_deg for error in found[GIVEN]])))
    by_labels = {labels: summarised(sorted(all_, key=lambda one: one.image)) for labels, all_ in errors.items()}
    return CrossValidation(
        given=by_labels[GIVEN], refined=by_labels.get(REFINED), folds=folds, training_cpu_seconds=tuple(seconds)
    )
