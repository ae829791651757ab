"""The light of a ring, by place: an LED lights most what lies below it."""

import numpy as np
import pytest

from gellight.watch.light import _gain_per_mm, _irradiance

SHAPE = np.array([20.0, 8.0, 3.0])
"""radius and height of the ring, mm, and exponent of the beam"""
Y_MM, X_MM = np.meshgrid(np.arange(-25.0, 25.5, 0.5), np.arange(-25.0, 25.5, 0.5), indexing="ij")


@pytest.mark.parametrize(("led", "below"), [(0, (20, 0)), (3, (0, -20)), (6, (-20, 0)), (9, (0, 20))])
def test_an_led_lights_most_what_lies_below_it(led: int, below: tuple[float, float]) -> None:
    light = _irradiance(SHAPE, X_MM, Y_MM, led)
    brightest = np.unravel_index(light.argmax(), light.shape)
    assert (X_MM[brightest], Y_MM[brightest]) == below
    assert light.max() == pytest.approx(1)


def test_the_gain_of_a_lower_ring_is_the_derivative() -> None:
    step_mm = 1e-3

    def light_at(height_mm: float) -> np.ndarray:
        return np.log(_irradiance(np.array([20.0, height_mm, 3.0]), X_MM, Y_MM, 4) / height_mm**2)

    slope = (light_at(8 - step_mm) - light_at(8 + step_mm)) / (2 * step_mm)
    np.testing.assert_allclose(_gain_per_mm(SHAPE, X_MM, Y_MM, 4), slope, atol=1e-5)
