"""Labels on boards that really run: on virtual time, and on the clock of this computer."""

from dataclasses import replace
from types import SimpleNamespace

import pytest

from gellight.base.errors import BoardError, InputError
from gellight.frames.camera import CameraTiming, timing_of
from gellight.ring.enumerations import SyncMode
from gellight.ring.light_groups import colour_triples
from gellight.ring.light_ring import Ping, Step
from gellight.sensor.lighting.light_watch import LightWatch
from tests.helpers.clock_bounds import board_us
from tests.helpers.virtual_sensor import RING, virtual_sensor

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
