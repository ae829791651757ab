"""Networks that never saw some of the presses, and these presses: what an error is measured with."""

import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from gellight.base.errors import InputError
from gellight.bundle.bundle import Bundle
from gellight.lab.training.child import Check, Progress, go_on, silent
from gellight.lab.training.labelling.refinement import FirstFits, refine, refine_others
from gellight.lab.training.presses import Ball, Press
from gellight.lab.training.table import images_of
from gellight.lab.training.training import Learning, Reference, fit

_FOLD_SEED = 1
GIVEN, REFINED = "given", "refined"


@dataclass(frozen=True, kw_only=True)
class Fold:
    """What was learnt from a part of the presses, and the others."""

    bundle: Bundle
    held_out: dict[str, list[Press]]
    """by labels: as given and, where circles were refined, as the light of those that were learnt from refines them"""


def trained_folds(
    presses: Sequence[Press],
    reference: Reference,
    ball: Ball,
    folds: int,
    how: Learning,
    *,
    first: FirstFits | None = None,
    progress: Progress = silent,
    check: Check = go_on,
) -> Iterator[Fold]:
    """Train `folds` times without a part of the images; no response of the light and no network sees what it judges.

    first: the fits of these presses one by one, where they are known.

    Raises InputError for too few presses, and as `training.fit`.
    """
    numbers = images_of(presses)
    images = int(numbers.max(initial=-1)) + 1
    if not 2 <= folds <= images:
        raise InputError(f"{folds} folds of {images} presses: give between 2 and {images}")
    order = np.random.default_rng(_FOLD_SEED).permutation(images)
    refining = (first or FirstFits(reference.image, ball)) if how.refine else None
    with tempfile.TemporaryDirectory(prefix="gellight-folds-") as folder:
        for fold in range(folds):
            part = set(np.flatnonzero(np.isin(numbers, order[fold::folds])).tolist())
            training, held_out = _divided(presses, part, reference, ball, refining)
            bundle = fit(
                training, reference, ball, Path(folder) / f"fold-{fold}", sensor=f"fold {fold}",
                how=how, progress=progress, check=check,
            )  # fmt: skip
            yield Fold(bundle=bundle, held_out=held_out)


def _divided(
    presses: Sequence[Press], part: set[int], reference: Reference, ball: Ball, first: FirstFits | None
) -> tuple[Sequence[Press], dict[str, list[Press]]]:
    """Presses to train on, and those of the part held out under their labels; refined ones where `first` is given."""
    training: Sequence[Press] = [press for i, press in enumerate(presses) if i not in part]
    held_out = {GIVEN: [press for i, press in enumerate(presses) if i in part]}
    if first is not None:
        refined = refine(training, reference.image, ball, first=first)
        training = refined.presses
        held_out[REFINED] = refine_others(refined, held_out[GIVEN], reference.image, ball, first=first)
    return training, held_out
