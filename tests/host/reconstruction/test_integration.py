"""Integration and normals against surfaces that are known in closed form."""

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from gellight.reconstruction.contact import measure_patches
from gellight.reconstruction.integration import _edge_integrals, integrate, normals, surface_gradient
from gellight.reconstruction.perspective import Perspective
from sim_reference.geometry import SensorGeometry
from sim_reference.surface import press_object, sample
from tests.helpers.analytic_surfaces import Surface, fitted_scale, gaussian, plane, sharp_cap, smooth_cap

SHAPES = [(240, 320), (480, 640)]
slope_maps = arrays.arrays(
    np.float64, st.tuples(st.integers(2, 17), st.integers(2, 17), st.just(2)), elements=st.floats(-2, 2, width=32)
)


def centre(shape: tuple[int, int], place: str, extent: float) -> tuple[float, float]:
    """Off the pixel grid in the middle, or so that the right border cuts the contact."""
    return (0.3, 0.2) if place == "middle" else (shape[1] / 2 - 0.2 * extent, 0.2)


def in_float32(surface: Surface, pixel_size_mm: float = 1.0) -> np.ndarray:
    depth = integrate(surface.gradient_map.astype(np.float32), pixel_size_mm)
    assert depth.dtype == np.float32
    return depth


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("place", ["middle", "border"])
@pytest.mark.parametrize("sigma", [2, 5, 10, 20, 40])
def test_a_gaussian_bump_keeps_its_height(shape: tuple[int, int], place: str, sigma: float) -> None:
    bump = gaussian(shape, sigma, centre(shape, place, 4 * sigma))
    depth = in_float32(bump)
    assert fitted_scale(depth, bump.depth) == pytest.approx(1, abs=0.001)
    assert depth.max() == pytest.approx(bump.depth.max() - np.median(bump.depth), rel=0.002)


@pytest.mark.parametrize(
    ("diameter", "mean_within", "each_within"), [(5, 0.03, 0.2), (20, 0.005, 0.04), (60, 0.005, 0.01)]
)
def test_a_cap_with_a_sharp_rim_is_right_on_average(diameter: float, mean_within: float, each_within: float) -> None:
    """A jump of the slope lies between two samples and nobody can know where: 5 px across that costs +-15 %."""
    rng = np.random.default_rng(1)
    scales = []
    for x, y in rng.uniform(-0.5, 0.5, (40, 2)):
        cap = sharp_cap((96, 96), diameter, (x, y))
        scales.append(fitted_scale(integrate(cap.gradient_map, 1.0), cap.depth))
    assert np.mean(scales) == pytest.approx(1, abs=mean_within)
    assert np.abs(np.array(scales) - 1).max() < each_within


def test_polynomials_up_to_the_stated_degree_are_exact_at_every_pixel() -> None:
    x = np.arange(40.0)[None, :].repeat(30, axis=0)
    for degree in range(1, 5):
        depth = (x / 40) ** degree
        slope = degree * x ** (degree - 1) / 40**degree
        found = integrate(np.stack([slope, np.zeros_like(x)], axis=2), 1.0)
        assert np.ptp(found - depth) < 1e-12


def test_the_inner_edge_rule_is_of_sixth_order() -> None:
    """Halving the step of a bump far from the border divides the error by 2^6."""
    errors = []
    for sigma in (4, 8):
        bump = gaussian((160, 160), sigma, (0.3, 0.2))
        errors.append(np.ptp(integrate(bump.gradient_map, 1.0) - bump.depth))
    assert 5.3 < np.log2(errors[0] / errors[1]) < 6.7


def test_the_median_is_zero_and_a_touch_of_less_than_half_leaves_the_rest_at_zero() -> None:
    cap = smooth_cap((240, 320), 150, (0, 0), height=20)
    depth = in_float32(cap)
    assert np.abs(depth[cap.depth == 0]).max() < 1e-3


def test_a_known_rest_sets_the_zero_where_most_is_touched() -> None:
    cap = smooth_cap((100, 100), 105, (0, 0), height=10)
    assert integrate(cap.gradient_map, 1.0).max() < 9.5
    depth = integrate(cap.gradient_map, 1.0, at_rest=cap.depth == 0)
    assert depth.max() == pytest.approx(10, rel=0.001)


@pytest.mark.parametrize("name", ["WAVE", "BALLCAVE", "PCONVEX", "TSTEP"])
def test_where_nothing_is_at_rest_the_gel_keeps_its_volume(name: str) -> None:
    geometry = SensorGeometry()
    truth = sample(press_object(name, 0.8, geometry, size=256), geometry, 1.0, -1.0)
    nothing = np.zeros(geometry.image_shape, np.bool_)
    depth = integrate(truth.gradient_map, geometry.pixel_size_mm, at_rest=nothing)
    # The bulge is between 1.5 and 2.1 times what is pressed down, so a tenth of it is open: some 0.02 mm here.
    assert np.abs(depth - truth.depth_mm).mean() < 0.03
    assert np.abs(integrate(truth.gradient_map, geometry.pixel_size_mm) - truth.depth_mm).mean() > 0.05


@given(slope_maps, st.floats(0.25, 4))
def test_integration_is_linear_in_slope_and_pixel_size(slopes: np.ndarray, factor: float) -> None:
    depth = integrate(slopes, 0.5)
    tolerance = 1e-9 * slopes.size
    assert np.ptp(integrate(slopes * factor, 0.5) - factor * depth) <= tolerance
    assert np.ptp(integrate(slopes, 0.5 * factor) - factor * depth) <= tolerance
    assert np.ptp(integrate(slopes + slopes[::-1], 0.5) - depth - integrate(slopes[::-1].copy(), 0.5)) <= tolerance


@given(slope_maps)
def test_a_mirrored_gradient_map_gives_the_mirrored_depth(slopes: np.ndarray) -> None:
    mirrored = slopes[:, ::-1] * [-1, 1]
    assert np.ptp(integrate(mirrored, 1.0) - integrate(slopes, 1.0)[:, ::-1]) < 1e-9 * slopes.size
    transposed = slopes.transpose(1, 0, 2)[..., ::-1]
    assert np.ptp(integrate(transposed, 1.0) - integrate(slopes, 1.0).T) < 1e-9 * slopes.size


@given(st.floats(-3, 3), st.floats(-3, 3), st.integers(2, 40), st.integers(2, 40))
def test_every_plane_is_exact_also_of_pixels_of_two_sizes(
    slope_x: float, slope_y: float, height: int, width: int
) -> None:
    tilted = plane((height, width), slope_x, slope_y)
    assert np.ptp(integrate(tilted.gradient_map, 1.0) - tilted.depth) < 1e-10
    oblong = plane((height, width), 0.1 * slope_x, 0.2 * slope_y)
    assert np.ptp(integrate(tilted.gradient_map, (0.1, 0.2)) - oblong.depth) < 1e-12


@settings(max_examples=20)
@given(slope_maps)
def test_no_other_surface_fits_the_edges_better(slopes: np.ndarray) -> None:
    """Least squares: the residual has no component along any small change of the surface."""
    depth = integrate(slopes, 1.0)
    residual_x = np.diff(depth, axis=1) - _edge_integrals(slopes[..., 0])
    residual_y = np.diff(depth, axis=0) - _edge_integrals(slopes[..., 1].T).T
    change = np.random.default_rng(0).normal(size=depth.shape)
    along = (residual_x * np.diff(change, axis=1)).sum() + (residual_y * np.diff(change, axis=0)).sum()
    assert abs(along) < 1e-8 * slopes.size


def test_normals_are_unit_vectors_against_the_slope() -> None:
    bump = gaussian((60, 80), 10, (0, 0), height=12)
    found = normals(bump.gradient_map.astype(np.float32))
    gx, gy = bump.gradient_map[..., 0], bump.gradient_map[..., 1]
    true = np.stack([-gx, -gy, np.ones_like(gx)], axis=2) / np.sqrt(1 + gx**2 + gy**2)[..., None]
    assert found.dtype == np.float32
    assert np.abs(found - true).max() < 1e-6
    assert np.abs(np.linalg.norm(found, axis=2) - 1).max() < 1e-6
    assert normals(bump.gradient_map).dtype == np.float32


@pytest.mark.parametrize(
    ("refuse", "said"),
    [
        (lambda: normals(np.zeros((4, 5, 3))), r"shape \(4, 5, 3\): give \(H, W, 2\)"),
        *((lambda shape=shape: integrate(np.zeros(shape), 1.0), r"shape \(" + ", ".join(map(str, shape)))
          for shape in ((5, 5), (5, 5, 3), (1, 5, 2), (5, 1, 2), (0, 0, 2))),
        (lambda: integrate(np.zeros((5, 6, 2)), 1.0, at_rest=np.ones((6, 5), np.bool_)), "at_rest has shape"),
        *((lambda bad=bad: integrate(np.full((1, 2, 2), bad).repeat(2, 0), 1.0), "8 values that are NaN or infinite")
          for bad in (np.nan, np.inf, -np.inf)),
        *((lambda size=size: integrate(np.zeros((5, 6, 2)), size), r"pixel size .* above 0")
          for size in (0, -0.1, np.nan, np.inf, (0.1, 0), (-1.0, 1.0))),
        *((lambda shape=shape: surface_gradient(np.zeros(shape), 1.0), "depth map has shape")
          for shape in ((2, 9), (9, 2), (4, 4, 2))),
    ],
)  # fmt: skip
def test_what_cannot_be_integrated_is_refused_with_its_value(refuse: Callable[[], object], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        refuse()


def test_the_bulge_of_the_gel_sets_the_height_of_a_view_that_is_touched_all_over() -> None:
    bump = gaussian((60, 80), 12, (0, 0), height=1.0)
    nowhere = np.zeros((60, 80), np.bool_)
    stiff, soft = (integrate(bump.gradient_map, 1.0, at_rest=nowhere, bulge=bulge) for bulge in (0.0, 1.71))
    assert stiff.mean() == pytest.approx(0, abs=1e-6), "no bulge: what is pressed down comes up inside the view"
    border = np.concatenate([soft[0], soft[-1], soft[:, 0], soft[:, -1]])
    assert soft.mean() == pytest.approx(-1.71 * 0.74 * np.quantile(border, 0.25), rel=1e-3)


def test_a_depth_map_has_the_gradient_of_its_polynomial() -> None:
    y, x = np.indices((24, 31)).astype(np.float64)
    quadratic = 0.02 * x * x - 0.03 * x * y + 0.01 * y * y
    slopes = np.stack([(0.04 * x - 0.03 * y) / 0.5, (-0.03 * x + 0.02 * y) / 0.25], axis=2)
    np.testing.assert_allclose(surface_gradient(quadratic, (0.5, 0.25)), slopes, atol=2e-4)
    inside = (slice(3, -3), slice(3, -3))
    sextic = 1e-7 * (x - 15) ** 6
    np.testing.assert_allclose(surface_gradient(sextic, 1.0)[inside][..., 0], 6e-7 * (x - 15)[inside] ** 5, atol=2e-4)


def test_integration_and_differentiation_give_the_slopes_of_a_surface_back() -> None:
    bump = gaussian((240, 320), 8.0, (40.3, -20.2))
    back = surface_gradient(integrate(bump.gradient_map.astype(np.float32), 0.06), 0.06)
    np.testing.assert_allclose(back, bump.gradient_map, atol=1e-5)


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
