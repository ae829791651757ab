"""A pinhole behind gel and acrylic: places, brightness and shadows that follow by hand."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq, minimize_scalar

from sim_reference import view
from sim_reference.deformation import Deformation
from sim_reference.geometry import SensorGeometry, led_positions, pixel_grid
from sim_reference.imaging import arriving_light, led_irradiance, ring_irradiance, ring_light, visibility
from sim_reference.refraction import Medium, medium_of, trace, window_of
from sim_reference.surface import Surface, press_object, sample, untouched

PARALLEL = SensorGeometry(image_width_px=160, image_height_px=120, pixel_size_mm=0.2352)
IN_AIR = replace(PARALLEL, perspective=True)
REAL = replace(PARALLEL, perspective=True, window=True)
INDEX, ABOVE_MM, WINDOW_MM = 1.41, 32.0, 8.0
ALL_AROUND = [PARALLEL, IN_AIR, REAL]
LIGHT = ring_light(PARALLEL)
FAR_MM = 2.0**57
"""1 - d / FAR_MM is 1 in double precision for every depth"""


def seen_by_fermat(x_mm: float, depth_mm: float) -> float:
    """Where the pinhole sees a point: light takes the shortest optical path, and its ray goes on to the gel at rest."""

    def path(entry: float) -> float:
        return np.hypot(entry, ABOVE_MM) + INDEX * np.hypot(x_mm - entry, WINDOW_MM - depth_mm)

    entry = minimize_scalar(path, bounds=(0, x_mm), method="bounded", options={"xatol": 1e-11}).x
    return entry + (x_mm - entry) * WINDOW_MM / (WINDOW_MM - depth_mm)


@pytest.mark.parametrize("depth_mm", [-0.1, 0.5, 1.5])
@pytest.mark.parametrize("x_mm", [3.0, 12.0, 18.0])
def test_a_point_is_seen_where_the_shortest_way_through_the_window_leads(x_mm: float, depth_mm: float) -> None:
    seen = seen_by_fermat(x_mm, depth_mm)
    above = trace(np.array([seen]), 40.0, window_of(REAL)).above_mm[0]
    assert seen * (1 - depth_mm / above) == pytest.approx(x_mm, abs=1e-6)
    # Near the axis that is x H / (H - d) with one H; at 18 mm and 1 mm deep the two lie 0.3 pixels of 0.0588 mm apart.
    paraxial = x_mm * view.seen_height_mm(REAL) / (view.seen_height_mm(REAL) - depth_mm)
    assert abs(paraxial - seen) < 3.2e-6 * x_mm**3 * abs(depth_mm)


def test_the_camera_seems_to_stand_as_high_as_snells_law_says() -> None:
    assert view.seen_height_mm(REAL) == pytest.approx(INDEX * ABOVE_MM + WINDOW_MM)
    assert view.seen_height_mm(IN_AIR) == 40
    assert view.seen_height_mm(PARALLEL) == np.inf


@pytest.mark.parametrize("geometry", [IN_AIR, REAL])
def test_a_raised_plane_is_seen_drawn_together_and_lit_at_its_places(geometry: SensorGeometry) -> None:
    raised = np.full(geometry.image_shape, 0.8)
    assert view.first_met(raised, geometry) == pytest.approx(raised)
    at, middle = pixel_grid(geometry)[0][0], geometry.image_height_px // 2
    x, y = view.places(raised, geometry)
    above = trace(np.abs(at), 40.0, medium_of(geometry)).above_mm
    assert x[middle] == pytest.approx(at * (1 - 0.8 / above), rel=1e-4)
    seen = led_irradiance(Surface(raised, np.zeros((*geometry.image_shape, 2)), raised > 0), geometry, 2)
    row, column = 30, 20
    near = replace(geometry, camera_height_mm=39.2, gel_thickness_mm=4.2)  # the same gel at rest, so much nearer
    led = led_positions(near)[2]
    light, to_z = arriving_light(near, 2, led[0] - x[row, column], led[1] - y[row, column], 0.0, medium_of(near))
    assert seen[row, column] == pytest.approx(20**2 * light * to_z * view.falloff(geometry)[row, column])


def test_a_tilted_plane_is_seen_where_line_and_plane_meet() -> None:
    x, _ = np.broadcast_arrays(*pixel_grid(IN_AIR))
    met = view.first_met(0.3 + 0.1 * x, IN_AIR)
    inner = (slice(8, -8), slice(8, -8))  # the surface ends at the border
    assert met[inner] == pytest.approx(((0.3 + 0.1 * x) / (1 + 0.1 * x / 40))[inner], abs=2 * view.MET_MM)


def imprint(height: np.ndarray, spacing: float, depth: float, _: SensorGeometry) -> Deformation:
    """A gel that takes the object's form."""
    pressed = np.maximum(height + depth, 0.0)
    return Deformation(pressed, (pressed > 0).astype(float), spacing)


def test_a_ball_is_seen_where_line_and_sphere_meet() -> None:
    place, deep, radius = np.array([12.0, -7.0]), 1.2, 4.0
    surface = sample(press_object("BALL", deep, IN_AIR, model=imprint), IN_AIR, *place.tolist())
    p = np.stack(np.broadcast_arrays(*pixel_grid(IN_AIR)), axis=2)
    # |p (1 - d / H) - place|^2 + (d - deep + R)^2 = R^2 for the depth d
    a, b, below = p - place, -p / 40, deep - radius
    square, half = 1 + (b**2).sum(axis=2), (a * b).sum(axis=2) - below
    root = half**2 - square * ((a**2).sum(axis=2) + below**2 - radius**2)
    depth = (np.sqrt(np.maximum(root, 0)) - half) / square
    inside = (root > 0) & (depth > 0.5)
    np.testing.assert_allclose(surface.depth_mm[inside], depth[inside], rtol=0, atol=3e-5)
    x = p * (1 - depth / 40)[..., None] - place
    slopes = -x[inside] / np.sqrt(radius**2 - (x[inside] ** 2).sum(axis=1))[:, None]
    np.testing.assert_allclose(surface.gradient_map[inside], slopes, rtol=0, atol=2e-3)
    assert surface.contact[inside].all()


def test_a_wall_hides_what_lies_behind_it_and_shows_its_face_to_the_axis() -> None:
    fine = replace(IN_AIR, image_width_px=400, image_height_px=16, pixel_size_mm=0.0588)
    x, _ = np.broadcast_arrays(*pixel_grid(fine))
    axis, pixel, edge = x[8], fine.pixel_size_mm, 10 * 40 / 38  # where the edge of a wall 2 mm high at 10 mm is seen
    behind = view.first_met(np.where(x < 10, 2.0, 0.0), fine)[8]
    assert np.abs(behind - 2)[(axis > 0) & (axis < edge - pixel)].max() < 2 * view.MET_MM
    assert np.abs(behind)[axis > edge + pixel].max() < 2 * view.MET_MM
    before = view.first_met(np.where(x > 10, 2.0, 0.0), fine)[8]
    face = (axis > 10 + 2 * pixel) & (axis < edge - pixel)
    assert np.abs(before - (1 - 10 / axis) * 40)[face].max() < pixel * 40 / 10  # the wall lies somewhere in a pixel


def test_from_far_away_in_air_the_picture_is_that_of_parallel_rays_to_the_last_digit() -> None:
    parallel = replace(PARALLEL, camera_height_mm=FAR_MM, mounting_height_mm=FAR_MM - 32)
    far = replace(parallel, perspective=True)
    pressed = press_object("TSTEP", 1.0, PARALLEL, size=256)
    for turn in (0.0, 0.4):
        one, other = (sample(pressed, geometry, 3.0, -2.0, turn) for geometry in (parallel, far))
        pictures = [ring_irradiance(one, parallel, LIGHT), ring_irradiance(other, far, LIGHT)]
        if turn:  # the same splines, at the same points
            assert np.array_equal(one.depth_mm, other.depth_mm)
            assert np.array_equal(one.gradient_map, other.gradient_map)
            assert np.array_equal(*pictures)
        assert np.abs(pictures[1] - pictures[0]).max() < 1e-12


def test_a_window_of_index_one_lights_as_none_does() -> None:
    x, y = (axis.ravel() for axis in np.broadcast_arrays(*pixel_grid(PARALLEL)))
    thin = Medium(refractive_index=1 + 1e-13, thickness_mm=8.0)
    none = Medium(refractive_index=1, thickness_mm=0.0)
    for depth in (0.0, 1.3):
        bent, straight = (arriving_light(PARALLEL, 3, 5.0 - x, y, depth, medium) for medium in (thin, none))
        assert bent[0] == pytest.approx(straight[0], rel=1e-9)
        assert np.abs(bent[1] - straight[1]).max() < 1e-8


def test_the_window_loses_no_light_but_by_reflection_at_any_depth() -> None:
    # Light that leaves within 60 degrees arrives within the distance of that ray, whatever the depth of the plane.
    for depth in (0.0, 2.0):
        far = brentq(lambda x: trace(np.array([x]), 20.0, window_of(REAL), depth).leaving_tan[0] - np.sqrt(3), 1, 60)  # noqa: B023
        x = (np.arange(20000) + 0.5) * far / 20000
        rays = trace(x, 20.0, window_of(REAL), depth)
        assert (2 * np.pi * x * rays.flux / rays.passing).sum() * far / 20000 == pytest.approx(np.pi, rel=1e-5)


def test_a_shadow_behind_the_window_ends_where_the_bent_ray_that_grazes_the_edge_arrives() -> None:
    fine = replace(REAL, image_width_px=640, image_height_px=48, pixel_size_mm=0.0588)
    x, y = (axis.ravel() for axis in pixel_grid(fine))
    led = np.array([-21.5, 0.0, 20.0])
    step = np.broadcast_to(np.where(x < 2, 1.0, 0.0), fine.image_shape)
    seen = visibility(step, (x, y), led, window_of(fine))[24]
    edge_mm = x[np.flatnonzero(x < 2)[-1]]
    ends = edge_mm + trace(np.array([edge_mm + 21.5]), 20.0, window_of(fine), 1.0).arriving_tan[0]
    shadow = x[(seen < 0.5) & (x > 2.1)]
    assert shadow.max() == pytest.approx(ends, abs=2 * 0.0588)
    assert ends - edge_mm < 0.8 * 23.5 / 19  # the straight ray falls far longer


def test_oblique_rays_bring_less_where_the_lens_has_it() -> None:
    x, y = pixel_grid(IN_AIR)
    cosine = 40 / np.sqrt(40**2 + x**2 + y**2)
    assert np.abs(view.falloff(replace(IN_AIR, obliquity=4)) - cosine**4).max() < 1e-4
    assert (view.falloff(IN_AIR) == 1).all()
    # Up to 30 degrees unpolarised light passes a face as well as straight on.
    assert np.abs(view.falloff(REAL) - 1).max() < 2e-3


@pytest.mark.parametrize("geometry", ALL_AROUND)
def test_the_gel_at_rest_is_seen_at_its_own_places(geometry: SensorGeometry) -> None:
    x, y = view.places(untouched(geometry).depth_mm, geometry)
    at = np.broadcast_arrays(*pixel_grid(geometry))
    assert np.array_equal(np.broadcast_to(x, at[0].shape), at[0])
    assert np.array_equal(np.broadcast_to(y, at[1].shape), at[1])
