"""The timeline of light: what was shown when, of the last lights only."""

import numpy as np
import pytest

from gellight.base.errors import BoardError
from gellight.lab.core_board.light_timeline import KEPT_LIGHTS, Light, LightTimeline


def light(number: int) -> Light:
    return Light(2000.0 * number, np.full((12, 3), number % 251 + 1, np.uint8))


def test_a_board_that_runs_for_days_remembers_its_last_lights_only() -> None:
    timeline, count = LightTimeline(), 5 * KEPT_LIGHTS + 7
    for number in range(count):
        timeline.append(light(number))
    assert len(timeline._lights) < 2 * KEPT_LIGHTS
    assert len(timeline) == count, "lights keep their numbers"
    oldest = count - KEPT_LIGHTS
    for number in (oldest, count - 1, -1):
        assert timeline[number].time_us == light(number % count).time_us
    assert (timeline.at(2000.0 * oldest + 1) == light(oldest).colours).all()
    assert len(timeline.interval(2000.0 * oldest + 1, 2000.0 * (count - 1) + 1)) == KEPT_LIGHTS
    with pytest.raises(IndexError, match="light 0 of"):
        timeline[0]
    with pytest.raises(BoardError, match=r"showed at 0\.002 s is forgotten"):
        timeline.at(2000.0)


def test_before_the_first_light_it_is_dark() -> None:
    timeline = LightTimeline()
    timeline.append(light(3))
    assert not timeline.at(0.0).any()
    assert [shown.time_us for shown in timeline.interval(0.0, 1e4)] == [0.0, 6000.0]
    with pytest.raises(IndexError):
        timeline[1]
