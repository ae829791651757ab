"""Spots of the picture that stay while touches come and go: a tear, dirt, something that sticks to the gel.

In one picture a crumb looks like a touch. But a touch ends, and what a hand or a gripper holds for long ends as a
whole. So a spot is reported only when its cells have been outliers without a break for `PATIENCE_S`, and meanwhile
`RELEASES` touches elsewhere have ended. An object that is held still is therefore never taken for a spot.
"""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from gellight.frames.pixel_grid import connected, grown
from gellight.watch.cells import Cells
from gellight.watch.untouched_model import Mask

PATIENCE_S = 8.0  # chosen: what lasts less long is a touch
RELEASES = 3  # chosen: touches elsewhere that ended meanwhile
LEAST_CELLS = 3
"""fewer cells are no spot"""
LARGEST_SHARE = 0.06
"""of the view; what is larger is a touch"""
ELSEWHERE_CELLS = 4
"""a touch that ends nearer to a spot than that does not count as elsewhere"""
EDGE_CELLS = 2  # chosen: around a spot, where its weak edge comes and goes with the noise
LEAST_RELEASED = 4
"""this many cells have to come to rest at once for a touch to have ended"""
DARK, BRIGHT, TORN = 0.92, 1.08, 0.65
"""mean light of a spot as a share of the reference: all channels below or above, and far below"""


class SpotKind(StrEnum):
    """What a spot most likely is."""

    TEAR = "tear"
    DIRT = "dirt"
    STUCK = "stuck"


@dataclass(frozen=True, kw_only=True)
class Spot:
    """Neighbouring cells that never come to rest."""

    kind: SpotKind
    row: float
    column: float
    """centre, in cells"""
    cells: int
    light: tuple[float, float, float]
    """mean of red, green and blue as a share of the reference"""


class SpotTracker:
    """Remembers for each cell since when it shows something, and how many touches elsewhere ended meanwhile."""

    def __init__(self, shape: tuple[int, int]) -> None:
        """Start with (h, w) cells at rest."""
        self._since_s = np.full(shape, np.nan)
        self._releases = np.zeros(shape, np.int32)
        self._before = np.zeros(shape, np.bool_)
        self.lasting: Mask = np.zeros(shape, np.bool_)
        """cells that belong to spots"""
        self.around: Mask = self.lasting
        """these and their neighbours, whose weak edges come and go with the noise"""

    def note(self, outliers: Mask, time_s: float) -> None:
        """Take in the (h, w) outliers of a frame that was taken at `time_s`."""
        self._since_s = np.where(outliers, np.where(np.isnan(self._since_s), time_s, self._since_s), np.nan)
        self._releases[~outliers] = 0
        ended = self._before & ~outliers
        if ended.sum() >= LEAST_RELEASED:
            parts = connected(outliers, corners=False)[0]
            touching = parts[grown(ended, ELSEWHERE_CELLS, corners=False)]
            self._releases[outliers & ~np.isin(parts, touching)] += 1
        self._before = outliers
        self.lasting = (time_s - self._since_s >= PATIENCE_S) & (self._releases >= RELEASES)
        self.around = grown(self.lasting, EDGE_CELLS, corners=False)

    def spots(self, change: Cells, reference: Cells) -> list[Spot]:
        """Return the spots, the largest first, judged by the (h, w, 3) change that light and place do not explain."""
        labels, boxes = connected(self.lasting)
        found = [_spot(labels == number, change, reference) for number in range(1, len(boxes) + 1)]
        fitting = [spot for spot in found if LEAST_CELLS <= spot.cells <= LARGEST_SHARE * self.lasting.size]
        return sorted(fitting, key=lambda spot: -spot.cells)


def _spot(where: NDArray[np.bool_], change: Cells, reference: Cells) -> Spot:
    row, column = np.argwhere(where).mean(axis=0)
    red, green, blue = (float(v) for v in 1 + change[where].mean(axis=0) / reference[where].mean(axis=0))
    return Spot(
        kind=_kind(np.array([red, green, blue])),
        row=float(row),
        column=float(column),
        cells=int(where.sum()),
        light=(red, green, blue),
    )


def _kind(light: NDArray[np.float64]) -> SpotKind:
    """A slope brightens one colour and dims another; what changes all alike is no slope."""
    if (light < TORN).all() or (light > BRIGHT).all():
        return SpotKind.TEAR
    return SpotKind.DIRT if (light < DARK).all() else SpotKind.STUCK
