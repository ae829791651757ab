"""Derivatives by finite differences."""

from collections.abc import Callable

import numpy as np


def slope(of: Callable[[np.ndarray], np.ndarray | float], at: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """Derivative along `direction`, central differences of fourth order."""
    step = 1e-4

    def f(k: int) -> np.ndarray:
        return np.asarray(of(at + k * step * direction))

    return (8 * (f(1) - f(-1)) - (f(2) - f(-2))) / (12 * step)
