"""No mixed frame is ever called clean: labels against the truth, in worlds that are drawn at random."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from gellight.base.errors import BoardError, InputError
from gellight.frames.camera import CameraTiming, timing_of
from gellight.frames.frames import LightLabel, LightState
from gellight.ring import protocol
from gellight.ring.enumerations import SyncMode
from gellight.ring.light_groups import colour_triples
from gellight.ring.light_ring import Ping, Step
from gellight.sensor.lighting.label import RowExposures, label_of
from gellight.sensor.lighting.light_watch import LightWatch
from gellight.sensor.lighting.timeline import OTHER, UNTOLD, KnownLight
from tests.helpers.clock_bounds import board_us
from tests.helpers.light_world import NO_STATUS, compare
from tests.helpers.virtual_sensor import RING, virtual_sensor

Counts = dict[tuple[str, str], int]


def total(counts: Counts, truth: str) -> int:
    return sum(count for (what, _), count in counts.items() if what == truth)


@pytest.mark.parametrize("worlds", [140, pytest.param(560, marks=pytest.mark.nightly)])
def test_of_ten_thousand_mixed_frames_none_is_called_clean_and_no_group_is_wrong(worlds: int) -> None:
    """Any phase, exposure, readout, jitter, drops, PWM phase, clock, hold; lost events, torn lights, stalled clocks."""
    counts = compare(worlds, seed=11)
    assert total(counts, "mixed") >= 17 * worlds, "10,000 in the whole run"
    assert total(counts, "clean") > 8.9 * worlds
    assert total(counts, "dark") > 0
    for wrong in (("mixed", "clean"), ("clean", "wrong group"), ("clean", "mixed"), ("dark", "clean")):
        assert counts.get(wrong, 0) == 0


def test_a_camera_as_it_is_used_gets_most_of_its_clean_frames_even_before_the_lock() -> None:
    counts = compare(60, seed=12, typical=True)
    assert counts["clean", "clean"] > 0.82 * total(counts, "clean")
    assert counts.get(("mixed", "clean"), 0) == 0


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
    ("lights", "pulse_us", "state", "group"),
    [
        ([(-10, 200, 2)], 10, LightState.CLEAN, 2),
        ([(-10, 115, 2), (115, 200, 2)], 10, LightState.UNKNOWN, None),
        ([(-10, 112, 2), (5, 200, 2)], 10, LightState.CLEAN, 2),
        ([(5, 200, 2)], 10, LightState.UNKNOWN, None),
        ([(-10, 60, 2), (61, 200, 3)], 10, LightState.MIXED, None),
        ([(-10, 60, 2), (61, 200, 3)], 70, LightState.UNKNOWN, None),
        ([(-10, 102, 2), (18, 200, 3)], 1000, LightState.MIXED, None),
        ([(-10, 200, OTHER)], 10, LightState.UNKNOWN, None),
        ([(-10, 60, OTHER), (61, 200, 1)], 10, LightState.MIXED, None),
        ([(-10, 60, 2), (61, 200, UNTOLD)], 10, LightState.UNKNOWN, None),
        ([], 10, LightState.UNKNOWN, None),
    ],
)
def test_rows_sum_up_to_a_frame(
    lights: list[tuple[float, float, int]], pulse_us: float, state: LightState, group: int | None
) -> None:
    """Three rows: from 0, 10 and 20 us on for 100 us each."""
    begin = np.array([0.0, 10.0, 20.0])
    columns = np.array(lights or np.empty((0, 3))).T
    known: Any = SimpleNamespace(between=lambda *_: columns)
    exposed = RowExposures(begin, begin, begin + 100, begin + 100)
    assert label_of(exposed, known, pulse_us) == LightLabel(state=state, group=group)


# ---- on boards that really run: on virtual time, and on the clock of this computer ----


TRIPLES = colour_triples(RING)
TIMING = CameraTiming(pulse_period_s=0.0005)


def test_the_clock_of_the_emulated_board_is_known_to_the_length_of_a_ping(monkeypatch: pytest.MonkeyPatch) -> None:
    """A ping bounds the clock by its length, both ticks and both slips; until the next the drift widens the bounds."""
    camera = virtual_sensor(monkeypatch)
    pings: list[Ping] = []
    camera.ring.ping_listeners.append(pings.append)
    watch = LightWatch(camera.ring, TIMING)

    def width_us(ping: Ping) -> float:
        return (ping.host_received_s - ping.host_sent_s) * 1e6 * (1 + 2 * 200e-6) + 2 * 1.0

    for _ in range(25):
        camera.board.run(200_000)
        now_s, truth_us = camera.clock.monotonic(), camera.board.now_us - camera.board.timer_began_us
        low_us, high_us = board_us(watch.clock, now_s)
        assert low_us <= truth_us <= high_us
        drift = watch.clock.drift.high - watch.clock.drift.low
        assert high_us - low_us <= width_us(pings[-1]) + drift * (now_s - pings[-1].host_sent_s) * 1e6
        camera.ring.clock()
    first, last = min(pings[:5], key=width_us), min(pings[-3:], key=width_us)
    apart_us = (last.host_sent_s - first.host_received_s) * 1e6
    assert watch.clock.drift.low <= camera.clock.drift <= watch.clock.drift.high
    assert watch.clock.drift.error <= (width_us(first) + width_us(last)) / 2 / apart_us + 2e-6
    assert watch.clock.drift.error < 100e-6
    camera.close()


def test_every_light_of_a_fast_sequence_is_heard_of_with_its_time(monkeypatch: pytest.MonkeyPatch) -> None:
    camera = virtual_sensor(monkeypatch)
    watch = LightWatch(camera.ring, TIMING)
    camera.ring.load_sequence(list(TRIPLES), [Step(group=k, dwell_us=5000) for k in range(4)])
    camera.ring.set_sync(SyncMode.FREE)
    camera.ring.start()
    camera.board.run(60_000)
    camera.ring.status()
    changes = watch.changes()
    latched_us = [camera.board.timeline[i].time_us for i in range(len(camera.board.timeline))]
    assert len(changes) >= 9
    assert [change.new for change in changes[1:]] == [(change.old + 1) % 4 for change in changes[1:]]
    for change in changes:
        low_us, high_us = (camera.clock.board_us(when) for when in change.latched_s)
        assert any(low_us - 30 <= when <= high_us for when in latched_us)
    assert watch.light.lost == 0
    camera.close()


def test_the_exposure_of_the_timing_is_the_one_the_camera_tells() -> None:
    controls = SimpleNamespace(names=lambda: ("exposure_us",), read=lambda name: 5000.0)
    assert timing_of(SimpleNamespace(controls=controls, timing=None)).exposure_s == pytest.approx(0.005)
    assert timing_of(SimpleNamespace(controls=None, timing=None)) == CameraTiming()
    known = CameraTiming(readout_s=0.02)
    assert timing_of(SimpleNamespace(controls=controls, timing=known)) == replace(known, exposure_s=0.005)
    controls.read = lambda name: 50_000.0
    with pytest.raises(InputError, match="exposure of 50 ms is longer than the frame period of 33"):
        timing_of(SimpleNamespace(controls=controls, timing=None))


def test_a_ring_that_does_not_answer_keeps_no_listener() -> None:
    def clock() -> None:
        raise BoardError("the board did not answer CLOCK")

    ring = SimpleNamespace(event_listeners=[], ping_listeners=[], clock=clock)
    with pytest.raises(BoardError):
        LightWatch(ring, CameraTiming())
    assert not ring.event_listeners
    assert not ring.ping_listeners
