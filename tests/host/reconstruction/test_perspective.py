"""A sphere and a plane seen from above the gel: slopes in, their depth out, and the slopes back."""

import numpy as np
import pytest

from gellight.reconstruction.contact import measure_patches
from gellight.reconstruction.integration import integrate, surface_gradient
from gellight.reconstruction.perspective import Perspective

SHAPE, PIXEL_MM, HEIGHT_MM = (121, 161), 0.1, 53.1
Y, X = ((np.indices(SHAPE)[axis] - (SHAPE[axis] - 1) / 2) * PIXEL_MM for axis in (0, 1))
SEEN = Perspective(X[0], Y[:, 0], HEIGHT_MM)


def test_a_plane_keeps_its_heights() -> None:
    # d = 0.3 + 0.05 x with x = p (1 - d / H) gives d (1 + 0.05 p / H) = 0.3 + 0.05 p
    depth = (0.3 + 0.05 * X) / (1 + 0.05 * X / HEIGHT_MM)
    slopes = np.stack([np.full(SHAPE, 0.05), np.zeros(SHAPE)], axis=2).astype(np.float32)
    found = SEEN.depth_mm(integrate(SEEN.seen(slopes), PIXEL_MM) - np.float32(HEIGHT_MM * np.log(1 - 0.3 / HEIGHT_MM)))
    assert found == pytest.approx(depth, abs=2e-5)


def bump(at_x: np.ndarray = X, at_y: np.ndarray = Y) -> tuple[np.ndarray, np.ndarray]:
    """Depth and slopes, in each pixel, of a Gaussian bump that lies far from the axis, as a fixed point."""
    depth = np.zeros(at_x.shape)
    for _ in range(60):
        x, y = at_x * (1 - depth / HEIGHT_MM) - 4, at_y * (1 - depth / HEIGHT_MM) + 3
        depth = np.exp(-(x**2 + y**2) / 2)
    return depth, np.stack([-x * depth, -y * depth], axis=2)


def test_a_bump_beside_the_axis_keeps_its_form() -> None:
    depth, slopes = bump()
    found = SEEN.depth_mm(integrate(SEEN.seen(slopes.astype(np.float32)), PIXEL_MM, at_rest=depth < 1e-6))
    assert np.abs(found - depth).max() < 2e-4
    # Taken for parallel rays the same slopes close to no surface: they are off by twenty times that.
    assert np.abs(integrate(slopes.astype(np.float32), PIXEL_MM, at_rest=depth < 1e-6) - depth).max() > 4e-3


def test_a_patch_is_as_large_as_it_is_on_the_gel() -> None:
    """What is deeper than a half of exp(-r^2 / 2) is a disc of the radius sqrt(2 ln 2), of which half the volume."""
    y, x = (np.indices((400, 500)) - np.array([199.5, 249.5])[:, None, None]) * 0.025
    (depth, slopes), view = bump(x, y), Perspective(x[0], y[:, 0], HEIGHT_MM)
    mask = depth > 0.5
    (patch,), (flat,) = (measure_patches(mask, depth, slopes, 0.025, seen) for seen in (view, None))
    assert patch.area_mm2 == pytest.approx(2 * np.pi * np.log(2), rel=2e-3)
    assert patch.volume_mm3 == pytest.approx(np.pi, rel=2e-3)
    assert patch.centroid_mm == pytest.approx((4, -3), abs=5e-3)
    assert flat.area_mm2 > 1.015 * patch.area_mm2
    assert flat.centroid_mm[0] > 4.03


def test_the_slopes_of_the_depth_are_those_of_the_gel() -> None:
    depth, slopes = bump()
    logarithmic = (-HEIGHT_MM * np.log(1 - depth / HEIGHT_MM)).astype(np.float32)
    assert np.abs(SEEN.slopes(surface_gradient(logarithmic, PIXEL_MM)) - slopes).max() < 1e-3
    there_and_back = SEEN.slopes(SEEN.seen(slopes.astype(np.float32)))
    assert np.abs(there_and_back - slopes).max() < 1e-6


def test_a_camera_far_away_changes_nothing() -> None:
    far, slopes = Perspective(X[0], Y[:, 0], 1e9), bump()[1].astype(np.float32)
    assert np.array_equal(far.seen(slopes), slopes)
    assert np.array_equal(far.slopes(slopes), slopes)
