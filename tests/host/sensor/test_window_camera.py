"""The sliding window: which frames it holds, when it begins anew, how its results are numbered; and on the firmware."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from gellight.base.errors import CameraError
from gellight.frames.camera import CameraTiming, ReconnectingError
from gellight.frames.frames import CameraFrame, LightLabel, LightState
from gellight.ring.light_groups import colour_triples
from gellight.sensor import series_camera
from gellight.sensor.lighting.sequenced import LightMode, SequencedCamera
from gellight.sensor.series_camera import SeriesCamera
from tests.helpers.scripted_camera import ScriptedCamera, ScriptedControls
from tests.helpers.simulated_gel import GROUPS
from tests.helpers.virtual_sensor import RING, virtual_sensor

TRIPLES = GROUPS["triples"]


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
    inner, triples = virtual_sensor(monkeypatch, strobe=mode is LightMode.EXT), colour_triples(RING)
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
