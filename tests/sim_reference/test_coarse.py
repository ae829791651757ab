"""The coarse stage: exact without noise, Rayleigh with it, and the same numbers whichever way they are computed."""

from dataclasses import replace
from fractions import Fraction
from functools import cache
from math import atan, cos, degrees, pi, radians, sin, tan

import numpy as np
import pytest

from sim_reference.geometry import SensorGeometry
from sim_reference.imaging import directional_image
from sim_reference.metrics import angular_error, error_figures
from sim_reference.objects import BENCHMARK_NAMES
from sim_reference.optimizer import coarse
from sim_reference.optimizer.benchmark import PressedObject, Sampling, plane, press_benchmark
from sim_reference.optimizer.exposing import LightGroups, expose, picture_key, ring_azimuths
from sim_reference.optimizer.shadows import horizon, reach
from sim_reference.photometric_stereo import ring_directions, solve_normals

GEOMETRY = SensorGeometry()
SMALL = Sampling(size_px=96)
PAPER = LightGroups()


@cache
def pressed(name: str) -> PressedObject:
    return press_benchmark(name, SMALL, GEOMETRY)


@cache
def study() -> coarse.CoarseResult:
    """The whole sweep on a reduced grid."""
    errors = np.array([coarse.evaluate(pressed(name), PAPER) for name in BENCHMARK_NAMES])
    return coarse.CoarseResult(BENCHMARK_NAMES, PAPER, errors)


def plainly(seen: PressedObject, groups: LightGroups, number: int, angle: float) -> tuple[float, float, float]:
    """Section 2.3.1 with nothing kept: each picture for itself, each horizon of the whole map."""
    directions, images = ring_directions(number, angle), []
    for light, direction in enumerate(directions):
        azimuth = Fraction(light, number)
        far = reach(seen.depth_mm, angle)
        raised = horizon(seen.depth_mm.astype(np.float32), seen.spacing_mm, 2 * pi * float(azimuth), far)
        brightness = directional_image(seen.gradient_map, direction) * (raised < 1 / tan(angle))
        images.append(expose(brightness[seen.region], groups, picture_key(seen.index, azimuth, angle)))
    found = solve_normals(np.stack(images)[:, None, :], directions)[0]
    return error_figures(np.where(np.any(images, axis=0), angular_error(found, seen.normals), pi / 2))


@pytest.mark.parametrize("name", ["TSTEP", "BALLCAVE", "SINWAVE"])
def test_what_is_kept_changes_no_error(name: str) -> None:
    groups = replace(PAPER, numbers=(3, 9, 12), angles_rad=(radians(13), radians(45), radians(85)))
    shared = coarse.evaluate(pressed(name), groups)
    for row, column in np.ndindex(3, 3):
        alone = plainly(pressed(name), groups, groups.numbers[row], groups.angles_rad[column])
        assert shared[row, column] == pytest.approx(np.array(alone), abs=1e-15)
    assert np.degrees(shared).max() > 5  # the comparison saw shadows


def test_without_noise_and_shadow_the_normals_are_exact() -> None:
    wave = pressed("SCROWN")
    angle = pi / 2 - wave.steepest_rad(1e-9) - 0.02
    groups = LightGroups(numbers=(3, 12, 21), angles_rad=(0.1, angle), noise_grey=0, quantised=False)
    assert np.degrees(coarse.evaluate(wave, groups)).max() < 1e-9


@pytest.mark.parametrize("noise_grey", [1.0, 2.0])
def test_a_plane_obeys_the_closed_form_noise_law(noise_grey: float) -> None:
    angles = (radians(5), radians(29), radians(61))
    groups = LightGroups(numbers=(3, 12, 21), angles_rad=angles, noise_grey=noise_grey, full_scale_grey=230)
    measured = coarse.evaluate(plane(replace(SMALL, size_px=256), GEOMETRY), groups)
    for row, number in enumerate(groups.numbers):
        for column, angle in enumerate(angles):
            assert measured[row, column] == pytest.approx(coarse.noise_law(groups, number, angle), rel=0.05)


def test_the_constants_of_the_noise_law_are_those_of_a_rayleigh_distribution() -> None:
    groups = LightGroups(noise_grey=1.0, quantised=False, full_scale_grey=1.0)
    s = np.sqrt(2 / 12) / sin(0.5)
    assert np.array(coarse.noise_law(groups, 12, 0.5)) / s == pytest.approx([1.2533, 2.808, 3.337], abs=6e-4)


def test_a_horizon_is_where_a_ridge_puts_it() -> None:
    depth = np.zeros((41, 41))
    depth[:, 30] = 2.0
    east = horizon(depth, 0.5, 0.0, 20.0)
    assert east[20, 10] == pytest.approx(2 / (20 * 0.5))
    assert east[20, 31] == 0
    assert horizon(depth, 0.5, pi, 20.0)[20, 36] == pytest.approx(2 / (6 * 0.5))
    assert horizon(depth, 0.5, pi / 2, 20.0)[20, 10] == 0
    # Across the ridge at 30 degrees the way to it is longer by 1 / cos 30.
    assert horizon(depth, 0.5, pi / 6, 20.0)[25, 10] == pytest.approx(2 * cos(pi / 6) / 10)


@pytest.mark.parametrize("turn", [1, 2, 3])
def test_horizons_turn_with_the_surface(turn: int) -> None:
    depth = np.random.default_rng(1).normal(size=(24, 24))
    turned = horizon(np.rot90(depth, turn), 1.0, 0.3 + turn * pi / 2, 10.0)
    assert turned == pytest.approx(np.rot90(horizon(depth, 1.0, 0.3, 10.0), turn))


def test_the_reach_of_a_shadow_is_far_enough() -> None:
    surface, angle = pressed("BALLCAVE").depth_mm, radians(61)
    near = horizon(surface, SMALL.spacing_mm, 0.4, reach(surface, angle))
    far = horizon(surface, SMALL.spacing_mm, 0.4, 40.0)
    assert ((near < 1 / tan(angle)) == (far < 1 / tan(angle))).all()
    assert (far > near).any()


def test_the_84_lights_of_the_paper_stand_at_54_azimuths() -> None:
    assert sum(PAPER.numbers) == 84
    assert len({azimuth for number in PAPER.numbers for azimuth in ring_azimuths(number)}) == 54


def test_the_averaged_curve_is_lowest_at_29_degrees_for_any_number_of_lights() -> None:
    for number in PAPER.numbers:
        assert degrees(study().best_angle_rad(number)) == pytest.approx(29)
    assert 29 <= degrees(study().mean_best_angle_rad()) <= 37, "each object by itself, the paper says 32.2"


def test_more_than_twelve_lights_gain_little() -> None:
    means = study().map_mean_by_number()
    assert means[12] == 1
    assert 0.88 <= means[21] <= 0.97
    assert means[3] > 1.6


def test_no_object_is_best_beyond_its_first_shadow() -> None:
    steepest = [pressed(name).steepest_rad() for name in BENCHMARK_NAMES]
    best = list(study().best_angles_rad().values())
    assert all(angle <= pi / 2 - steep + radians(8) for angle, steep in zip(best, steepest, strict=True))


def test_pixels_without_light_count_as_not_found() -> None:
    hole = np.zeros((33, 33))
    hole[16, 16] = -50.0  # a shaft: no light reaches its bottom
    region = np.zeros(hole.shape, bool)
    region[16, 16] = True
    shaft = PressedObject("", hole, np.zeros((33, 33, 2)), region, 1.0)
    groups = LightGroups(numbers=(6,), angles_rad=(radians(45),), noise_grey=0)
    assert np.degrees(coarse.evaluate(shaft, groups)[0, 0, 0]) == pytest.approx(90)


def test_impossible_groups_are_refused() -> None:
    with pytest.raises(ValueError, match="at least 3"):
        LightGroups(numbers=(2, 3))
    with pytest.raises(ValueError, match="between 0 and pi / 2"):
        LightGroups(angles_rad=(0.0, atan(1)))
    with pytest.raises(ValueError, match="must be positive"):
        LightGroups(full_scale_grey=0)
    with pytest.raises(ValueError, match="were not studied"):
        study().best_angle_rad(4)
    with pytest.raises(ValueError, match="fits into the square"):
        Sampling(extent_mm=20.0)
