"""The fine stage: equations 6 to 8, the near field, and light that is bent by the window."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from math import degrees, radians

import numpy as np
import pytest

from sim_reference import refraction
from sim_reference.geometry import SensorGeometry, pixel_grid
from sim_reference.imaging import led_irradiance
from sim_reference.metrics import maximum_elevation
from sim_reference.optimizer import ball, design, fine, near_field
from sim_reference.optimizer.benchmark import Sampling, plane, press_benchmark, region
from sim_reference.surface import untouched

GEOMETRY = replace(SensorGeometry(), ring_radius_mm=22.0)
SMALL = Sampling(size_px=96, region_diameter_mm=30.0)
STEEP = ("TSTEP", "BALLCAVE")


@cache
def place() -> design.Place:
    inside, x, y = region(SMALL, GEOMETRY)
    few = inside.copy()
    few[inside] = np.arange(len(x)) % 4 == 0
    pressed = [press_benchmark(name, SMALL, GEOMETRY) for name in STEEP]
    return design.Place([near_field.scene(one, few) for one in pressed], x[::4], y[::4])


@cache
def heights() -> list[fine.Illumination]:
    return [fine.illumination(fine.at_height(GEOMETRY, height), fine.View()) for height in fine.HEIGHTS_MM]


def test_the_plane_at_20_mm_is_as_even_as_the_papers() -> None:
    light = next(light for light in heights() if light.mounting_height_mm == 20)
    assert light.variation == pytest.approx(0.013, abs=0.001)
    assert np.array(light.within_sigmas) == pytest.approx([0.6405, 0.9617, 0.9990], abs=0.05)


def test_a_saturation_that_is_never_reached_has_no_height() -> None:
    assert np.isnan(fine.height_of_saturation(np.array([0.0, 4.0]), np.array([0.2, 0.3])))
    assert np.isnan(fine.height_of_saturation(np.array([0.0, 4.0]), np.array([0.51, 0.6]))), "it was reached before"
    assert fine.height_of_saturation(np.array([0.0, 4.0]), np.array([0.4, 0.6])) == pytest.approx(2)
    assert fine.height_of_saturation(np.array([0.0, 4.0]), np.array([0.5, 0.6])) == 0


def test_the_near_field_is_that_of_the_simulated_sensor() -> None:
    square = SMALL.on(GEOMETRY)
    x, y = (axis.ravel() for axis in np.broadcast_arrays(*pixel_grid(square)))
    ring = near_field.ring_light_vectors(square, x, y)
    for led in (0, 4, 7):
        assert ring.vectors[led, :, 2] == pytest.approx(led_irradiance(untouched(square), square, led).ravel())


def test_rays_obey_snell_and_arrive_where_they_should() -> None:
    medium = refraction.Medium(refractive_index=1.41, thickness_mm=8.0)
    distance = np.array([0.5, 5.0, 22.0, 40.0])
    rays = refraction.trace(distance, 20.0, medium)
    assert np.sin(np.arctan(rays.leaving_tan)) == pytest.approx(1.41 * np.sin(rays.arriving_rad), abs=1e-12)
    assert 12 * rays.leaving_tan + 8 * rays.arriving_tan == pytest.approx(distance, abs=1e-9)


def test_light_straight_on_loses_what_fresnel_says() -> None:
    glass, straight = refraction.Medium(refractive_index=1.5, thickness_mm=8.0), np.array(0.0)
    assert 1 - refraction.transmittance(straight, straight, glass) == pytest.approx(0.04)
    assert refraction.window_of(replace(GEOMETRY, gel_thickness_mm=3.0)).thickness_mm == 6.0, "gel and acrylic"


def test_a_ball_of_4_mm_pressed_by_2_mm_records_60_degrees() -> None:
    assert degrees(maximum_elevation(4.0, 2.0)) == pytest.approx(60, abs=1e-9)
    choice = ball.choose_ball(np.arange(2.0, 8.5, 0.5), GEOMETRY)
    assert choice.radius_mm == 4.0


def test_slopes_lie_in_shadow_beyond_what_the_near_and_bent_light_reaches_not_beyond_the_tilt() -> None:
    # An LED 21.5 mm beside and 20 mm above the middle: atan(21.5 / 20), whatever its tilt of 29 degrees is.
    air = ball.arrival_angle(SensorGeometry(), refraction.VACUUM)
    assert degrees(air) == pytest.approx(47.07, abs=0.005)
    bent = ball.arrival_angle(SensorGeometry(), refraction.window_of(SensorGeometry()))
    # Snell at the window's face, 12 mm below the LED and 8 mm above the coating.
    outside = np.arcsin(1.41 * np.sin(bent))
    assert 12 * np.tan(outside) + 8 * np.tan(bent) == pytest.approx(21.5)
    choice = ball.choose_ball(np.array([4.0]), SensorGeometry())
    assert degrees(choice.shadow_free_rad) == pytest.approx(90 - degrees(bent)) == pytest.approx(55.4, abs=0.05)


def test_the_elevation_table_leaves_out_presses_deeper_than_the_ball() -> None:
    table = np.degrees(ball.elevation_table(np.array([1.0, 2.5, 8.0]), np.array([1.0, 2.0])))
    assert table[1:, 1] == pytest.approx([78.46, 41.41], abs=0.01)
    assert table[0, 0] == pytest.approx(90)
    assert np.isnan(table[0, 1])


IN_THE_WINDOW = fine.at_height(GEOMETRY, 33.0), np.zeros(1), np.zeros(1), refraction.window_of(GEOMETRY)
NO_ROOM = replace(GEOMETRY, camera_height_mm=9.0, mounting_height_mm=0.0)
NO_LIGHT = replace(GEOMETRY, beam_angle_rad=radians(0.001))
TWELVE = design.Requirements(numbers=(12,))


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: ball.choose_ball(np.array([6.0, 8.0]), GEOMETRY, press_depth_mm=2.0), "records"),
        (lambda: ball.choose_ball(np.array([4.0]), GEOMETRY, press_depth_mm=5.0), "thickness"),
        (lambda: ball.choose_ball(np.array([4.0]), GEOMETRY, press_depth_mm=0.0), "records"),
        (lambda: near_field.ring_light_vectors(*IN_THE_WINDOW), "inside the window"),
        (lambda: fine.at_height(GEOMETRY, 40.0), "in or below the gel"),
        (lambda: design.optimise(NO_ROOM, place(), TWELVE), "no room for the LEDs"),
        (lambda: design.assessed(NO_LIGHT, place(), TWELVE, 230.0), "no LED lights the gel"),
        (lambda: design.Requirements(numbers=(4,)), "multiples of 3"),
        (lambda: design.Requirements(figure="rms"), "choose one of"),
        (lambda: design.Requirements(one_shot=True), "dropped"),
    ],
)  # fmt: skip
def test_what_cannot_be_built_is_refused(call: Callable[[], object], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        call()


@pytest.mark.parametrize("one_shot", [False, True])
def test_noise_on_a_plane_is_what_the_closed_form_says(one_shot: bool) -> None:
    requirements = design.Requirements(one_shot=one_shot, drop_shadows=False)
    _, x, y = region(SMALL, GEOMETRY)
    inside, _, _ = region(SMALL, GEOMETRY)
    flat = design.Place([near_field.scene(plane(SMALL, GEOMETRY), inside)], x, y)
    low = fine.at_height(GEOMETRY, 4.0)
    measured = design.errors(low, flat, requirements, 230.0)[0]
    assert measured == pytest.approx(design.assessed(low, flat, requirements, 230.0).noise_mae_rad, rel=0.05)


def test_the_design_is_better_than_the_start_and_no_worse_than_its_neighbours() -> None:
    start = design.errors(GEOMETRY, place(), TWELVE, 200.0)[2]
    (found,) = design.optimise(GEOMETRY, place(), TWELVE)
    assert found.top1_rad < 0.8 * start
    assert found.converged
    built = replace(GEOMETRY, incident_angle_rad=found.incident_angle_rad, mounting_height_mm=found.mounting_height_mm)
    for change in (-radians(12), radians(12)):
        turned = replace(built, incident_angle_rad=min(found.incident_angle_rad + change, radians(89)))
        assert design.errors(turned, place(), TWELVE, found.brightest_grey)[2] > 0.99 * found.top1_rad


def test_a_search_that_broke_off_is_no_best_design(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(design, "MOST_EVALUATIONS", 6)
    (found,) = design.optimise(GEOMETRY, place(), TWELVE)
    assert not found.converged
    assert f"NOT the best: the search broke off after {found.evaluations} tries" in design.describe(found)
    assert "NOT" not in design.describe(replace(found, converged=True))


def test_little_light_asks_for_leds_nearer_to_the_gel() -> None:
    plenty, little = (
        design.optimise(GEOMETRY, place(), design.Requirements(numbers=(12,), exposure_limit=limit))[0]
        for limit in (float("inf"), 0.5)
    )
    assert little.mounting_height_mm > plenty.mounting_height_mm
    assert little.top1_rad > plenty.top1_rad


def test_a_ring_of_as_many_leds_keeps_its_colours() -> None:
    mixed = replace(GEOMETRY, led_colours="RGBRGBRGBRGB")
    assert design.colours_of(12, mixed) == "RGBRGBRGBRGB"
    assert design.colours_of(6, mixed) == "RRGGBB"


def test_the_fewest_leds_that_are_nearly_best_are_chosen() -> None:
    one = design.Candidate(6, 0.5, 10.0, 200.0, 0.0, 0.0, 0.0105, 0.0, 1)
    candidates = [replace(one, number=3, top1_rad=0.02), one, replace(one, number=12, top1_rad=0.01)]
    assert design.chosen(candidates, "top1").number == 6


def test_equation_3_as_printed_knows_no_distance() -> None:
    # Without 1/d^2 the light of an LED is its beam and Lambert's cosine: in the middle cos(beam)^m cos(incidence).
    sensor, heights = SensorGeometry(), (4.0, 20.0, 32.0)
    view = fine.View(diameter_mm=0.5, falloff=False)
    light = [fine.illumination(fine.at_height(sensor, height), view) for height in heights]
    above = 40 - np.array(heights)
    distance = np.hypot(21.5, above)
    along_axis = (21.5 * np.sin(np.radians(29)) + above * np.cos(np.radians(29))) / distance
    expected = along_axis**sensor.emission_exponent * above / distance
    assert [one.mean / light[0].mean for one in light] == pytest.approx((expected / expected[0]).tolist(), rel=2e-3)
