"""The ring from its light: place, height, tilt and beam of the LEDs without being told."""

from dataclasses import replace
from math import radians

import numpy as np
import pytest

from gellight.calibration.lights.ring_fit import coarse_points, fit_ring, flat_light
from gellight.reconstruction.photometric.light_model import LightModel
from gellight.reconstruction.photometric.ring_geometry import RingGeometry
from sim_reference.imaging import led_irradiance
from sim_reference.surface import untouched
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


def test_the_middle_of_the_ring_moves_all_leds() -> None:
    moved = replace(RING, centre_x_mm=1.5, centre_y_mm=-0.5).positions_mm() - RING.positions_mm()
    np.testing.assert_allclose(moved, np.tile([1.5, -0.5, 0.0], (12, 1)), atol=1e-12)
