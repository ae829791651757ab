"""Pulsed light under a rolling shutter, against averages and brute force; the strobe on an emulated board's trigger."""

import numpy as np
import pytest

from gellight.frames.camera import Camera
from gellight.frames.camera_wrapper import CameraWrapper
from gellight.frames.frames import CameraFrame, LightState
from gellight.lab.core_board.light_timeline import Light
from gellight.lab.simulator.shutter import Shutter, row_weights
from gellight.opening import open_camera
from gellight.sensor.lighting.sequenced import LightMode, SequencedCamera
from tests.helpers.virtual_sensor import RING

SHUTTER = Shutter(exposure_us=8000.0, readout_us=12000.0, pulse_period_us=500.0)
PHASES = np.random.default_rng(0).random(12) * 500.0
ROWS = 40
GROUPS = [np.roll(RING, 4 * turn, axis=0) for turn in range(3)]
CHANGES, MOST_FRAMES = 12, 300


def colours(value: int) -> np.ndarray:
    return np.full((12, 3), value, np.uint8)


@pytest.mark.parametrize("latched_us", [(0.0,), (0.0, 1e6 + 10_000.0)], ids=["once", "again"])
@pytest.mark.parametrize("value", [0, 1, 77, 255])
def test_steady_light_over_whole_pulses_is_its_duty_in_every_row(value: int, latched_us: tuple[float, ...]) -> None:
    weights = row_weights([Light(time_us, colours(value)) for time_us in latched_us], 1e6, ROWS, PHASES, SHUTTER)
    assert weights.shape == (ROWS, 12, 3)
    assert weights == pytest.approx(value / 255, abs=1e-9)


def test_an_exposure_that_is_no_whole_number_of_pulses_makes_bands() -> None:
    odd = Shutter(exposure_us=8250.0, readout_us=12000.0, pulse_period_us=500.0)
    weights = row_weights([Light(0.0, colours(100))], 1e6, ROWS, PHASES, odd)
    assert np.ptp(weights[:, 0, 0]) > 0.005
    assert weights.mean() == pytest.approx(100 / 255, rel=0.02)


def test_a_new_colour_waits_for_the_next_pulse_of_its_own_led() -> None:
    start = 1e6
    change = start - 100.0
    lights = [Light(0.0, colours(255)), Light(change, colours(0))]
    first_row = row_weights(lights, start, ROWS, PHASES, SHUTTER)[0, :, 0] * SHUTTER.exposure_us
    left_of_cycle = (PHASES - change) % 500.0 - 100.0
    assert first_row == pytest.approx(np.maximum(left_of_cycle, 0.0), abs=1e-6)


def test_it_agrees_with_brute_force() -> None:
    rng = np.random.default_rng(3)
    start = 5e5
    lights = [Light(0.0, rng.integers(0, 256, (12, 3)).astype(np.uint8))]
    lights += [Light(start + t, rng.integers(0, 256, (12, 3)).astype(np.uint8)) for t in (-300.0, 4321.0, 9000.0)]
    weights = row_weights(lights, start, 5, PHASES, SHUTTER)
    step = 0.5
    for row in range(5):
        begin = start + SHUTTER.readout_us * row / 4
        times = begin + step / 2 + step * np.arange(int(SHUTTER.exposure_us / step))
        for led in (0, 5, 11):
            cycle = PHASES[led] + np.floor((times - PHASES[led]) / 500.0) * 500.0
            latched = np.searchsorted([light.time_us for light in lights], cycle, side="right") - 1
            duty = np.array([lights[i].colours[led] for i in latched]) / 255.0
            on = (times - cycle)[:, None] < duty * 500.0
            assert weights[row, led] == pytest.approx(on.mean(axis=0), abs=0.002)


class Watched(CameraWrapper):
    """Keeps what the board had latched when the frame began."""

    def __init__(self, camera: Camera) -> None:
        super().__init__(camera)
        self.latched = np.zeros((12, 3), np.uint8)

    def read(self) -> CameraFrame:
        frame = self._camera.read()
        self.latched = frame.light
        return frame


def test_each_strobe_moves_the_light_on_and_every_sure_frame_is_of_the_light_it_says() -> None:
    """How many frames are sure depends on the computer: a command takes the emulator 2 to 20 ms, busy or slow."""
    camera = Watched(open_camera("sim://?strobe=1&fps=10&programme=0"))
    shown: list[int] = []
    with SequencedCamera(camera, GROUPS, mode=LightMode.EXT) as sequenced:
        for _ in range(MOST_FRAMES):
            label = sequenced.read().label
            assert label.state is not LightState.MIXED
            on = [group for group, colours in enumerate(GROUPS) if np.array_equal(camera.latched, colours)]
            shown += [group for group in on if group not in shown[-1:]]
            if label.state is LightState.CLEAN:
                assert [label.group] == on
            if len(shown) >= CHANGES:
                break
    assert shown == [(shown[0] + number) % 3 for number in range(CHANGES)]
