"""Figures of merit: equations 4 to 8 of the paper.

Angles are computed by atan2(|a x b|, a . b): the arc cosine of equation 4 loses half of the digits where the
angle is small, which is where a good sensor is.
"""

from math import acos

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


def angular_error(normals: ArrayLike, truth: ArrayLike) -> Array:
    """Return the angle between two normal maps (..., 3) -> (...) rad, in 0..pi; neither needs unit length."""
    a, b = np.asarray(normals, dtype=np.float64), np.asarray(truth, dtype=np.float64)
    return np.asarray(np.arctan2(np.linalg.norm(np.cross(a, b), axis=-1), (a * b).sum(axis=-1)))


def mean_angular_error(normals: ArrayLike, truth: ArrayLike) -> float:
    """Equation 4: MAE in rad."""
    return float(angular_error(normals, truth).mean())


def mean_of_largest(errors: ArrayLike, share: float) -> float:
    """Equation 5: the mean of the errors above their (1 - `share`) quantile: 0.05 for Top5, 0.01 for Top1.

    Where no error lies above the quantile, because all are equal, the quantile itself.
    """
    if not 0 < share < 1:
        raise ValueError(f"share {share}: give a number between 0 and 1, such as 0.01 for Top1")
    values = np.asarray(errors, dtype=np.float64).ravel()
    quantile = np.percentile(values, 100 * (1 - share))
    largest = values[values > quantile]
    return float(largest.mean()) if largest.size else float(quantile)


def normalised_deviation(image: ArrayLike) -> float:
    """Equations 6 and 7: NSD, the sum of the channels' standard deviations over the mean of (H, W, 3)."""
    pixels = np.asarray(image, dtype=np.float64).reshape(-1, 3)
    return float(pixels.std(axis=0).sum() / pixels.mean())


def saturation(image: ArrayLike) -> float:
    """Equation 7: SAT, (max - min) / max over the channels of (H, W, 3), averaged over the pixels that are lit."""
    pixels = np.asarray(image, dtype=np.float64).reshape(-1, 3)
    brightest, darkest = pixels.max(axis=1), pixels.min(axis=1)
    lit = brightest > 0
    if not lit.any():
        raise ValueError("the saturation of a black image is not defined: switch a light on")
    return float(((brightest - darkest)[lit] / brightest[lit]).mean())


def maximum_elevation(ball_radius_mm: float, press_depth_mm: float) -> float:
    """Equation 8: the steepest slope in rad that a ball of radius R pressed by d records: cos(angle) = 1 - d / R."""
    if not 0 < press_depth_mm <= ball_radius_mm:
        raise ValueError(
            f"press depth {press_depth_mm} mm of a ball of radius {ball_radius_mm} mm: it must lie in (0, radius]"
        )
    return acos(1 - press_depth_mm / ball_radius_mm)
