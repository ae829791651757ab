"""Light groups light each LED once, and the three of a colour triple stand 120 degrees apart."""

import numpy as np
import pytest

from gellight.base.errors import BoardError
from gellight.lab.core_board.light_timeline import KEPT_LIGHTS, Light, LightTimeline
from gellight.ring.light_groups import colour_triples, single_leds

RING = np.repeat(200 * np.eye(3, dtype=np.uint8), 4, axis=0)


@pytest.mark.parametrize("groups", [single_leds(RING), colour_triples(RING)], ids=["single", "triples"])
def test_the_groups_together_are_the_whole_ring(groups: np.ndarray) -> None:
    assert (groups.sum(axis=0) == RING).all()


def test_a_triple_has_three_colours_120_degrees_apart_and_other_rings_have_none() -> None:
    for group in colour_triples(RING):
        leds = np.flatnonzero(group.any(axis=1))
        assert (np.diff(leds) == 4).all()
        assert (group[leds] == 200 * np.eye(3)).all()
    with pytest.raises(ValueError, match="at least one of red, green and blue"):
        colour_triples(RING[:8])
    with pytest.raises(ValueError, match="one pure colour"):
        colour_triples(np.full((12, 3), 9, np.uint8))


@pytest.mark.parametrize("ring", ["RGB", "RRRGGGBB", "RGBBBB", "RGGRBBRGR"])
def test_unequal_colours_are_used_again_so_that_every_led_shines(ring: str) -> None:
    colours = np.array([[200 * (own == channel) for channel in "RGB"] for own in ring], np.uint8)
    groups = colour_triples(colours)
    assert len(groups) == max(map(ring.count, "RGB"))
    assert (groups.any(axis=0) == (colours > 0)).all()
    for group in groups:
        assert group.sum(axis=0).tolist() == [200, 200, 200]


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
