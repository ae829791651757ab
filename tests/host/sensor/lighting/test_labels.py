"""No mixed frame is ever called clean: labels against the truth, in worlds that are drawn at random."""

from dataclasses import replace

import numpy as np
import pytest

from gellight.frames.frames import LightLabel, LightState
from gellight.ring import protocol
from gellight.sensor.lighting.light_watch import MIXED, UNKNOWN, label_of
from gellight.sensor.lighting.timeline import OTHER, UNTOLD, KnownLight
from tests.helpers.light_world import NO_STATUS, World, compare

Counts = dict[tuple[str, str], int]


@pytest.fixture(scope="module", params=[140, pytest.param(560, marks=pytest.mark.nightly)])
def anything(request: pytest.FixtureRequest) -> Counts:
    """Any phase, exposure, readout, jitter, drops, PWM phase, clock, hold; lost events, torn lights, stalled clocks."""
    counts = compare(request.param, seed=11)
    assert total(counts, "mixed") >= 17 * request.param, "10,000 in the whole run"
    assert total(counts, "clean") > 8.9 * request.param
    return counts


def total(counts: Counts, truth: str) -> int:
    return sum(count for (what, _), count in counts.items() if what == truth)


def test_of_ten_thousand_mixed_frames_none_is_called_clean(anything: Counts) -> None:
    assert anything.get(("mixed", "clean"), 0) == 0


def test_no_clean_frame_gets_the_wrong_group_or_is_called_mixed(anything: Counts) -> None:
    assert anything.get(("clean", "wrong group"), 0) == 0
    assert anything.get(("clean", "mixed"), 0) == 0


def test_frames_in_the_dark_have_no_group(anything: Counts) -> None:
    assert total(anything, "dark") > 0
    assert anything.get(("dark", "clean"), 0) == 0


def test_a_camera_as_it_is_used_gets_most_of_its_clean_frames_even_before_the_lock() -> None:
    counts = compare(60, seed=12, typical=True)
    assert counts["clean", "clean"] > 0.82 * total(counts, "clean")
    assert counts.get(("mixed", "clean"), 0) == 0


def test_the_proof_would_fail_if_the_pulses_were_forgotten(monkeypatch: pytest.MonkeyPatch) -> None:
    """The truth is sharp enough to see a single pulse: without the settle time it finds mixed frames called clean."""
    draw = World._draw_camera

    def forgetful(world: World) -> None:
        draw(world)
        object.__setattr__(world.timing, "pulse_period_s", 0.0)

    monkeypatch.setattr(World, "_draw_camera", forgetful)
    assert compare(150, seed=11).get(("mixed", "clean"), 0) > 0


def test_a_light_that_is_later_than_the_earliest_of_its_kind_may_be_a_repetition() -> None:
    """The light before it was late, too: judged by that one alone it would be on time."""
    known = KnownLight(pulse_period_us=500.0, plan=lambda last, event: 10_000.0)
    for number, late_us in enumerate((0, 0, 0, 0, 0, 800, 800)):
        first_us = 10_000 * number + late_us
        known.note_event(protocol.LightEvent(first_us, first_us + 660, number + 1, 0, 0, 0, 0, number % 2))
    _, until, group = known.between(30_500.0, 70_000.0)
    assert group.tolist() == [1, 0, 1, 0]
    assert until[0] == 40_000.0, "a light on time counts from its first bit"
    assert until[1] <= 50_000.0, "what was on the LEDs before the repetition is unknown from the plan on"
    assert until[2] <= 60_000.0


def test_a_lost_event_makes_the_light_unknown_until_the_next() -> None:
    known = KnownLight(pulse_period_us=500.0)
    for light_id, first_us, group in ((1, 10_000, 0), (3, 50_000, 0)):
        known.note_event(protocol.LightEvent(first_us, first_us + 660, light_id, 0, 0, 0, 0, group))
        known.note_status(replace(NO_STATUS, time_us=first_us + 20_000, light_id=light_id))
    assert known.lost == 1
    sure, until, group = known.between(0.0, 100_000.0)
    assert group.tolist() == [0, UNTOLD, 0]
    assert until[0] <= 30_000.0
    assert sure[2] == 51_160.0


def test_an_answer_older_than_the_last_event_that_came_with_it_tells_nothing() -> None:
    known = KnownLight(pulse_period_us=500.0)
    for light_id, first_us, group in ((1, 10_000, 0), (2, 40_000, 1)):
        known.note_event(protocol.LightEvent(first_us, first_us + 660, light_id, 0, 0, 0, 0, group))
    known.note_status(replace(NO_STATUS, time_us=40_600, light_id=1))
    assert known.lost == 0
    assert known.confirmed_us == 40_660.0
    known.note_status(replace(NO_STATUS, time_us=60_000, light_id=2))
    assert known.confirmed_us > 57_000.0
    known.note_status(replace(NO_STATUS, time_us=70_000, light_id=3))
    assert known.lost == 1, "a newer light, of which no event came"


@pytest.mark.parametrize(
    ("rows", "seen", "state", "group"),
    [
        ([2, 2, 2], {2}, LightState.CLEAN, 2),
        ([2, 2, UNKNOWN], {2}, LightState.UNKNOWN, None),
        ([2, MIXED, 3], {2, 3}, LightState.MIXED, None),
        ([2, UNKNOWN, 3], set(), LightState.MIXED, None),
        ([UNKNOWN, UNKNOWN], {2, 3}, LightState.MIXED, None),
        ([OTHER, OTHER], {OTHER}, LightState.UNKNOWN, None),
        ([OTHER, 1], set(), LightState.MIXED, None),
    ],
)
def test_rows_sum_up_to_a_frame(rows: list[int], seen: set[int], state: LightState, group: int | None) -> None:
    assert label_of(np.array(rows), seen) == LightLabel(state=state, group=group)
