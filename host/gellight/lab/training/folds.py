"""Networks that never saw some of the presses, and these presses: what an error is measured with."""

import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from gellight.base.errors import InputError
from gellight.bundle.bundle import Bundle
from gellight.lab.training.child import Check, Progress, go_on, silent
from gellight.lab.training.presses import Ball, Press
from gellight.lab.training.table import images_of
from gellight.lab.training.training import Learning, Reference, fit

_FOLD_SEED = 1  # any, but always the same: so are the folds


@dataclass(frozen=True, kw_only=True)
class Fold:
    """What was learnt from a part of the presses, and the others."""

    bundle: Bundle
    held_out: list[Press]


def trained_folds(
    presses: Sequence[Press],
    reference: Reference,
    ball: Ball,
    folds: int,
    how: Learning,
    *,
    progress: Progress = silent,
    check: Check = go_on,
) -> Iterator[Fold]:
    """Train `folds` times without a part of the images; no network sees what it judges.

    Raises InputError for too few presses, and as `training.fit`.
    """
    numbers = images_of(presses)
    images = int(numbers.max(initial=-1)) + 1
    if not 2 <= folds <= images:
        raise InputError(f"{folds} folds of {images} presses: give between 2 and {images}")
    order = np.random.default_rng(_FOLD_SEED).permutation(images)
    with tempfile.TemporaryDirectory(prefix="gellight-folds-") as folder:
        for fold in range(folds):
            out = np.isin(numbers, order[fold::folds])
            training = [press for press, is_out in zip(presses, out, strict=True) if not is_out]
            held_out = [press for press, is_out in zip(presses, out, strict=True) if is_out]
            bundle = fit(
                training, reference, ball, Path(folder) / f"fold-{fold}", sensor=f"fold {fold}",
                how=how, progress=progress, check=check,
            )  # fmt: skip
            yield Fold(bundle=bundle, held_out=held_out)
