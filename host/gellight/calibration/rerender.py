"""The picture predicted from the slopes that were felt: a check that needs no truth, on any sensor.

A polynomial maps slopes and place to colour changes, the opposite way of the network; it is fitted to the same table.
Where the slopes felt are wrong, the predicted picture differs from the one that was taken.
"""

import numpy as np
from numpy.typing import NDArray

from gellight.training.polynomial import powers_up_to, ridge, terms_of

Floats = NDArray[np.float32]
_DEGREE = 4
_LARGEST_TABLE = 60_000
_POWERS = powers_up_to(_DEGREE, 4)
_RIDGE = 1e-6


class Rerenderer:
    """Predicts difference images from gradient maps."""

    def __init__(self, rows: Floats, image_shape: tuple[int, int]) -> None:
        """Fit to the (N, 7) table of a calibration."""
        self._shape = image_shape
        chosen = rows[:: max(1, len(rows) // _LARGEST_TABLE)].astype(np.float64)
        features = self._features(chosen[:, 5], chosen[:, 6], chosen[:, 3], chosen[:, 4])
        self._amounts = ridge(features, chosen[:, :3], _RIDGE)

    def difference(self, gradient_map: Floats, rows: NDArray[np.int64], columns: NDArray[np.int64]) -> Floats:
        """(N, 3) predicted difference, grey levels, at pixels of a (H, W, 2) gradient map."""
        slopes = gradient_map[rows, columns].astype(np.float64)
        features = self._features(slopes[:, 0], slopes[:, 1], columns.astype(float), rows.astype(float))
        return np.asarray(features @ self._amounts, np.float32)

    def _features(self, gx: NDArray[np.float64], gy: NDArray[np.float64], x: NDArray[np.float64],
                  y: NDArray[np.float64]) -> NDArray[np.float64]:  # fmt: skip
        height, width = self._shape
        return terms_of([gx, gy, 2 * x / width - 1, 2 * y / height - 1], _POWERS)
