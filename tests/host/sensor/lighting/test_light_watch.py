"""Labels on boards that really run: on virtual time, and in a process of its own on a machine that is busy."""

import os
import signal
import threading
import time
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from gellight.base.errors import InputError
from gellight.frames.camera import timing_of
from gellight.frames.frames import LightState
from gellight.frames.timing import CameraTiming
from gellight.opening import open_camera
from gellight.ring.emulator.child import SimulatedBoard
from gellight.ring.enumerations import SyncMode
from gellight.ring.light_groups import colour_triples
from gellight.ring.light_ring import Step
from gellight.sensor.lighting.light_watch import LightWatch
from gellight.sensor.lighting.sequenced import SequencedCamera
from tests.helpers.virtual_sensor import RING, virtual_sensor

TRIPLES = colour_triples(RING)
TIMING = CameraTiming(pulse_period_s=0.0005)


def test_the_clock_of_the_emulated_board_is_known_to_the_length_of_a_ping(monkeypatch: pytest.MonkeyPatch) -> None:
    camera = virtual_sensor(monkeypatch)
    watch = LightWatch(camera.ring, TIMING)
    for _ in range(25):
        camera.board.run(200_000)
        now_s, truth_us = camera.clock.monotonic(), camera.board.now_us
        low_us, high_us = watch.clock.board_us(now_s)
        assert low_us <= truth_us <= high_us
        assert high_us - low_us < 300
        camera.ring.clock()
    assert watch.clock.drift.low <= camera.clock.drift <= watch.clock.drift.high
    assert watch.clock.drift.error < 45e-6  # a ping of 0.2 ms over 5 s, and what crystals wander
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


def disturb(board: SimulatedBoard, stop: threading.Event) -> None:
    """Let the board's process stand still for 40 ms now and then, as a busy machine does."""
    while not stop.wait(0.23):
        os.kill(board._process.pid, signal.SIGSTOP)
        time.sleep(0.04)
        os.kill(board._process.pid, signal.SIGCONT)


@pytest.mark.parametrize("stands_still", [False, True])
def test_on_the_simulated_sensor_no_clean_label_is_wrong_even_if_the_board_stands_still(stands_still: bool) -> None:
    """Wall time, so nothing is said of how many frames are clean; but those that are show one light alone."""
    with open_camera("sim://?programme=0&noise=0.5") as camera:
        stop = threading.Event()
        busy = threading.Thread(target=disturb, args=(camera.ring.transport, stop))
        pure = [camera._scene.show(None, group / 255)[0] for group in TRIPLES]
        with SequencedCamera(camera, TRIPLES, timing=TIMING, frames=3) as sequenced:
            if stands_still:
                busy.start()
            try:
                frames = [sequenced.read() for _ in range(30)]
            finally:
                stop.set()
                if stands_still:
                    busy.join()
    for frame in (frame for frame in frames if frame.label.state == LightState.CLEAN):
        assert np.abs(frame.image - pure[frame.label.group]).max() < 6


def test_the_exposure_of_the_timing_is_the_one_the_camera_tells() -> None:
    controls = SimpleNamespace(names=lambda: ("exposure_us",), read=lambda name: 5000.0)
    assert timing_of(SimpleNamespace(controls=controls, timing=None)).exposure_s == pytest.approx(0.005)
    assert timing_of(SimpleNamespace(controls=None, timing=None)) == CameraTiming()
    known = CameraTiming(readout_s=0.02)
    assert timing_of(SimpleNamespace(controls=controls, timing=known)) == replace(known, exposure_s=0.005)
    controls.read = lambda name: 50_000.0
    with pytest.raises(InputError, match="exposure of 50 ms is longer than the frame period of 33"):
        timing_of(SimpleNamespace(controls=controls, timing=None))
