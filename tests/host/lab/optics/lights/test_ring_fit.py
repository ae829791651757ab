"""The ring from its light: place, height, tilt and beam of the LEDs without being told."""

import json
from dataclasses import replace
from math import radians
from pathlib import Path

import numpy as np
import pytest

from gellight.bundle.bundle import load_bundle
from gellight.lab.optics.lights.ring_fit import coarse_points, fit_ring, flat_light
from gellight.photometric.light_model import LightModel
from gellight.photometric.lights_file import read_lights
from gellight.photometric.ring_geometry import RingGeometry
from sim_reference.imaging import led_irradiance
from sim_reference.surface import untouched
from tests.helpers.command_line import invoke
from tests.helpers.simulated_gel import PIXEL_MM, RING, SMALL, Gel

WRONG = replace(RING, ring_radius_mm=22.8, mounting_height_mm=18.6, incident_angle_rad=radians(20.0), centre_x_mm=0.5)


@pytest.fixture(scope="module")
def model() -> LightModel:
    return Gel(seed=8).model(16)


def test_light_on_flat_gel_is_that_of_the_reference_simulator() -> None:
    flat = untouched(SMALL)
    found = flat_light(*coarse_points(SMALL.image_shape, PIXEL_MM), RING)
    for led in (0, 5):
        true = led_irradiance(flat, SMALL, led)[::16, ::16].ravel()
        np.testing.assert_allclose(found[led] / found[led, 0], true / true[0], rtol=1e-9)


@pytest.mark.parametrize("start", [RING, WRONG])
def test_the_ring_is_found_from_noisy_pictures_wherever_one_begins(model: LightModel, start: RingGeometry) -> None:
    fit = fit_ring(replace(model, ring=start), PIXEL_MM)
    assert fit.ring.ring_radius_mm == pytest.approx(21.5, abs=0.15)
    assert fit.ring.height_mm == pytest.approx(20.0, abs=0.15)
    assert fit.ring.incident_angle_rad == pytest.approx(radians(29.0), abs=radians(1.5))
    assert (fit.ring.centre_x_mm, fit.ring.centre_y_mm) == pytest.approx((0.0, 0.0), abs=0.05)
    assert fit.misfit < 0.01
    assert fit.as_json()["ring_radius_mm"] == pytest.approx(21.5, abs=0.15)


def test_the_ring_is_found_through_the_window_that_bends_its_light() -> None:
    behind, ring = replace(SMALL, window=True), replace(RING, window_mm=SMALL.window_mm)
    flat = untouched(behind)
    x, y = coarse_points(SMALL.image_shape, PIXEL_MM)
    true = np.stack([led_irradiance(flat, behind, led)[::16, ::16].ravel() for led in range(12)])
    found = flat_light(x, y, ring)
    np.testing.assert_allclose(found / found[:, :1], true / true[:, :1], rtol=1e-9)


def test_the_middle_of_the_ring_moves_all_leds() -> None:
    moved = replace(RING, centre_x_mm=1.5, centre_y_mm=-0.5).positions_mm() - RING.positions_mm()
    np.testing.assert_allclose(moved, np.tile([1.5, -0.5, 0.0], (12, 1)), atol=1e-12)


def test_the_verb_finds_the_ring_of_the_simulated_sensor_and_its_bundle_has_the_lights(tmp_path: Path) -> None:
    url = "sim://?object=BALL&fps=1000"  # what is pressed is lifted off meanwhile
    # four frames a light: the noise of one frame moves the height by about 0.1 mm
    done = invoke("calibrate", "lights", "--out", tmp_path / "lit", "--sensor", url, "--frames", "4", "--json")
    assert done.exit_code == 0, done.output
    found = json.loads(done.stdout)
    assert (found["leds"], found["exposure_us"]) == (12, 8000)
    ring = found["ring_from_light"]
    assert ring["ring_radius_mm"] == pytest.approx(21.5, abs=0.1)
    assert ring["height_mm"] == pytest.approx(20, abs=0.1)
    assert len(read_lights(load_bundle(tmp_path / "lit")).colours) == 12
