"""The watch on the simulated sensor: faults are made where they arise, named and measured; a sound one is left alone.

Thresholds were chosen on runs with seeds below 100.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gellight.base.errors import InputError
from gellight.bundle.bundle import Bundle
from gellight.frames.frames import CameraFrame, LightLabel, LightState
from gellight.frames.image_files import read_image
from gellight.lab.simulator.scene import Press, Scene
from gellight.watch.light import _gain_per_mm, _irradiance
from gellight.watch.monitor import PERIOD_S, SensorWatch
from tests.helpers.linear_sensor import bundle_of
from tests.helpers.places import real
from tests.helpers.watched_sensor import WatchedSensor, dusty, torn

SHAPE = (240, 320)
PIXEL_MM = 0.1176
New = Callable[[int], WatchedSensor]


@pytest.mark.parametrize("seed", [1000, *(pytest.param(seed, marks=pytest.mark.nightly) for seed in (1001, 1002))])
def test_nothing_is_told_of_a_sound_sensor_at_work(new_sensor: New, seed: int) -> None:
    sensor = new_sensor(seed)
    sensor.work(12)
    for name, depth in (("TSTEP", 0.5), ("SINWAVE", 0.6), ("BALL", 0.05)):
        sensor.run(1.5, Press(name, depth, 2.0, 1.0))
        sensor.work(2)
    assert sensor.watch.status()["looks"] >= 100
    assert sensor.told == []
    assert sensor.watch.status()["expected"] is None
    assert sensor.watch.refusal(asked=False) == "the zero is right"


@pytest.mark.parametrize("leds", [{1: 0.8}, {6: 0.5}, {10: 0.85}, {2: 0.5, 7: 0.7}])
def test_dimmed_leds_are_named_and_their_light_measured_while_the_sensor_works(
    new_sensor: New, leds: dict[int, float]
) -> None:
    sensor = new_sensor(1100 + sum(leds))
    sensor.work(3)
    sensor.leds = leds
    sensor.work(6)
    assert set(sensor.told) <= {"led_dimmed", "zero_off", "recalibrate"}
    found = {f.figures["led"]: f.figures["light"] for f in sensor.watch.findings() if f.kind == "led_dimmed"}
    assert found == {led: pytest.approx(light, abs=0.03 if len(leds) == 1 else 0.05) for led, light in leds.items()}


@pytest.mark.parametrize("led", [0, 3, 8])
def test_a_dead_led_is_told_from_a_dimmed_one(new_sensor: New, led: int) -> None:
    sensor = new_sensor(1200 + led)
    sensor.leds = {led: 0.0}
    sensor.work(6)
    assert set(sensor.told) == {"led_dead", "zero_off", "recalibrate"}
    assert sensor.figures("led_dead")["led"] == led


@pytest.mark.parametrize("shift_px", [(0.5, -0.7), (-2.3, 1.1)])
def test_a_camera_that_moved_is_told_to_a_tenth_of_a_pixel(new_sensor: New, shift_px: tuple[float, float]) -> None:
    sensor = new_sensor(1400)
    sensor.work(2)
    sensor.shift_px = shift_px
    sensor.work(2)
    sensor.run(3)
    assert set(sensor.told) <= {"camera_moved", "zero_off"}
    figures = sensor.figures("camera_moved")
    assert (figures["x_px"], figures["y_px"]) == pytest.approx(shift_px, abs=0.1)
    assert figures["x_mm"] == pytest.approx(shift_px[0] * PIXEL_MM, abs=0.006)


def test_a_camera_that_moved_while_the_light_fades_is_told_as_both(new_sensor: New) -> None:
    sensor = new_sensor(1450)
    sensor.shift_px, sensor.gain = (0.8, 0.4), np.full(3, 0.95)
    sensor.run(5)
    assert {"drift", "camera_moved"} <= set(sensor.told) <= {"drift", "camera_moved", "zero_off", "recalibrate"}
    assert sensor.figures("camera_moved")["x_px"] == pytest.approx(0.8, abs=0.1)
    assert sensor.figures("drift")["red"] == pytest.approx(0.95, abs=0.005)


@pytest.mark.parametrize(
    ("spot", "kind"), [(torn(SHAPE, 90, 165, seed=7), "tear"), (dusty(SHAPE, 225, 60), "dirt")], ids=["tear", "dirt"]
)
def test_a_spot_is_told_when_it_outlasts_the_touches(new_sensor: New, spot: np.ndarray, kind: str) -> None:
    sensor = new_sensor(1500)
    sensor.work(2)
    sensor.spot = spot
    sensor.work(14)
    assert sensor.told == [kind]
    rows, columns = np.nonzero(spot[..., 0] < 0.9)
    figures = sensor.figures(kind)
    assert figures["x_mm"] == pytest.approx((columns.mean() - 159.5) * PIXEL_MM, abs=0.4)
    assert figures["y_mm"] == pytest.approx((rows.mean() - 119.5) * PIXEL_MM, abs=0.4)


def test_a_crumb_that_sticks_is_told_from_a_tear(new_sensor: New, halved_scene: Scene) -> None:
    sensor = new_sensor(1550)
    crumb, clean = Press("BALL", 0.1, 9.0, 6.0), halved_scene.show(None)[0]
    dent = halved_scene.show(crumb)[0] - clean
    picture = sensor.picture
    sensor.picture = lambda press: picture(press) + dent  # type: ignore[method-assign]
    for x in np.linspace(-12, 2, 16):
        sensor.run(1.0, Press("BALL", 0.7, float(x), -5.0))
        sensor.run(0.5)
    assert sensor.told == ["stuck"]
    assert sensor.figures("stuck")["x_mm"] == pytest.approx(9.0, abs=0.4)


def test_a_gel_that_was_never_seen_at_rest_is_told_until_it_is(new_sensor: New) -> None:
    sensor = new_sensor(1650)
    frame = sensor.frame(Press("TSTEP", 0.5))
    for second in range(0, 130, 5):
        object.__setattr__(frame.camera_frame, "time_s", float(second))
        sensor.watch.note(frame)
        assert bool(sensor.watch.findings()) == (second >= 120)
    assert [finding.kind for finding in sensor.watch.findings()] == ["never_at_rest"]
    sensor.time_s = 130.0
    sensor.run(4)
    assert sensor.watch.findings() == []


def test_frames_under_another_light_and_while_it_is_paused_are_not_judged(new_sensor: New, halved: Bundle) -> None:
    sensor = new_sensor(1700)
    sensor.run(3)
    looks = sensor.watch.status()["looks"]
    sensor.leds = {0: 0.0}
    told = np.array([led.rgb for led in halved.manifest.led], np.uint8)
    told[0] = 0
    for light, label in ((told, None), (None, LightLabel(state=LightState.CLEAN, group=1))):
        for _ in range(20):
            frame = sensor.frame()
            object.__setattr__(frame.camera_frame, "light", light)
            object.__setattr__(frame.camera_frame, "label", label)
            sensor.watch.note(frame)
        assert sensor.watch.status()["state"] == "other light"
    assert sensor.watch.status()["looks"] == looks
    assert sensor.watch.findings() == []
    sensor = new_sensor(1750)
    sensor.watch.paused = True
    sensor.leds = {3: 0.0}
    sensor.run(5)
    assert (sensor.watch.status()["state"], sensor.told) == ("paused", [])
    with pytest.raises(InputError, match="not been seen at rest"):
        sensor.watch.propose_zero(asked=True)


# ---- the light of a ring by place, and of a real sensor whose LEDs nobody knows ----


REAL = real("gelsight_mini_ball")
NOISE_GREY = 2.0
BEAM = np.array([20.0, 8.0, 3.0])
"""radius and height of the ring, mm, and exponent of the beam"""
Y_MM, X_MM = np.meshgrid(np.arange(-25.0, 25.5, 0.5), np.arange(-25.0, 25.5, 0.5), indexing="ij")


@pytest.mark.parametrize(("led", "below"), [(0, (20, 0)), (3, (0, -20)), (6, (-20, 0)), (9, (0, 20))])
def test_an_led_lights_most_what_lies_below_it(led: int, below: tuple[float, float]) -> None:
    light = _irradiance(BEAM, X_MM, Y_MM, led)
    brightest = np.unravel_index(light.argmax(), light.shape)
    assert (X_MM[brightest], Y_MM[brightest]) == below
    assert light.max() == pytest.approx(1)


def test_the_gain_of_a_lower_ring_is_the_derivative() -> None:
    step_mm = 1e-3

    def light_at(height_mm: float) -> np.ndarray:
        return np.log(_irradiance(np.array([20.0, height_mm, 3.0]), X_MM, Y_MM, 4) / height_mm**2)

    slope = (light_at(8 - step_mm) - light_at(8 + step_mm)) / (2 * step_mm)
    np.testing.assert_allclose(_gain_per_mm(BEAM, X_MM, Y_MM, 4), slope, atol=1e-5)


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
            felt = {"measures": None, "exposures": None, "gradient_map": np.zeros((1, 1, 2))}
            frame: Any = type("Frame", (), {"camera_frame": seen(image, looks), **felt})
            watch.note(frame)
            states.append(watch.status()["state"])
            assert watch.findings() == []
    assert len(presses) == 33
    assert states == ["touched", "touched", "at rest", "at rest"] * 33


def seen(image: np.ndarray, number: int) -> CameraFrame:
    return CameraFrame(image=image, time_s=number * PERIOD_S, sequence=number)
