"""The error on presses that were not trained on: each press once, by a network that never saw its image."""

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass

from gellight.lab.training.folds import GIVEN, REFINED, trained_folds
from gellight.lab.training.presses import Ball, Press
from gellight.lab.training.training import Learning, Reference
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
    presses: Sequence[Press], reference: Reference, ball: Ball, *, folds: int, how: Learning
) -> CrossValidation:
    """Train `folds` times without a part of the presses and measure the error on that part.

    Where circles are refined, the part held out is judged by its labels as given and as refined. Raises as `fit`.
    """
    errors: dict[str, list[PressError]] = defaultdict(list)
    seconds: list[float] = []
    for fold in trained_folds(presses, reference, ball, folds, how):
        found = {labels: press_errors(fold.bundle, judged, ball) for labels, judged in fold.held_out.items()}
        for labels, of_fold in found.items():
            errors[labels] += of_fold
        seconds.append(fold.bundle.metrics["training"]["cpu_seconds"])
    by_labels = {labels: summarised(sorted(all_, key=lambda one: one.image)) for labels, all_ in errors.items()}
    return CrossValidation(
        given=by_labels[GIVEN], refined=by_labels.get(REFINED), folds=folds, training_cpu_seconds=tuple(seconds)
    )
