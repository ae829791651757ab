"""Pixels, beams, and geometry that cannot be."""

import numpy as np
import pytest

from sim_reference.geometry import SensorGeometry, pixel_grid


def test_pixels_are_counted_from_the_image_centre() -> None:
    x, y = pixel_grid(SensorGeometry(image_width_px=4, image_height_px=3, pixel_size_mm=0.5))
    assert x.ravel() == pytest.approx([-0.75, -0.25, 0.25, 0.75])
    assert y.ravel() == pytest.approx([-0.5, 0, 0.5])


def test_a_beam_of_120_degrees_is_lambertian_and_a_wider_one_flatter() -> None:
    assert SensorGeometry().emission_exponent == pytest.approx(1)
    assert SensorGeometry(beam_angle_rad=np.radians(160)).emission_exponent == pytest.approx(0.396, abs=1e-3)


@pytest.mark.parametrize(
    "wrong",
    [
        {"mounting_height_mm": 40.0},
        {"mounting_height_mm": float("nan")},
        {"led_colours": "RGX"},
        {"led_colours": "RG"},
        {"pixel_size_mm": 0.0},
        {"gel_thickness_mm": float("nan")},
        {"poisson_ratio": 0.5},
        {"camera_height_mm": float("nan")},
        {"coating_smoothing_mm": float("nan")},
        {"incident_angle_rad": np.pi / 2},
        {"beam_angle_rad": np.pi},
    ],
)
def test_geometry_that_cannot_be_built_is_refused(wrong: dict) -> None:
    with pytest.raises(ValueError, match=next(iter(wrong)).replace("mounting_", "mounting.")):
        SensorGeometry(**wrong)
