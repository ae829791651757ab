"""What makes one simulated sensor differ from another: its controls, its LEDs, its colour filters, its probe."""

import numpy as np
import pytest

from gellight.base.errors import CameraError, InputError
from gellight.frames.camera import Camera
from gellight.lab.simulator.shutter import ReadNoise
from gellight.lab.simulator.simulated_url import SimulatedUrl
from gellight.opening import open_camera
from gellight.reconstruction.fine_pattern import FinePattern
from sim_reference.camera import CameraResponse, digitise

GEOMETRY = {"image_width_px": 64, "image_height_px": 48, "pixel_size_mm": 0.588}
PLAIN = "sim://?board=0&programme=0&fps=1000&noise=0"


def camera(more: str = "") -> Camera:
    return open_camera(PLAIN + more, geometry=GEOMETRY)


def mean(sensor: Camera) -> np.ndarray:
    return np.asarray(sensor.read().image.mean(axis=(0, 1)))


def test_the_picture_is_proportional_to_the_exposure() -> None:
    with camera() as sensor:
        before = mean(sensor)
        assert sensor.controls.set("exposure_us", 4000) == 4000
        assert mean(sensor) == pytest.approx(before / 2, rel=0.01)


def test_gain_brightens_and_white_balance_moves_red_against_blue() -> None:
    with camera() as sensor:
        before = mean(sensor)
        sensor.controls.set("gain", 1.2)
        assert mean(sensor) == pytest.approx(1.2 * before, rel=0.02)
        sensor.controls.set("gain", 1.0)
        sensor.controls.set("white_balance_k", 6000)
        red, green, blue = mean(sensor) / before
        assert red > 1.1 > green > 0.99
        assert blue == pytest.approx(1 / red, rel=0.02)


def test_controls_at_their_defaults_leave_the_picture_as_it_was() -> None:
    with camera() as sensor:
        before = sensor.read().image
        for name in sensor.controls.names():
            sensor.controls.set(name, sensor.controls.read(name))
        assert np.array_equal(sensor.read().image, before)


def test_a_value_out_of_range_and_an_unknown_control_are_refused() -> None:
    with camera() as sensor:
        with pytest.raises(InputError, match=r"gain = 99: choose 1 to 8"):
            sensor.controls.set("gain", 99)
        with pytest.raises(CameraError, match="no control 'focus'"):
            sensor.controls.read("focus")


def test_dimmed_leds_darken_the_picture_in_proportion() -> None:
    with camera() as bright, camera("&dim=0.1") as dim:
        assert mean(dim) == pytest.approx(0.9 * mean(bright), rel=0.01)


def test_leds_and_crosstalk_are_as_the_url_asks_and_the_same_each_time() -> None:
    assert SimulatedUrl().response() == CameraResponse()
    assert np.array_equal(SimulatedUrl().led_gain(12), np.ones(12))
    gains = np.concatenate([SimulatedUrl(led_spread=0.05, seed=seed).led_gain(12) for seed in range(40)])
    assert gains.std() == pytest.approx(0.05, rel=0.1)
    assert np.array_equal(SimulatedUrl(led_spread=0.05).led_gain(12), SimulatedUrl(led_spread=0.05).led_gain(12))

    rows = np.array(SimulatedUrl(crosstalk=0.2).response().crosstalk)
    assert rows.sum(axis=1) == pytest.approx(1)
    assert 1 - rows[0, 0] == pytest.approx(0.2)


def test_the_cylinder_presses_a_flat_round_end() -> None:
    with camera() as sensor:
        sensor.stage.press("CYLINDER", 0.5, 0.0, 0.0)
        truth = sensor.read().truth
        area_mm2 = truth.contact.sum() * 0.588**2
        assert area_mm2 == pytest.approx(np.pi * 16, rel=0.06)
        flat = truth.depth_mm[truth.contact & (np.hypot(*np.indices((48, 64)) - [[[23.5]], [[31.5]]]) < 4)]
        assert np.ptp(flat) < 0.01
        assert "CYLINDER" not in sensor.stage.objects


GREY = np.random.default_rng(3).uniform(60, 180, (120, 160, 3)).astype(np.float32)


@pytest.mark.parametrize("noise_grey", [0.0, 1.0, 3.0])
def test_pictures_have_the_mean_and_the_noise_of_the_reference(noise_grey: float) -> None:
    noise, rng = ReadNoise(np.random.default_rng(1)), np.random.default_rng(2)
    ours = np.stack([noise.digitise(GREY, noise_grey) for _ in range(100)]).astype(float)
    theirs = np.stack([digitise(GREY, noise_grey, rng) for _ in range(100)]).astype(float)
    assert ours.mean() == pytest.approx(theirs.mean(), abs=0.01)
    assert ours.std(axis=0).mean() == pytest.approx(theirs.std(axis=0).mean(), rel=0.01, abs=1e-9)
    averaged = np.abs(ours.mean(axis=0) - GREY).mean()
    assert averaged == pytest.approx(np.abs(theirs.mean(axis=0) - GREY).mean(), rel=0.03)


def test_noise_is_independent_from_pixel_to_pixel_and_from_frame_to_frame() -> None:
    noise = ReadNoise(np.random.default_rng(1))
    first, second = ((noise.digitise(GREY, 5.0) - GREY).ravel() for _ in range(2))
    assert abs(np.corrcoef(first, second)[0, 1]) < 0.02
    assert abs(np.corrcoef(first[:-1], first[1:])[0, 1]) < 0.02


def test_no_frame_repeats_the_noise_of_another_shifted() -> None:
    """By the best match within 20 pixels a bundle of another unit is found out (`reconstruction.fine_pattern`)."""
    grey, noise = np.full((240, 320, 3), 120, np.float32), ReadNoise(np.random.default_rng(1))
    first = FinePattern(noise.digitise(grey, 5.0))
    assert max(first.match(noise.digitise(grey, 5.0)) for _ in range(60)) < 8


def test_what_is_out_of_range_is_clipped() -> None:
    noise = ReadNoise(np.random.default_rng(1))
    assert set(np.unique(noise.digitise(np.full((40, 40, 3), 400, np.float32), 1.0))) == {255}
    assert set(np.unique(noise.digitise(np.full((40, 40, 3), -40, np.float32), 1.0))) == {0}
