"""The solver against surfaces and lights whose answer is known: exact, near field against far field, shadows."""

from dataclasses import replace
from math import radians

import numpy as np
import pytest

from gellight.base.errors import InputError
from gellight.bundle.contents import npz
from gellight.photometric.directions import LightDirections
from gellight.photometric.ring_geometry import RingGeometry
from gellight.photometric.solver import (
    Points,
    inverse,
    light_rows,
    normal_matrix,
    predict,
    slopes,
    solve,
    solve_robustly,
)
from sim_reference import geometry as reference_geometry
from sim_reference.geometry import SensorGeometry
from sim_reference.imaging import led_irradiance
from sim_reference.surface import Surface

RING = RingGeometry()
SENSOR = SensorGeometry(image_width_px=64, image_height_px=48, pixel_size_mm=0.3)


def grid() -> tuple[np.ndarray, np.ndarray]:
    x, y = reference_geometry.pixel_grid(SENSOR)
    across, down = np.broadcast_arrays(x, y)
    return across.ravel(), down.ravel()


def pictures_of(depth: np.ndarray, gradient: np.ndarray, sensor: SensorGeometry = SENSOR) -> np.ndarray:
    """(12, P) irradiance of a surface (H, W), by the reference simulator, exact."""
    surface = Surface(depth, gradient, np.zeros(depth.shape, bool))
    return np.stack([led_irradiance(surface, sensor, led).ravel() for led in range(12)])


def flat_pictures(sensor: SensorGeometry = SENSOR) -> np.ndarray:
    return pictures_of(np.zeros(SENSOR.image_shape), np.zeros((*SENSOR.image_shape, 2)), sensor)


def solved(signals: np.ndarray, depth: np.ndarray, valid: np.ndarray | None = None) -> np.ndarray:
    """(H, W, 2) slopes, the light computed at the true depth."""
    rows = light_rows(Points(*grid(), depth.ravel()), flat_pictures(), RING)
    scaled = solve(signals, rows, np.ones(signals.shape, bool) if valid is None else valid)
    return np.moveaxis(slopes(scaled).reshape(2, *SENSOR.image_shape), 0, 2)


def ball(radius_mm: float, depth_mm: float) -> tuple[np.ndarray, np.ndarray]:
    """A spherical cap that rises into the sensor, flat around it: depth and slopes."""
    x, y = (axis.reshape(SENSOR.image_shape) for axis in grid())
    squared = x**2 + y**2
    height = np.sqrt(np.maximum(radius_mm**2 - squared, 0.1)) - (radius_mm - depth_mm)
    inside = squared < radius_mm**2 - (radius_mm - depth_mm) ** 2
    root = np.sqrt(np.maximum(radius_mm**2 - squared, 0.1))
    gradient = np.stack([-x / root, -y / root], axis=2)
    return np.where(inside, height, 0.0), np.where(inside[..., None], gradient, 0.0)


def test_the_ring_is_where_the_reference_simulator_has_it() -> None:
    theirs = SensorGeometry()
    np.testing.assert_allclose(RING.positions_mm(), reference_geometry.led_positions(theirs), atol=1e-12)
    np.testing.assert_allclose(RING.axes(), reference_geometry.led_axes(theirs), atol=1e-12)
    assert RING.emission_exponent == pytest.approx(theirs.emission_exponent)
    assert RING.led_colours == theirs.led_colours


@pytest.mark.parametrize("slope", [(0.0, 0.0), (0.3, -0.2), (-0.5, 0.4)])
@pytest.mark.parametrize("beam_deg", [120.0, 90.0])
def test_a_tilted_plane_is_exact(slope: tuple[float, float], beam_deg: float) -> None:
    x, y = (axis.reshape(SENSOR.image_shape) for axis in grid())
    depth = 0.2 * (slope[0] * x + slope[1] * y)
    gradient = np.broadcast_to(np.array(slope), (*SENSOR.image_shape, 2)).copy()
    sensor, ring = (replace(one, beam_angle_rad=radians(beam_deg)) for one in (SENSOR, RING))
    signals = pictures_of(depth, gradient, sensor)
    rows = light_rows(Points(*grid(), depth.ravel()), flat_pictures(sensor), ring)
    found = slopes(solve(signals, rows, signals > 0))
    np.testing.assert_allclose(found, np.array(slope)[:, None] * np.ones_like(found), atol=1e-6)


def test_a_sphere_is_exact_where_three_lights_reach_it() -> None:
    depth, gradient = ball(4.0, 1.0)
    signals = pictures_of(depth, gradient)
    found = solved(signals, depth, signals > 0)
    np.testing.assert_allclose(found, gradient, atol=1e-6)
    assert np.abs(gradient).max() > 0.8, "the rim of the ball is steep"


def test_albedo_and_exposure_cancel() -> None:
    depth, gradient = ball(4.0, 0.5)
    dirt = np.random.default_rng(0).uniform(0.3, 2.0, depth.size)
    np.testing.assert_allclose(solved(pictures_of(depth, gradient) * dirt, depth), gradient, atol=1e-6)


def test_a_shadow_that_is_left_out_costs_nothing_and_one_that_is_not_costs_degrees() -> None:
    depth, gradient = ball(4.0, 0.5)
    signals = pictures_of(depth, gradient)
    signals[3] = 0.0
    lit = signals > 0
    np.testing.assert_allclose(solved(signals, depth, lit), gradient, atol=1e-6)
    assert np.abs(solved(signals, depth) - gradient).max() > 0.05


def test_a_half_shadow_is_found_by_its_misfit() -> None:
    depth, gradient = ball(4.0, 0.5)
    signals = pictures_of(depth, gradient) * 255
    shaded = signals.copy()
    shaded[5] *= 0.6
    rows = light_rows(Points(*grid(), depth.ravel()), flat_pictures() * 255, RING)
    scaled, used = solve_robustly(shaded, rows, np.ones(shaded.shape, bool), np.full(12, 1e-3))
    assert not used[5].any()
    found = np.moveaxis(slopes(scaled).reshape(2, *depth.shape), 0, 2)
    only_it = used.sum(axis=0).reshape(depth.shape) == 11
    assert only_it.mean() > 0.9
    np.testing.assert_allclose(found[only_it], gradient[only_it], atol=1e-6)


@pytest.mark.parametrize(
    ("darker", "deviations", "used"), [(0.09, 99, True), (0.11, 99, False), (0.3, 3.9, True), (0.3, 4.1, False)]
)
def test_a_light_is_shadowed_beyond_a_tenth_and_four_deviations(darker: float, deviations: float, used: bool) -> None:
    """Among 3000 lights, of which one makes next to nothing of the prediction."""
    rows = np.random.default_rng(6).normal(size=(3000, 3, 1))
    rows[:, 2] += 4
    signals = 100 * rows[:, 2]
    signals[7] *= 1 - darker
    valid, deviation = np.ones(signals.shape, bool), np.full(3000, 100 * rows[7, 2, 0] * darker / deviations)
    assert solve_robustly(signals, rows, valid, deviation)[1][7, 0] == used


def test_a_point_that_would_keep_two_lights_stays_as_it_is_and_one_that_keeps_three_does_not() -> None:
    depth, gradient = ball(4.0, 0.3)
    rows = light_rows(Points(*grid(), depth.ravel()), flat_pictures(), RING)
    for lit in (3, 4):
        valid, signals = np.zeros(rows[:, 0].shape, bool), pictures_of(depth, gradient)
        valid[[0, 4, 8, 2][:lit]] = True
        signals[0] *= 0.2
        used = solve_robustly(signals, rows, valid, np.full(12, 1e-6))[1].sum(axis=0)
        assert set(used) <= ({3} if lit == 3 else {3, 4})


def test_noise_alone_shadows_nothing() -> None:
    depth, gradient = ball(4.0, 0.3)
    references = flat_pictures() * 200
    rows = light_rows(Points(*grid(), depth.ravel()), references, RING)
    signals = pictures_of(depth, gradient) * 200 + np.random.default_rng(1).normal(0, 1.0, references.shape)
    _, used = solve_robustly(signals, rows, np.ones(signals.shape, bool), np.ones(12))
    assert used.mean() > 0.999


@pytest.mark.parametrize("lit", [2, 3])
def test_with_fewer_than_three_lights_all_are_used(lit: int) -> None:
    depth, gradient = ball(4.0, 0.3)
    signals = pictures_of(depth, gradient)
    valid = np.zeros(signals.shape, bool)
    valid[:lit] = True
    signals[3:] *= 1 if lit < 3 else 0.5
    np.testing.assert_allclose(solved(signals, depth, valid), gradient, atol=1e-6)


def test_lights_in_one_plane_give_the_gel_at_rest_and_no_infinity() -> None:
    rows = np.zeros((3, 3, 1))
    rows[:, 0, 0], rows[:, 2, 0] = [1.0, -1.0, 0.5], 1.0
    scaled = solve(np.ones((3, 1)), rows, np.ones((3, 1), bool))
    assert slopes(scaled).tolist() == [[0.0], [0.0]]


def test_slopes_are_bounded() -> None:
    steep = np.array([[3.0, 3.0], [4.0, 4.0], [0.01, -2.0]])
    np.testing.assert_allclose(np.hypot(*slopes(steep)), 10.0)
    gentler = np.array([[0.0], [-9.9], [1.0]])
    np.testing.assert_allclose(slopes(gentler), [[0.0], [9.9]])
    assert slopes(np.zeros((3, 1))).tolist() == [[0.0], [0.0]]


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
def test_lights_in_one_plane_have_no_inverse_at_any_strength(scale: float) -> None:
    rows = np.random.default_rng(4).normal(size=(5, 3, 7))
    rows[:, 2] = rows[:, 0] - 2 * rows[:, 1]
    assert (inverse(normal_matrix(scale * rows, scale * rows)) == 0).all()
    rows[:, 2] += 0.01 * np.random.default_rng(5).normal(size=(5, 7))
    assert (inverse(normal_matrix(scale * rows, scale * rows))[0, 0] > 0).all()


def test_prediction_and_solution_are_one() -> None:
    rng = np.random.default_rng(3)
    rows, scaled = rng.normal(size=(6, 3, 9)), rng.normal(size=(3, 9))
    np.testing.assert_allclose(solve(predict(rows, scaled), rows, np.ones((6, 9), bool)), scaled, atol=1e-10)


def test_the_frame_path_is_single_precision_throughout() -> None:
    points = Points(*(axis.astype(np.float32) for axis in grid()), np.zeros(grid()[0].size, np.float32))
    references = flat_pictures().astype(np.float32)
    rows = light_rows(points, references, RING)
    scaled, _ = solve_robustly(references, rows, np.ones(references.shape, bool), np.ones(12, np.float32))
    assert rows.dtype == scaled.dtype == slopes(scaled).dtype == np.float32


@pytest.mark.parametrize(
    ("name", "array"),
    [
        ("noise_grey", np.ones(2)),
        ("pixel_size_mm", np.array("x")),
        ("pixel_size_mm", np.array(-1.0)),
        ("groups", np.ones(4, np.uint8)),
        ("untouched", np.full((4, 8, 8), np.nan, np.float32)),
        ("untouched", np.zeros((4, 0, 8), np.float32)),
    ],
)
def test_a_file_of_lights_with_anything_amiss_is_refused(name: str, array: np.ndarray) -> None:
    pictures = {"vectors": np.ones((4, 3, 3)), "untouched": np.full((4, 8, 8), 100.0, np.float32)}
    sound = {**pictures, "noise_grey": np.ones(()), "pixel_size_mm": np.ones(()), "groups": np.zeros((0, 0, 3))}
    assert LightDirections.of_content(npz(sound), "file.npz").noise_grey == 1
    with pytest.raises(InputError, match=r"file\.npz holds no lights"):
        LightDirections.of_content(npz({**sound, name: array}), "file.npz")


def test_light_through_a_window_gives_the_slopes_that_light_straight_on_gives() -> None:
    behind, ring = replace(SENSOR, window=True), replace(RING, window_mm=SENSOR.window_mm)
    depth, gradient = ball(4.0, 1.0)
    signals, rest = pictures_of(depth, gradient, behind), flat_pictures(behind)
    lit = signals > 0.01 * rest  # beyond is shadow
    inside = (np.hypot(*gradient.transpose(2, 0, 1)) < 1.2).ravel() & (lit.sum(axis=0) > 8)
    points = Points(*grid(), depth.ravel())
    found, straight = (slopes(solve(signals, light_rows(points, rest, known), lit)).T for known in (ring, RING))
    true = gradient.reshape(-1, 2)
    assert np.abs(found - true)[inside].max() < 1e-6
    ratio = float((straight * true)[inside].sum() / (true**2)[inside].sum())
    assert ratio == pytest.approx(0.64, abs=0.06)  # as if there were none
