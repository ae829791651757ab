"""HOLD: one clean frame for each light, whatever the queue still had; and the smallest hold, by brute force."""

from collections import deque
from collections.abc import Iterator

import numpy as np
import pytest

from gellight.base.errors import BoardError, CameraError, InputError
from gellight.frames.camera import CameraTiming
from gellight.frames.frames import CameraFrame, LightLabel, LightState
from gellight.lab.simulator.simulated_camera import SimulatedCamera
from gellight.opening import open_camera
from gellight.ring.enumerations import Dark, SyncMode
from gellight.ring.light_groups import colour_triples, single_leds
from gellight.ring.light_ring import Step
from gellight.sensor import set_and_light
from gellight.sensor.lighting.hold import exposures
from gellight.sensor.lighting.lock import hold_frames, settle_s
from tests.helpers.scripted_camera import ScriptedCamera
from tests.helpers.scripted_ring import ScriptedRing

RING = np.zeros((12, 3), np.uint8)
for third in range(3):
    RING[4 * third : 4 * third + 4, third] = 255
TRIPLES = colour_triples(RING)
PHASES = np.linspace(0, 1, 2001)[:-1]


@pytest.fixture(scope="module")
def sensor() -> Iterator[SimulatedCamera]:
    with open_camera("sim://?programme=0&noise=0.5&fps=60") as camera:
        yield camera


def test_four_exposures_show_four_triples_and_the_light_is_given_back(sensor: SimulatedCamera) -> None:
    frames = exposures(sensor, TRIPLES)
    for index, (frame, group) in enumerate(zip(frames, TRIPLES, strict=True)):
        pure, _ = sensor._scene.show(None, group / 255)
        assert frame.label == LightLabel(state=LightState.CLEAN, group=index)
        assert np.abs(frame.image - pure).max() < 8 * 0.5 + 0.5, "every row under this light alone"
    before = sensor.ring.still.copy()
    exposures(sensor, single_leds(RING)[:2])
    np.testing.assert_array_equal(sensor.ring.still, before)
    np.testing.assert_array_equal(sensor.read().light, before)


def test_a_running_sequence_is_not_disturbed(sensor: SimulatedCamera) -> None:
    before = sensor.ring.still.copy()
    sensor.ring.load_sequence(list(TRIPLES), [Step(group=k, dwell_us=50_000) for k in range(4)])
    sensor.ring.set_sync(SyncMode.FREE)
    sensor.ring.start()
    with pytest.raises(BoardError, match="stop the sequence"):
        exposures(sensor, TRIPLES)
    sensor.ring.stop()
    sensor.ring.light(before)


# ---- a ring and a camera of which every step is known ----


class FakeRing(ScriptedRing):
    """Latches at once; the clock of the test moves 10 ms with every frame and 1 ms with every request."""

    def __init__(self, clock: "Clock") -> None:
        super().__init__()
        self.clock, self.latched_s = clock, []

    def set_leds(self, colours):
        self.clock.now += 0.001
        self.latched_s.append(self.clock.now)
        return super().set_leds(colours)

    def wait_for_light(self, light_id, timeout_s=1.0):
        self.clock.now += 0.001
        return super().wait_for_light(light_id)

    @property
    def lights(self):
        return list(zip(self.latched_s, self.shown, strict=True))


class Clock:
    now = 100.0

    def monotonic(self) -> float:
        return self.now


def queued_camera(ring: FakeRing, old: int) -> ScriptedCamera:
    """Deliver frames that are `old` frames old, each stamped with its true start, and filled with the light then."""
    queue = deque([ring.clock.now] * old)

    def picture(number: int) -> CameraFrame:
        ring.clock.now += 0.010
        queue.append(ring.clock.now)
        ring.clock.now += 0.020
        start = queue.popleft()
        lit = [colours for t, colours in ring.lights if t + 0.0025 <= start]
        mixed = any(start < t + 0.0025 < start + 0.020 for t, _ in ring.lights)
        level = 255 if mixed else (lit[-1].max() if lit else 0)
        return CameraFrame(image=np.full((4, 4, 3), level, np.uint8), time_s=start, sequence=number)

    return ScriptedCamera(picture, shape=(4, 4), url="fake://", ring=ring)


LEVELS = [np.full((12, 3), level, np.uint8) for level in (10, 20, 30)]


@pytest.fixture
def fake(monkeypatch: pytest.MonkeyPatch) -> FakeRing:
    clock = Clock()
    monkeypatch.setattr(set_and_light, "time", clock)
    return FakeRing(clock)


@pytest.mark.parametrize("old", [0, 1, 4, 20])
def test_frames_that_were_queued_are_told_by_their_stamps_not_counted(fake: FakeRing, old: int) -> None:
    frames = exposures(queued_camera(fake, old), LEVELS)
    assert [int(frame.image[0, 0, 0]) for frame in frames] == [10, 20, 30]


def test_a_camera_whose_stamps_never_pass_the_light_is_named(fake: FakeRing) -> None:
    with pytest.raises(CameraError, match=r"fake://.*stamps"):
        exposures(queued_camera(fake, 10_000), LEVELS)


def test_a_light_that_went_out_under_the_frame_is_taken_again(fake: FakeRing) -> None:
    fake.lost.extend([False, True, True, False])
    (frame,) = exposures(queued_camera(fake, 0), LEVELS[:1])
    assert frame.label.group == 0
    fake.lost.extend([False, True, True, True])
    with pytest.raises(BoardError, match="another program"):
        exposures(queued_camera(fake, 0), LEVELS[:1])


def test_leds_darkened_for_safety_give_no_frame(fake: FakeRing) -> None:
    fake.dark = Dark.HOST_SILENT
    with pytest.raises(BoardError, match="did not stay on"):
        exposures(queued_camera(fake, 0), LEVELS[:1])


def test_a_light_that_heat_dims_is_refused_and_the_ring_goes_dark(fake: FakeRing) -> None:
    fake.scale //= 2
    fake.dimmed = 1
    with pytest.raises(BoardError, match="dims its LEDs to 1/2"):
        exposures(queued_camera(fake, 0), LEVELS)
    assert fake.still is None


@pytest.mark.parametrize(
    "wrong", [{"exposure_s": 0.04}, {"exposure_s": 0.0}, {"readout_s": -1e-3}, {"pulse_period_s": -1.0}]
)
def test_times_that_no_camera_has_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(InputError):
        CameraTiming(**wrong)


def clean_frames(timing: CameraTiming, frames: int) -> np.ndarray:
    """Count, for each phase, the frames between the settling of a light and the end of its hold, `frames` periods.

    The phase is when the first frame after the settling begins, in periods.
    """
    begins = (PHASES[:, None] + np.arange(frames + 1)) * timing.period_s + settle_s(timing)
    return np.asarray((begins + timing.duration_s <= frames * timing.period_s + 1e-12).sum(axis=1))


def test_a_hold_is_the_smallest_that_gives_every_light_a_clean_frame() -> None:
    rng = np.random.default_rng(0)
    for _ in range(300):
        timing = CameraTiming(
            period_s=(period := 1 / rng.uniform(10, 240)),
            exposure_s=rng.uniform(0.01, 1) * period,
            readout_s=rng.uniform(0, 1) * period,
            stamp_error_s=rng.choice([0.0, 1e-3]),
            pulse_period_s=rng.choice([5e-4, 2.5e-3]),
        )
        frames = hold_frames(timing)
        assert clean_frames(timing, frames).max() >= 1
        assert clean_frames(timing, frames - 1).max() == 0
    timing = CameraTiming(readout_s=0.020, exposure_s=0.008)
    assert hold_frames(timing) == 1
    assert hold_frames(timing, clock_error_s=0.001) == 2
