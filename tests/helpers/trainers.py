"""The trainers of GelNet as parameters of a test, PyTorch's is judged at night; and rows that they learn from."""

import numpy as np
import pytest

from gelnet.trainers import NAMES

TRAINERS = [pytest.param(name, marks=[pytest.mark.nightly] if name == "torch" else []) for name in NAMES]


def rows_of_a_known_sensor(count: int, *, steepest: float = 1.0, noise_grey: float = 0.0, seed: int = 7) -> np.ndarray:
    """(count, 7) pixels whose colours are a known function of the slope, brighter to the right of 320 x 240 px."""
    random = np.random.default_rng(seed)
    slope, place = random.uniform(-steepest, steepest, (count, 2)), random.uniform([0, 0], [319, 239], (count, 2))
    lights = np.array([[1.0, 0.0], [-0.5, 0.87], [-0.5, -0.87]])
    bend = 1 / np.sqrt(1 + (slope**2).sum(axis=1, keepdims=True))
    colour = 60 * (1 + place[:, :1] / 640) * bend * (slope @ lights.T) + random.normal(0, noise_grey, (count, 3))
    return np.concatenate([colour, place, slope], axis=1).astype(np.float32)
