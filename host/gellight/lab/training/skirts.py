"""Which share of the slopes beside contacts counts, by presses held out and contact mechanics: see `skirt`."""

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

from gellight.lab.training.validation import ALIKE, IndentationFigures, PressError

SHARES = 0.05, 1.5
"""within which felt slopes are corrected: beyond, something else is wrong"""
LEAST_JUDGES = 4
"""presses that decide"""
SKIRTS = "skirts"
"""in `held_out` of the metrics"""


class Skirts(NamedTuple):
    """The share that counts, and the presses held out with it."""

    share: float
    errors: list[PressError]
    felt_with_all: float = 1.0
    """median of felt over expected indentation where all slopes count"""

    def record(self) -> dict[str, object]:
        """Return what the metrics say of it: nothing where all slopes count."""
        found = {"share": self.share, "felt_with_all": round(self.felt_with_all, 3)}
        return {SKIRTS: found} if self.share != 1 else {}


def find_skirts(errors_at: Callable[[float], list[PressError]]) -> Skirts:
    """Return the share with which presses are felt as deep as they are; errors_at: of each press, with a share.

    The median of felt over expected indentation is nearly linear in the share. 1 where they are felt alike within
    `ALIKE`, by which thickness and circles may be off, where nobody knows the gel, and where few presses judge.
    """
    errors = errors_at(1.0)
    felt = _median(errors)
    if felt is None or len(errors) < LEAST_JUDGES or abs(felt - 1) <= ALIKE:
        return Skirts(1.0, errors)
    halved = _median(errors_at(0.5))
    assert halved is not None
    share = float(np.clip(1 - (felt - 1) / max(2 * (felt - halved), 1e-3), *SHARES).round(2))
    return Skirts(share, errors_at(share), felt)


def _median(errors: list[PressError]) -> float | None:
    figures = IndentationFigures.of([one.indentation for one in errors])
    return figures.felt_over_expected if figures else None


def skirt_words(metrics: Mapping[str, Any]) -> list[str]:
    """Return how much of the slopes beside contacts counts, and why; nothing where all of it does."""
    found = (metrics.get("held_out") or {}).get(SKIRTS)
    if not found:
        return []
    return [
        f"{found['share']:.0%} of the slopes beside contacts count: with all of them presses held out were felt "
        f"{found['felt_with_all']:.2f} times as deep as contact mechanics expect"
    ]
