"""Cameras that drive the ring: order of the lights, numbers, exposure, rest; series in turn, and windows that slide."""

import threading
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gellight.base.errors import BoardError, BundleError, CameraError, ConfigError
from gellight.base.settings import LightingSettings, ReconstructionSettings, Settings
from gellight.bundle.bundle import Bundle, load_bundle
from gellight.daemon import switched_camera
from gellight.daemon.configuration import PathKind, mode_config
from gellight.daemon.switched_camera import bright_exposure_us, camera_for
from gellight.frames.camera import CameraTiming, ReconnectingError, timing_of
from gellight.frames.frames import CameraFrame, LightLabel, LightState
from gellight.photometric.light_model import LightGroups
from gellight.ring.light_groups import colour_triples
from gellight.sensor import series_camera
from gellight.sensor.lighting.lock import hold_frames
from gellight.sensor.lighting.sequenced import LightMode, SequencedCamera, clock_error_s
from gellight.sensor.series_camera import SeriesCamera
from tests.helpers.linear_sensor import linear_bundle
from tests.helpers.scripted_camera import ScriptedCamera, ScriptedControls
from tests.helpers.scripted_ring import ScriptedRing
from tests.helpers.simulated_gel import GROUPS, RING, Gel
from tests.helpers.virtual_sensor import RING as VIRTUAL_RING
from tests.helpers.virtual_sensor import virtual_sensor

TRIPLES = GROUPS[LightGroups.TRIPLES]


def fake_camera(**options: Any) -> ScriptedCamera:
    """Frames without waiting."""
    parts = {"ring": ScriptedRing(np.array(RING.colours)), "controls": ScriptedControls()}
    return ScriptedCamera(shape=(32, 48), ahead_s=1, url="fake", **{**parts, **options})


def held(
    camera: ScriptedCamera, groups: np.ndarray = TRIPLES, *, frames: int = 1, exposure_us: float | None = None
) -> SeriesCamera:
    """Series of a camera whose light stops at each group."""
    sequenced = SequencedCamera(camera, groups, mode=LightMode.HOLD, frames=frames)
    return SeriesCamera(sequenced, groups, exposure_us=exposure_us)


@pytest.mark.parametrize("kind", LightGroups)
@pytest.mark.parametrize("frames", [1, 3])
def test_a_series_has_every_light_once_and_the_first_again(kind: LightGroups, frames: int) -> None:
    camera, groups = fake_camera(), GROUPS[kind]
    with held(camera, groups, frames=frames) as series_camera:
        series = series_camera.read()
        shown = camera.ring.shown
        assert [light.tolist() for light in shown] == [*groups.tolist(), groups[0].tolist()]
        assert [len(taken) for taken in series.frames] == [frames] * len(groups)
        assert [taken[0].label.group for taken in series.frames if taken[0].label] == list(range(len(groups)))
        assert series.opening.sequence < series.closing.sequence
    assert camera.closed


@pytest.mark.parametrize("frames", [1, 3])
def test_the_repetition_of_one_series_opens_the_next_and_no_frame_counts_as_lost(frames: int) -> None:
    with held(fake_camera(), frames=frames) as camera:
        one, two, three = (camera.read() for _ in range(3))
    assert two.opening.time_s == one.closing.time_s
    assert [series.sequence for series in (one, two, three)] == [1, 2, 3]


def test_the_exposure_is_raised_before_the_first_series_and_stays_when_other_settings_are_adopted() -> None:
    camera = fake_camera()
    with camera_for(camera, in_mode("photometric").light) as series:
        raised_us = series.read().exposure_us
        series.adopt({"exposure_us": 8000.0}, np.array(RING.colours))
        assert series.read().exposure_us == raised_us == camera.controls.read("exposure_us") > 8000


def test_a_light_that_goes_out_while_frames_are_averaged_is_taken_again_and_then_reported() -> None:
    camera = fake_camera()
    with held(camera, frames=2) as series:
        camera.ring.lost.extend([True, False])
        assert len(series.read().frames[0]) == 2
        assert [light.tolist() for light in camera.ring.shown[:2]] == [TRIPLES[0].tolist()] * 2
        camera.ring.lost.extend([True] * 3)
        with pytest.raises(BoardError, match="did not stay on in 3 attempts"):
            series.read()


def test_a_sensor_that_is_unplugged_is_looked_for_and_its_series_go_on_with_the_new_ring() -> None:
    camera = fake_camera()
    with held(camera, exposure_us=24000.0) as series:
        series.read()
        read = camera.read

        def away() -> CameraFrame:
            camera.ring = camera.controls = None
            raise ReconnectingError("it was unplugged")

        camera.read = away  # type: ignore[method-assign]
        for _ in range(3):
            with pytest.raises(ReconnectingError):
                series.read()
        camera.ring, camera.controls, camera.read = ScriptedRing(), ScriptedControls(), read  # type: ignore[method-assign]
        assert series.read().exposure_us == 24000.0
        assert [light.tolist() for light in camera.ring.shown] == [*TRIPLES.tolist(), TRIPLES[0].tolist()]


def test_a_ring_that_failed_is_told_unless_another_one_is_there_already() -> None:
    camera = fake_camera()
    with held(camera) as series:
        camera.ring.failures.reset("light")
        with pytest.raises(BoardError, match="light failed"):
            series.read()
        read = camera.read

        def back() -> CameraFrame:
            camera.ring = ScriptedRing()
            return read()

        camera.read = back  # type: ignore[method-assign]
        with pytest.raises(ReconnectingError, match=r"was unplugged and is back: light failed"):
            series.read()
        camera.read = read  # type: ignore[method-assign]
        assert series.read().sequence == 1


def test_settings_are_adopted_between_two_series_of_a_camera_that_takes_one_after_the_other() -> None:
    camera = fake_camera()
    with held(camera) as series:
        stop = threading.Event()

        def take() -> None:
            while not stop.is_set():
                series.read()

        reader = threading.Thread(target=take)
        reader.start()
        try:
            begun_s = time.monotonic()
            for level in range(20):
                series.adopt({}, np.full((12, 3), level, np.uint8))
            assert time.monotonic() - begun_s < 5, "it need not wait for a pause of the reader"
        finally:
            stop.set()
            reader.join()


def test_without_a_ring_the_remedy_is_told() -> None:
    with pytest.raises(CameraError, match=r"fake has no light ring.*reconstruction.mode = network"):
        held(fake_camera(ring=None))


def test_the_exposure_is_as_bright_as_the_camera_can_show_and_no_longer_than_a_frame() -> None:
    model = replace(Gel(noise_grey=0).model(1), brightest_grey=75.0)
    assert bright_exposure_us(fake_camera(), model) == 24000.0
    assert bright_exposure_us(fake_camera(), replace(model, brightest_grey=10.0)) == 30_000.0
    assert bright_exposure_us(fake_camera(controls=None), model) is None
    assert bright_exposure_us(fake_camera(), replace(model, exposure_us=None)) is None


def in_mode(mode: Any, bundle: Bundle | None = None, **lighting: Any) -> Any:
    settings = Settings(reconstruction=ReconstructionSettings(mode=mode), lighting=LightingSettings(**lighting))
    return mode_config(bundle or load_bundle("synthetic"), settings)


def test_network_mode_leaves_the_camera_alone_and_photometric_mode_needs_the_lights(tmp_path: Path) -> None:
    inner, config = fake_camera(), in_mode("network")
    assert config.path is PathKind.NETWORK
    assert camera_for(inner, config.light) is inner
    with pytest.raises(BundleError, match=r"bundle has no lights.json.*gellight calibrate lights"):
        in_mode("photometric", linear_bundle(tmp_path / "bundle"))


@pytest.mark.parametrize(
    ("mode", "lighting", "said"),
    [
        ("network", {"light_mode": "free"}, "lighting.light_mode = free moves a sequence on"),
        ("photometric", {"sequence": "lights.json"}, "does not go with photometric mode, which takes rgb"),
    ],
)
def test_a_sequence_that_does_not_go_with_the_mode_is_refused(mode: Any, lighting: Any, said: str) -> None:
    with pytest.raises(ConfigError, match=said):
        in_mode(mode, **lighting)


def test_the_window_is_exposed_as_long_as_each_frame_can_be_of_another_light(monkeypatch: pytest.MonkeyPatch) -> None:
    inner = fake_camera()
    inner.mode = LightMode.EXT  # type: ignore[attr-defined]
    monkeypatch.setattr(switched_camera, "SequencedCamera", lambda camera, groups, **how: camera)
    camera = camera_for(inner, in_mode("photometric", light_mode="ext").light)
    assert isinstance(camera, SeriesCamera)
    timing = timing_of(inner)
    assert 8000 < inner.controls.read("exposure_us") < 16000
    assert hold_frames(timing, clock_error_s=clock_error_s(LightMode.EXT)) == 1
    longer = replace(timing, exposure_s=timing.exposure_s + 2e-4)
    assert hold_frames(longer, clock_error_s=clock_error_s(LightMode.EXT)) == 2


# ---- the sliding window: what it holds, when it begins anew, and on the firmware ----


class ScriptedSequence(ScriptedCamera):
    """Frames whose light group is a letter: A to D clean, ? unknown, ! the sensor is away."""

    mode = LightMode.FREE

    def __init__(self, script: str) -> None:
        super().__init__(self.picture, shape=(16, 16), controls=ScriptedControls())
        self.script = script

    def picture(self, number: int) -> CameraFrame:
        letter = self.script[(number - 1) % len(self.script)]
        if letter == "!":
            raise ReconnectingError("it is away")
        label = LightLabel(state=LightState.UNKNOWN)
        if letter != "?":
            label = LightLabel(state=LightState.CLEAN, group="ABCD".index(letter))
        image = np.full((*self.image_shape, 3), number, np.uint8)
        return CameraFrame(image=image, time_s=number / 30, sequence=number, label=label)

    def status(self) -> dict[str, object]:
        return {"light_sequence": "counts"}


def window(script: str, exposure_us: float | None = None) -> tuple[SeriesCamera, ScriptedSequence]:
    inner = ScriptedSequence(script)
    return SeriesCamera(inner, TRIPLES, exposure_us=exposure_us), inner


def taken(series: Any) -> tuple[int, list[int], int]:
    """Numbers of the camera's frames: the opening, those of the groups, the closing."""
    return series.opening.sequence, [frames[0].sequence for frames in series.frames], series.closing.sequence


def test_every_clean_frame_gives_a_window_of_the_newest_frame_of_every_light() -> None:
    camera, _ = window("ABCD")
    assert [taken(camera.read()) for _ in range(3)] == [
        (1, [5, 2, 3, 4], 5),
        (2, [5, 6, 3, 4], 6),
        (3, [5, 6, 7, 4], 7),
    ]
    series = camera.read()
    assert series.time_s == series.closing.time_s
    assert series.label == LightLabel(state=LightState.CLEAN, group=3)
    assert np.array_equal(series.groups, TRIPLES)
    camera, _ = window("AABBCCDD")
    assert taken(camera.read()) == (2, [9, 4, 6, 8], 9)
    assert taken(camera.read()) == (2, [10, 4, 6, 8], 10)
    assert taken(camera.read()) == (4, [10, 11, 6, 8], 11)


def test_frames_that_saw_two_lights_are_passed_over_and_give_no_window_with_an_old_one() -> None:
    camera, _ = window("A?B?C?D?")
    numbers = [camera.read().sequence for _ in range(6)]
    assert np.diff(numbers).tolist() == [1] * 5
    camera, _ = window("ABCDA?CDABCD")
    assert taken(camera.read()) == (1, [5, 2, 3, 4], 5)
    after = taken(camera.read())
    assert after[2] > 8, "frames 7 and 8 came without a new one of B since their like"
    assert min(after[1]) > after[0]


def test_after_the_sensor_was_away_and_after_other_settings_the_window_begins_anew() -> None:
    camera, inner = window("ABCDAB!CDABCDAB", exposure_us=16000.0)
    camera.read(), camera.read()
    with pytest.raises(ReconnectingError):
        camera.read()
    assert taken(camera.read())[0] == 8
    inner.script, inner.sequence = "ABCD", 100
    camera.adopt({"exposure_us": 8000.0, "gain": 2.0}, None)
    assert inner.adopted == [({"exposure_us": 16000.0, "gain": 2.0}, None)]
    assert taken(camera.read())[0] > 100


def test_a_sequence_that_gives_no_window_ends_with_a_remedy(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(series_camera, "PATIENCE_S", 0.0)
    camera, inner = window("A?C?")
    with pytest.raises(CameraError, match=r"no frame of each light within 0 s \(counts\): set lighting\.light_mode = "):
        camera.read()
    inner.mode = LightMode.EXT
    with pytest.raises(CameraError, match="strobe"):
        SeriesCamera(inner, TRIPLES, exposure_us=None).read()


@pytest.mark.parametrize(
    ("mode", "exposure_us"), [(LightMode.FREE, 8e3), (LightMode.EXT, 8e3), (LightMode.EXT, 12e3), (LightMode.EXT, 14e3)]
)
def test_on_the_firmware_a_window_comes_with_every_frame(
    monkeypatch: pytest.MonkeyPatch, mode: LightMode, exposure_us: float
) -> None:
    """Of some exposures the board is asked while it tells of the next light."""
    inner, triples = virtual_sensor(monkeypatch, strobe=mode is LightMode.EXT), colour_triples(VIRTUAL_RING)
    inner.shutter = replace(inner.shutter, exposure_us=exposure_us)
    timing = CameraTiming(exposure_s=exposure_us * 1e-6, pulse_period_s=0.0005)
    sequenced = SequencedCamera(inner, triples, mode=mode, timing=timing)
    with SeriesCamera(sequenced, triples, exposure_us=None) as camera:
        series = [camera.read() for _ in range(30)][-12:]
        steps = np.diff([each.closing.sequence for each in series])
    assert (steps == 1).mean() > 0.9, "a camera of 30 frames a second gives 30 windows a second"
    for each in series:
        spans = [frames[0].time_s - each.opening.time_s for frames in each.frames]
        assert max(spans) < 4.5 / 30
        assert [frames[0].label.group for frames in each.frames] == [0, 1, 2, 3]  # type: ignore[union-attr]
        assert replace(each.opening, image=each.image).label == each.label
