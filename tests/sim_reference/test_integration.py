"""Depth from slopes: quadratic surfaces and noise."""

import numpy as np
import pytest

from sim_reference.integration import integrate


def slopes_of(gx: np.ndarray, gy: np.ndarray) -> np.ndarray:
    return np.stack(np.broadcast_arrays(gx, gy), axis=2)


def centred(depth: np.ndarray) -> np.ndarray:
    return depth - np.median(depth)


@pytest.mark.parametrize("pixel", [0.1, (0.1, 0.25)])
def test_a_quadratic_surface_is_exact(pixel: float | tuple[float, float]) -> None:
    size_x, size_y = np.broadcast_to(pixel, 2)
    x, y = np.arange(23)[None, :] * size_x, np.arange(17)[:, None] * size_y
    depth = 0.3 * x - 0.2 * y + 0.5 * x**2 - 0.1 * y**2 + 0.4 * x * y
    gradient = slopes_of(0.3 + x + 0.4 * y, -0.2 - 0.2 * y + 0.4 * x)
    assert integrate(gradient, pixel) == pytest.approx(centred(depth), abs=1e-9)


def test_noise_is_spread_and_not_summed() -> None:
    noise = np.random.default_rng(3).normal(0, 0.1, (64, 64, 2))
    assert integrate(noise, 1.0).std() < 0.15  # summing along rows would give 0.1 sqrt(32) = 0.57
