"""The least error of normals that are read from the colour of one pixel alone, in the simulated sensor."""

import numpy as np
from numpy.typing import NDArray

from gellight.lab.simulator.scene import Scene
from sim_reference.camera import CameraResponse, linear_grey
from sim_reference.geometry import AS_BUILT, WHOLE, Box
from sim_reference.imaging import around, ring_irradiance
from sim_reference.surface import Surface
from tests.helpers.simulated_bundle import NOISE_GREY, TEST_SEED, ball_presses

Array = NDArray[np.float64]


def bound_on_balls_deg(presses: int, depth_mm: float) -> float:
    """Return the mean of `pixel_bound_deg` in contact, over the presses of `evaluate_simulated`."""
    scene = Scene(AS_BUILT, CameraResponse(noise_grey=NOISE_GREY))
    balls = ball_presses(scene.geometry, presses, np.random.default_rng(TEST_SEED), depth_mm)
    surfaces = (scene.show(ball)[1] for ball in balls)
    means = []
    for surface in surfaces:
        box = around(surface.contact, 0)
        means.append(pixel_bound_deg(scene, surface, box)[surface.contact[box]].mean())
    return float(np.mean(means))


def pixel_bound_deg(scene: Scene, surface: Surface, box: Box = WHOLE) -> Array:
    """Return the (h, w) mean normal error, deg, of an efficient estimator that sees the colour of one pixel of `box`.

    Efficient means: unbiased, with the least covariance that any unbiased estimator can have, by Cramér and Rao. With
    the Jacobian J (3, 2) of the grey levels with respect to the slopes, and grey levels of independent Gaussian noise
    of variance s^2 = noise^2 + 1/12 (rounding), that covariance is s^2 (J^T J)^-1. The errors of the slopes are taken
    to be Gaussian. The normal turns by an angle whose square is e^T M e for a small error e of the slopes, with
    M = ((1 + g^2) I - g g^T) / (1 + g^2)^2; the mean angle follows from the two eigenvalues of the product of M and the
    covariance.

    The bound is on the covariance, not on the mean angle, and it holds for unbiased estimators of one pixel. Smoothing
    uses neighbours and has a bias, so its error may be below this figure.
    """
    jacobian = _jacobian(scene, surface, box)
    variance = scene.response.noise_grey**2 + 1 / 12
    information = np.einsum("hwci,hwcj->hwij", jacobian, jacobian) / variance
    information += 1e-12 * np.eye(2)
    g = surface.gradient_map[box]
    squared = 1 + (g**2).sum(axis=2)[..., None, None]
    metric = (squared * np.eye(2) - g[..., :, None] * g[..., None, :]) / squared**2
    product = metric @ np.linalg.inv(information)
    half_trace = np.trace(product, axis1=2, axis2=3) / 2
    root = np.sqrt(np.maximum(half_trace**2 - np.linalg.det(product), 0))
    return np.degrees(_mean_length(half_trace + root, np.maximum(half_trace - root, 0)))


def _mean_length(large: Array, small: Array) -> Array:
    """Return the mean length of a two-dimensional normal vector with these variances along its axes."""
    # E|v| of a normal vector = sqrt(pi / 2) x the mean over directions of the length of its ellipse.
    angles = (np.arange(64) + 0.5) * (np.pi / 64)
    lengths = sum(np.sqrt(large * np.cos(angle) ** 2 + small * np.sin(angle) ** 2) for angle in angles)
    return np.asarray(np.sqrt(np.pi / 2) * lengths / len(angles))


def _jacobian(scene: Scene, surface: Surface, box: Box, step: float = 1e-4) -> Array:
    """(h, w, 3, 2) change of the grey levels with each slope, by central differences at unchanged depth."""

    def grey(change: Array) -> Array:
        tilted = Surface(surface.depth_mm, surface.gradient_map + change, surface.contact)
        return linear_grey(ring_irradiance(tilted, scene.geometry, scene.light, box), scene.response)

    return np.stack([(grey(change) - grey(-change)) / (2 * step) for change in step * np.eye(2)], axis=3)
