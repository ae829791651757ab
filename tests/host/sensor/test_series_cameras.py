"""Cameras that drive the ring: order of the lights, sequence numbers, exposure, rest; without a board or a clock."""

import time
from dataclasses import dataclass, field, replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from gellight.base.errors import BoardError, BundleError, CameraError
from gellight.base.settings import ReconstructionSettings
from gellight.daemon.modes import LONGEST_US, bright_exposure_us, frame_path, tactile_camera
from gellight.frames.camera import Camera
from gellight.frames.frames import CameraFrame
from gellight.frames.series import ExposureSeries
from gellight.reconstruction.photometric.light_model import LightGroups
from gellight.ring import protocol
from gellight.ring.enumerations import Dark, State
from gellight.sensor import series_cameras
from gellight.sensor.series_cameras import RestingCamera, SeriesCamera
from tests.helpers.simulated_gel import GROUPS, RING, Gel

TRIPLES = GROUPS[LightGroups.TRIPLES]


@dataclass
class FakeRing:
    """Lights at once; `dies_after` more lights it is dark."""

    still: np.ndarray | None = None
    light_id: int = 0
    shown: list[np.ndarray] = field(default_factory=list)
    goes_out: bool = False

    def set_leds(self, colours: np.ndarray) -> Any:
        self.still = np.array(colours)
        self.light_id += 1
        self.shown.append(self.still)
        return SimpleNamespace(light_id=self.light_id, scale=protocol.FULL_SCALE)

    def wait_for_light(self, light_id: int, timeout_s: float = 1.0) -> None:
        assert light_id == self.light_id

    def blank(self) -> None:
        self.still = None

    def status(self) -> Any:
        return SimpleNamespace(state=State.STILL, dark=Dark.NOT_DARK, light_id=self.light_id)


class FakeControls:
    def __init__(self) -> None:
        self.exposure_us = 8000.0
        self.was_set: list[float] = []

    def names(self) -> tuple[str, ...]:
        return ("exposure_us",)

    def range(self, name: str) -> tuple[float, float, float]:
        return 100.0, 40000.0, 100.0

    def read(self, name: str) -> float:
        return self.exposure_us

    def set(self, name: str, value: float) -> float:
        self.exposure_us = value
        self.was_set.append(value)
        return value


class FakeCamera(Camera):
    """Frames without waiting; each shows the colour of the first lit LED and, if asked, a touch."""

    url = "fake"
    image_shape = (32, 48)
    stage = None

    def __init__(self, *, ring: bool = True, controls: bool = True) -> None:
        self.ring = FakeRing(np.array(RING.colours)) if ring else None  # type: ignore[assignment]
        self.controls = FakeControls() if controls else None
        self.sequence = 0
        self.touched = 0
        self.closed = False

    def selfcheck(self, pixel_size_mm: tuple[float, float]) -> None:
        return None

    def read(self) -> CameraFrame:
        self.sequence += 1
        image = np.full((*self.image_shape, 3), 50, np.uint8)
        image[:, :24] += np.uint8(self.touched)
        return CameraFrame(image=image, time_s=time.monotonic() + 1, sequence=self.sequence, source=self.url)

    def close(self) -> None:
        self.closed = True


def resting(camera: FakeCamera, **changes: Any) -> RestingCamera:
    options: dict[str, Any] = {"exposure_us": 24000.0, "frames": 1, "noise_grey": 1.0}
    untouched = np.full((*camera.image_shape, 3), 50, np.float32)
    return RestingCamera(camera, TRIPLES, untouched=untouched, **{**options, **changes})


def until_series(camera: RestingCamera, limit: int = 40) -> tuple[list[CameraFrame], ExposureSeries]:
    frames = []
    for _ in range(limit):
        frame = camera.read()
        if isinstance(frame, ExposureSeries):
            return frames, frame
        frames.append(frame)
    raise AssertionError(f"no series in {limit} frames")


@pytest.mark.parametrize("kind", LightGroups)
@pytest.mark.parametrize("frames", [1, 3])
def test_a_series_has_every_light_once_and_the_first_again(kind: LightGroups, frames: int) -> None:
    camera, groups = FakeCamera(), GROUPS[kind]
    assert isinstance(camera.ring, FakeRing)
    with SeriesCamera(camera, groups, exposure_us=None, frames=frames) as series_camera:
        series = series_camera.read()
        shown = camera.ring.shown
        assert [light.tolist() for light in shown] == [*groups.tolist(), groups[0].tolist()]
        assert [len(taken) for taken in series.frames] == [frames] * len(groups)
        assert [taken[0].label.group for taken in series.frames if taken[0].label] == list(range(len(groups)))
        assert series.opening.sequence < series.closing.sequence
    assert camera.closed


@pytest.mark.parametrize("frames", [1, 3])
def test_the_repetition_of_one_series_opens_the_next_and_no_frame_counts_as_lost(frames: int) -> None:
    with SeriesCamera(FakeCamera(), TRIPLES, exposure_us=None, frames=frames) as camera:
        one, two, three = (camera.read() for _ in range(3))
    assert (two.opening.time_s == one.closing.time_s) == (frames == 1), "averaged frames are all taken anew"
    assert [series.sequence for series in (one, two, three)] == [1, 2, 3]


def test_the_exposure_is_raised_before_the_first_series() -> None:
    inner = FakeCamera()
    assert isinstance(inner.controls, FakeControls)
    with SeriesCamera(inner, TRIPLES, exposure_us=24000.0, frames=1) as camera:
        assert camera.read().exposure_us == 24000.0
        assert camera.read().exposure_us == 24000.0
    assert inner.controls.was_set == [24000.0]


def test_a_light_that_goes_out_while_frames_are_averaged_is_taken_again_and_then_reported(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(series_cameras, "still_lit", lambda ring, light_id: False)
    with (
        SeriesCamera(FakeCamera(), TRIPLES, exposure_us=None, frames=2) as camera,
        pytest.raises(BoardError, match="did not stay on for 2 frames"),
    ):
        camera.read()


def test_without_a_ring_the_remedy_is_told() -> None:
    with pytest.raises(CameraError, match=r"fake has no light ring.*--mode network"):
        SeriesCamera(FakeCamera(ring=False), TRIPLES, exposure_us=None, frames=1)


def test_a_series_is_taken_when_a_touched_scene_rests_and_the_stream_goes_on_after_it() -> None:
    inner = FakeCamera()
    assert isinstance(inner.ring, FakeRing)
    assert isinstance(inner.controls, FakeControls)
    inner.touched = 40
    with resting(inner) as camera:
        before, series = until_series(camera)
        assert inner.ring.still is not None
        assert inner.ring.still.tolist() == RING.colours.tolist(), "the ring is whole again"
        after = camera.read()
    assert [frame.sequence for frame in before] == list(range(1, len(before) + 1))
    assert (series.sequence, after.sequence) == (len(before) + 1, len(before) + 2)
    assert series.opening.image.shape == series.closing.image.shape
    assert inner.controls.was_set == [24000.0, 8000.0]
    assert series.exposure_us == 24000.0


def test_no_series_is_taken_of_an_untouched_gel_or_of_one_that_moves(monkeypatch: pytest.MonkeyPatch) -> None:
    with resting(FakeCamera()) as camera:
        assert not any(isinstance(camera.read(), ExposureSeries) for _ in range(60))
    inner = FakeCamera()
    with resting(inner) as camera:
        for step in range(60):
            inner.touched = 20 + 3 * (step // 5)
            assert not isinstance(camera.read(), ExposureSeries)


def test_series_do_not_follow_on_each_other(monkeypatch: pytest.MonkeyPatch) -> None:
    inner = FakeCamera()
    inner.touched = 40
    with resting(inner) as camera:
        until_series(camera)
        assert not any(isinstance(camera.read(), ExposureSeries) for _ in range(60))
        camera._due_s = 0.0
        until_series(camera)


def test_the_exposure_is_as_bright_as_the_camera_can_show_and_no_longer_than_a_frame() -> None:
    model = replace(Gel(noise_grey=0).model(1), brightest_grey=75.0)
    assert bright_exposure_us(FakeCamera(), model) == 24000.0
    assert bright_exposure_us(FakeCamera(), replace(model, brightest_grey=10.0)) == LONGEST_US
    assert bright_exposure_us(FakeCamera(controls=False), model) is None
    assert bright_exposure_us(FakeCamera(), replace(model, exposure_us=None)) is None


def test_network_mode_leaves_camera_and_path_alone_and_the_others_need_the_lights() -> None:
    inner, network = FakeCamera(), SimpleNamespace()
    bundle: Any = SimpleNamespace(files={}, source="bundle")
    settings = ReconstructionSettings()
    assert frame_path(bundle, settings, network) is network  # type: ignore[arg-type]
    assert tactile_camera(inner, bundle, settings) is inner
    with pytest.raises(BundleError, match=r"bundle has no lights.json.*gellight calibrate lights"):
        frame_path(bundle, ReconstructionSettings(mode="hybrid"), network)  # type: ignore[arg-type]
    with pytest.raises(BundleError, match=r"bundle has no lights.json.*gellight calibrate lights"):
        tactile_camera(inner, bundle, ReconstructionSettings(mode="photometric"))
