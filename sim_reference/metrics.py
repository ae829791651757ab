"""Figures of merit: equations 4 to 8 of the paper, one function each; equation 7 defines two.

Angles are computed by atan2(|a x b|, a . b): the arc cosine of equation 4 loses half of the digits where the
angle is small, which is where a good sensor is.
"""

from math import atan2, sqrt

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
    """Equation 5: the mean of the errors above their (1 - `share`) quantile, in their unit.

    A share of 0.05 gives MAE_Top5, 0.01 MAE_Top1. Where no error lies above the quantile, because all are equal, the
    quantile itself. Raises ValueError for a share outside 0 to 1.
    """
    if not 0 < share < 1:
        raise ValueError(f"share {share}: give a number between 0 and 1, such as 0.01 for Top1")
    values = np.asarray(errors, dtype=np.float64).ravel()
    quantile = np.percentile(values, 100 * (1 - share))
    largest = values[values > quantile]
    return float(largest.mean()) if largest.size else float(quantile)


def error_figures(errors: Array) -> tuple[float, float, float]:
    """Return MAE (equation 4), MAE_Top5 and MAE_Top1 (equation 5) of angular errors, in their unit."""
    return float(errors.mean()), mean_of_largest(errors, 0.05), mean_of_largest(errors, 0.01)


def intensity_deviation(image: ArrayLike) -> float:
    """Equation 6: delta_I, the sum of the standard deviations of the three channels of (H, W, 3), in their unit."""
    return float(np.asarray(image, dtype=np.float64).reshape(-1, 3).std(axis=0).sum())


def normalised_deviation(image: ArrayLike) -> float:
    """Equation 7: NSD, delta_I over the mean of all channels of (H, W, 3)."""
    return intensity_deviation(image) / float(np.asarray(image, dtype=np.float64).mean())


def saturation(image: ArrayLike) -> float:
    """Equation 7: SAT, (max - min) / max over the channels of (H, W, 3), averaged over the pixels that are lit.

    Raises ValueError for a black image.
    """
    pixels = np.asarray(image, dtype=np.float64).reshape(-1, 3)
    brightest, darkest = pixels.max(axis=1), pixels.min(axis=1)
    lit = brightest > 0
    if not lit.any():
        raise ValueError("the saturation of a black image is not defined: switch a light on")
    return float(((brightest - darkest)[lit] / brightest[lit]).mean())


def maximum_elevation(ball_radius_mm: float, press_depth_mm: float) -> float:
    """Equation 8: arctan(r_e / (R - d)), the largest elevation angle in rad that a ball of radius R records.

    Pressed by d, its edge has the radius r_e = sqrt(R^2 - (R - d)^2), so the cosine of the angle is 1 - d / R. Raises
    ValueError for a press beyond the ball's equator.
    """
    if not 0 < press_depth_mm <= ball_radius_mm:
        raise ValueError(
            f"press depth {press_depth_mm} mm of a ball of radius {ball_radius_mm} mm: it must lie in (0, radius]"
        )
    edge_radius_mm = sqrt(press_depth_mm * (2 * ball_radius_mm - press_depth_mm))
    return atan2(edge_radius_mm, ball_radius_mm - press_depth_mm)
