"""Labels on boards that really run: on virtual time, and on the clock of this computer."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from gellight.base.errors import BoardError, InputError
from gellight.frames.camera import CameraTiming, timing_of
from gellight.frames.frames import LightLabel, LightState
from gellight.opening import open_camera
from gellight.ring.enumerations import SyncMode
from gellight.ring.light_groups import colour_triples
from gellight.ring.light_ring import Ping, Step
from gellight.sensor.lighting import light_watch
from gellight.sensor.lighting.clock import ClockMap, Interval
from gellight.sensor.lighting.light_watch import LightWatch, label_frame
from gellight.sensor.lighting.sequenced import SequencedCamera
from gellight.sensor.lighting.timeline import KnownLight
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


NOISE_GREY = 0.5
ROW_PX = 640
ROW_ERROR_GREY = 7 * np.hypot(NOISE_GREY, np.sqrt(1 / 12)) / np.sqrt(ROW_PX)
"""the mean of a row is off by its pixels' noise and rounding, 0.58 grey / sqrt(640); 7 standard deviations of that are
exceeded once in 1e11 rows"""


def test_on_the_simulated_sensor_no_clean_label_is_wrong(monkeypatch: pytest.MonkeyPatch) -> None:
    """Wall time, so nothing is said of how many frames are clean; but those that are show one light alone."""
    bounds: dict[float, Interval] = {}

    def label(clock: ClockMap, light: KnownLight, timing: CameraTiming, time_s: float, rows: int) -> LightLabel:
        if clock.covers(*timing.span_s(time_s)):
            bounds[time_s] = clock.offset_us(*timing.span_s(time_s))
        return label_frame(clock, light, timing, time_s, rows)

    monkeypatch.setattr(light_watch, "label_frame", label)
    with open_camera(f"sim://?programme=0&noise={NOISE_GREY}") as camera:
        board = camera.ring.transport
        pure = [camera._scene.show(None, group / 255)[0].mean(axis=1) for group in TRIPLES]
        with SequencedCamera(camera, TRIPLES, timing=TIMING, frames=3) as sequenced:
            frames = [sequenced.read() for _ in range(30)]
            offsets_us = {frame.time_s: board.virtual_us(frame.time_s) - frame.time_s * 1e6 for frame in frames}
    for frame in (frame for frame in frames if frame.label.state == LightState.CLEAN):
        low_us, high_us = bounds[frame.time_s]
        assert low_us <= offsets_us[frame.time_s] <= high_us
        assert np.abs(frame.image.mean(axis=1) - pure[frame.label.group]).max() < ROW_ERROR_GREY


def test_a_row_that_saw_one_pulse_of_another_light_is_seen_as_mixed() -> None:
    """The limit above is sharp: what it lets pass is less than the smallest mixture there can be."""
    with open_camera("sim://?programme=0&board=0") as camera:
        one, other = (camera._scene.show(None, group / 255)[0].mean(axis=1) for group in TRIPLES[:2])
    share = 500 / 8000
    assert (np.abs(share * (other - one)).max(axis=1) > ROW_ERROR_GREY).mean() > 0.9, "of the rows"


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
