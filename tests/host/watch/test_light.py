"""The light of a ring by place; and of a real sensor whose LEDs nobody knows: every press is a touch, none a fault."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gellight.frames.frames import CameraFrame
from gellight.frames.image_files import read_image
from gellight.watch.light import _gain_per_mm, _irradiance
from gellight.watch.monitor import PERIOD_S, SensorWatch
from tests.helpers.linear_sensor import bundle_of
from tests.helpers.places import real

REAL = real("gelsight_mini_ball")
NOISE_GREY = 2.0
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


@pytest.mark.real_images("gelsight_mini_ball")
def test_real_presses_are_touches_and_no_faults(tmp_path: Path) -> None:
    untouched = read_image(REAL / "background.png")
    bundle = bundle_of(tmp_path / "bundle", untouched.astype(float), noise_grey=NOISE_GREY)
    watch, random, states = SensorWatch(bundle), np.random.default_rng(6000), []
    presses = [path for path in sorted(REAL.glob("*.png")) if path.name != "background.png"]
    looks = 0
    for path in presses:
        noisy = np.clip(untouched + random.normal(0, NOISE_GREY, untouched.shape), 0, 255).astype(np.uint8)
        for image in [read_image(path)] * 2 + [noisy] * 2:
            looks += 1
            frame: Any = type("Frame", (), {"camera_frame": seen(image, looks), "measures": None})
            watch.note(frame)
            states.append(watch.status()["state"])
            assert watch.findings() == []
    assert len(presses) == 33
    assert states == ["touched", "touched", "at rest", "at rest"] * 33


def seen(image: np.ndarray, number: int) -> CameraFrame:
    return CameraFrame(image=image, time_s=number * PERIOD_S, sequence=number)
