"""The polynomial table by which Taxim draws (Si and Yuan, 2022), and FOTS too, written anew from the paper's formula.

Slopes are divided into bins of angle and direction. In each bin the change of each colour is a quadratic of the pixel's
place, by least squares; a bin that no press filled takes the nearest one that is.
"""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from gellight.lab.training.table import PressTable

Floats = NDArray[np.floating]
BINS = 125


@dataclass(frozen=True, eq=False)
class TaximTable:
    """Colour change of a slope at a place."""

    table: NDArray[np.float64]
    """(angle, direction, 6, 3) coefficients of x^2, y^2, xy, x, y, 1 in px"""

    @classmethod
    def fitted(cls, pressed: PressTable) -> Self:
        """Fit the labelled pixels of presses."""
        rows = pressed.rows.astype(np.float64)
        number = np.ravel_multi_index(_bins(rows[:, 5], rows[:, 6]), (BINS, BINS))
        order = np.argsort(number, kind="stable")
        filled, first = np.unique(number[order], return_index=True)
        table = np.zeros((BINS * BINS, 6, 3))
        for one, members in zip(filled, np.split(order, first[1:]), strict=True):
            table[one] = np.linalg.lstsq(_place(rows[members, 3], rows[members, 4]), rows[members, :3], rcond=None)[0]
        empty = ~np.isin(np.arange(BINS * BINS), filled).reshape(BINS, BINS)
        around = np.concatenate([empty] * 3, axis=1)  # directions go round
        _, (angle, turn) = ndimage.distance_transform_edt(around, return_indices=True)
        middle = slice(BINS, 2 * BINS)
        return cls(table.reshape(BINS, BINS, 6, 3)[angle[:, middle], turn[:, middle] % BINS])

    def change(self, across: Floats, down: Floats) -> NDArray[np.float64]:
        """Return the (H, W, 3) change of grey levels of slopes (H, W)."""
        y, x = np.indices(across.shape, dtype=np.float64)
        return np.asarray(np.einsum("hwk,hwkc->hwc", _place(x, y), self.table[_bins(across, down)]))


def _bins(across: Floats, down: Floats) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    angle = np.arctan(np.hypot(across, down)) / (np.pi / 2)
    turn = (np.arctan2(down, across) + np.pi) / (2 * np.pi)
    first, second = (np.minimum(share * BINS, BINS - 1).astype(np.intp) for share in (angle, turn))
    return first, second


def _place(x: Floats, y: Floats) -> NDArray[np.float64]:
    return np.stack([x**2, y**2, x * y, x, y, np.ones_like(x)], axis=-1)
