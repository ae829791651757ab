"""Frames per second count distinct sequence numbers; lost, repeated and dropped frames are told apart."""

from dataclasses import replace

import numpy as np
import pytest

from gellight.daemon.statistics import Statistics
from gellight.frames.frames import CameraFrame, TactileFrame
from tests.helpers.tactile import tactile

PIXEL = np.zeros((1, 1, 3), np.uint8)


def camera_frame(sequence: int, time_s: float = 0.0) -> CameraFrame:
    return CameraFrame(image=PIXEL, time_s=time_s, sequence=sequence)


def tactile_frame(sequence: int, time_s: float = 0.0) -> TactileFrame:
    flat = tactile(np.zeros((1, 1)))
    return replace(flat, camera_frame=camera_frame(sequence, time_s), stage_seconds={"gelnet": 0.004})


def test_the_rate_counts_distinct_numbers_and_falls_to_zero_when_frames_stop() -> None:
    once, twice = Statistics(), Statistics()
    for tick in range(31):  # 30 deliveries a second, of the second each camera frame came twice
        once.note_delivered(tactile_frame(tick), tick / 30)
        twice.note_delivered(tactile_frame(tick // 2), tick / 30)
    assert [statistics.fps(now_s=1.0) for statistics in (once, twice)] == pytest.approx([30.0, 15.0])
    assert once.fps(now_s=3.9) == pytest.approx(30.0)
    assert once.fps(now_s=4.1) == 0.0, "over three seconds"


def test_lost_repeated_and_dropped_are_told_apart_and_the_age_counts_from_the_exposure() -> None:
    statistics = Statistics()
    for sequence in (1, 2, 2, 5):
        statistics.note_captured(camera_frame(sequence))
    statistics.note_delivered(tactile_frame(5), 1.0)
    numbers = statistics.as_json(1.0)
    assert (numbers["lost"], numbers["repeated"], numbers["dropped"], numbers["frames"]) == (2, 1, 3, 1)
    statistics = Statistics()
    for tick in range(100):
        statistics.note_delivered(tactile_frame(tick, time_s=tick), tick + 0.020)
    assert statistics.frame_age_ms() == {"median": 20.0, "p95": 20.0}
    assert statistics.as_json(100.0)["stage_ms"] == {"gelnet": 4.0}
