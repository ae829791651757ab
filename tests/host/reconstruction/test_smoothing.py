"""Smoothing of the gradient map: surfaces stay, noise goes."""

import numpy as np
import pytest
from numpy.typing import NDArray

from gellight.reconstruction.integration import integrate, surface_gradient
from gellight.reconstruction.smoothing import NARROWEST_PX, FilterTaps, Smoother, fixed, half_widths, weights
from tests.helpers.analytic_surfaces import Surface, centred_grid, gaussian, plane, sharp_cap

SHAPE = (240, 320)
NOISE = 0.02
WIDEST = half_widths(NARROWEST_PX)[-1]
INSIDE = (slice(WIDEST, -WIDEST), slice(WIDEST, -WIDEST))


def noise(seed: int, shape: tuple[int, int] = SHAPE) -> NDArray[np.float32]:
    return (NOISE * np.random.default_rng(seed).standard_normal((*shape, 2))).astype(np.float32)


def slopes(surface: Surface) -> NDArray[np.float32]:
    return surface.gradient_map.astype(np.float32)


def stages(measured: NDArray[np.float32]) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32]]:
    """The slopes after the narrowest filter, of the surface, and of the surface smoothed further."""
    smoother = Smoother()
    smoothed, variance = smoother.prefilter(measured)
    surface = surface_gradient(integrate(smoothed, 1.0), 1.0)
    widened = smoother.of_surface(integrate(smoothed, 1.0), 1.0, smoothed, variance)
    return smoothed, surface, widened


def rms(error: NDArray[np.floating]) -> float:
    return float(np.sqrt((error**2).mean()))


def test_the_weights_are_those_of_savitzky_and_golay() -> None:
    np.testing.assert_allclose(weights(2) * 35, [-3, 12, 17, 12, -3])
    np.testing.assert_allclose(weights(3) * 21, [-2, 3, 6, 7, 6, 3, -2])


@pytest.mark.parametrize("half_width", [0, 1])
def test_a_window_below_five_pixels_smooths_nothing(half_width: int) -> None:
    smoother = Smoother(half_width)
    smoothed, variance = smoother.prefilter(noise(0))
    np.testing.assert_array_equal(smoothed, noise(0))
    smoother.smooth_adaptively(smoothed, smoothed.copy(), variance)
    np.testing.assert_array_equal(smoothed, noise(0))


def test_planes_and_quadratics_stay_as_they_are() -> None:
    x, y = centred_grid(SHAPE)
    # The slopes of a cubic surface: quadratic, and without curl.
    quadratic = np.stack([3e-5 * x * x + 1e-5 * x * y + 0.002 * y, 5e-6 * x * x + 2e-5 * y * y + 0.002 * x], axis=2)
    for exact in (quadratic.astype(np.float32), slopes(plane(SHAPE, 0.3, -0.2))):
        for result in stages(exact):
            assert np.abs(result - exact)[INSIDE].max() < 2e-4 * np.abs(exact).max()


@pytest.mark.parametrize(("half_width", "left"), [(2, 17 / 35), (3, 1 / 3), (9, 0.1193)])
def test_one_window_leaves_the_noise_that_its_weights_say(half_width: int, left: float) -> None:
    # The variance left in each direction is the weight of the middle.
    assert weights(half_width)[half_width] == pytest.approx(left, abs=1e-3)
    assert rms(fixed(noise(1), half_width)) == pytest.approx(left * NOISE, rel=0.05)


def test_the_noise_is_told_by_what_the_narrowest_window_takes_away() -> None:
    wide = slopes(gaussian(SHAPE, 40.0, (10.0, 5.0)))
    for strength in (0.1, 1.0, 10.0):
        _, variance = Smoother().prefilter(wide + np.float32(strength) * noise(2))
        np.testing.assert_allclose(np.sqrt(variance).mean(), strength * NOISE, rtol=0.03)


def test_of_the_noise_half_fits_no_surface_and_a_tenth_remains_where_the_surface_is_smooth() -> None:
    wide = slopes(gaussian(SHAPE, 60.0, (10.0, 5.0)))
    smoothed, surface, widened = (rms((result - wide)[INSIDE]) for result in stages(wide + noise(3)))
    assert smoothed == pytest.approx(17 / 35 * NOISE, rel=0.03)
    assert surface == pytest.approx(smoothed * np.sqrt(0.5), rel=0.08)
    assert widened < 0.12 * NOISE


def test_what_white_noise_makes_of_the_differences_is_what_the_choice_goes_by() -> None:
    smoothed, surface, _ = stages(noise(3))
    last, energies = surface, [((smoothed - surface)[INSIDE] ** 2).mean()]
    for width in half_widths(NARROWEST_PX):
        wider = fixed(surface, width)
        energies.append(((wider - last)[INSIDE] ** 2).mean())
        last = wider
    # The finite differences of the surface damp the shortest waves, which only the first wider filter takes away.
    found = np.array(energies) / NOISE**2 / FilterTaps.of(NARROWEST_PX).energies
    np.testing.assert_allclose(found, [1, 0.7, 1, 1], atol=0.1)


def test_how_much_is_smoothed_does_not_depend_on_the_unit_of_the_noise() -> None:
    results = [stages(noise(4) * np.float32(factor))[2] / factor for factor in (1e-3, 1.0, 30.0)]
    for result in results[::2]:
        np.testing.assert_allclose(result, results[1], atol=2e-3 * NOISE)


def test_at_a_rim_nothing_is_smoothed_further() -> None:
    cap = sharp_cap(SHAPE, 120.0, (0.3, 0.2))
    x, y = centred_grid(SHAPE)
    rim = np.abs(np.hypot(x - 0.3, y - 0.2) - 60) < 3
    _, surface, widened = stages(slopes(cap) + noise(5))
    assert rms((widened - slopes(cap))[rim]) < 1.02 * rms((surface - slopes(cap))[rim])
    far = np.abs(np.hypot(x - 0.3, y - 0.2) - 60) > 20
    assert rms((widened - slopes(cap))[far]) < 0.6 * rms((surface - slopes(cap))[far])


@pytest.mark.parametrize(("sigma", "kept"), [(3, 0.993), (5, 0.999), (10, 0.9998)])
def test_small_contacts_keep_their_height(sigma: float, kept: float) -> None:
    bump = gaussian(SHAPE, sigma, (0.3, 0.2))
    smoothed, _, widened = stages(slopes(bump))
    assert kept < integrate(smoothed, 1.0).max() / bump.depth.max() < 1.001
    assert kept - 0.003 < integrate(widened, 1.0).max() / bump.depth.max() < 1.001


def test_a_contact_that_the_noise_leaves_visible_keeps_its_slopes() -> None:
    # Half a pixel high: at 17 px per mm a contact of 0.03 mm, its steepest slope five times the noise of a pixel.
    bump = gaussian(SHAPE, 3.0, (0.3, 0.2))
    clean = slopes(bump) * np.float32(0.5 / bump.depth.max())
    x, y = centred_grid(SHAPE)
    near = np.hypot(x - 0.3, y - 0.2) < 9
    errors = []
    for seed in range(8):
        _, surface, widened = stages(clean + noise(seed))
        errors.append([rms((result - clean)[near]) for result in (surface, widened)])
    surface_error, widened_error = np.mean(errors, axis=0)
    assert widened_error < 1.05 * surface_error


@pytest.mark.parametrize("shape", [(5, 4), (33, 47), (64, 61)])
def test_any_size_of_map_is_smoothed(shape: tuple[int, int]) -> None:
    widened = stages(noise(7, shape))[2]
    assert widened.shape == (*shape, 2)
    assert np.isfinite(widened).all()


def test_only_the_rectangle_around_what_is_marked_changes() -> None:
    smoother = Smoother()
    smoothed, variance = smoother.prefilter(noise(8))
    where = np.zeros(SHAPE, np.bool_)
    widened = smoothed.copy()
    smoother.smooth_adaptively(widened, smoothed, variance, where=where)
    np.testing.assert_array_equal(widened, smoothed)
    where[41:90, 100:170] = True
    smoother.smooth_adaptively(widened, smoothed, variance, where=where)
    changed = (widened != smoothed).any(axis=2)
    assert changed[41:90, 100:170].mean() > 0.99
    changed[40:90, 100:170] = False
    assert not changed.any()


def test_what_was_smoothed_before_does_not_matter() -> None:
    used, where = Smoother(), np.zeros(SHAPE, np.bool_)
    where[100:130, 50:200] = True
    for before in (noise(9, (64, 61)), noise(10)):
        slopes_before, variance = used.prefilter(before)
        used.smooth_adaptively(
            slopes_before, slopes_before.copy(), variance, where=where if before.shape[:2] == SHAPE else None
        )
    measured = slopes(gaussian(SHAPE, 8.0, (3.0, 2.0))) + noise(11)
    results = []
    for smoother in (used, Smoother()):
        smoothed, variance = smoother.prefilter(measured)
        smoother.smooth_adaptively(smoothed, smoothed.copy(), variance)
        results.append(smoothed)
    np.testing.assert_array_equal(results[0], results[1])


def test_slopes_that_are_wrong_in_one_place_do_not_spoil_those_beside_it() -> None:
    clean = slopes(gaussian(SHAPE, 30.0, (0.3, 0.2)))
    wrong = clean.copy()
    wrong[60:180, 200:260, 1] += 20 * NOISE  # no surface has these slopes
    beside = (slice(60, 180), slice(150, 194))
    _, surface, widened = stages(wrong + noise(12))
    assert rms((surface - clean)[beside]) > 2 * NOISE
    assert rms((widened - clean)[beside]) < 0.5 * NOISE
