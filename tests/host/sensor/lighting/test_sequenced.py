"""Sequences on the firmware's image, seen by a rolling shutter, on virtual time: every label against the truth."""

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from gellight.base.errors import BoardError, CameraError, InputError
from gellight.frames.camera import CameraTiming, ReconnectingError
from gellight.frames.frames import CameraFrame, LightLabel, LightState
from gellight.lab.simulator.simulated_camera import open_simulated
from gellight.ring.enumerations import Dark
from gellight.ring.light_groups import colour_triples
from gellight.ring.light_ring import LightRing
from gellight.ring.transport import SilentError
from gellight.sensor.lighting.sequenced import LightMode, SequencedCamera
from tests.helpers.bench_board import VirtualTransport
from tests.helpers.virtual_sensor import RING, VirtualCamera, virtual_sensor

TRIPLES = colour_triples(RING)
TIMING = CameraTiming(pulse_period_s=0.0005)


@pytest.fixture
def camera(monkeypatch: pytest.MonkeyPatch) -> VirtualCamera:
    return virtual_sensor(monkeypatch)


@pytest.fixture
def sequenced(camera: VirtualCamera) -> SequencedCamera:
    """It runs free, and is stopped by the test that says so."""
    return SequencedCamera(camera, TRIPLES, timing=TIMING)


def follow(sequenced: SequencedCamera, camera: VirtualCamera, frames: int) -> Counter:
    """Count (truth, label) of that many frames; "right" where a clean label has the right group."""
    counts: Counter = Counter()
    for _ in range(frames):
        frame = sequenced.read()
        truth = camera.truth(TRIPLES)
        said = "right" if frame.label == truth and truth.state == LightState.CLEAN else str(frame.label.state)
        counts[str(truth.state) if truth else "dark", said] += 1
    return counts


def test_free_and_locked_every_frame_of_a_thirty_hertz_camera_is_another_light(camera: VirtualCamera) -> None:
    with SequencedCamera(camera, TRIPLES, timing=TIMING) as sequenced:
        assert sequenced.frames == 1
        follow(sequenced, camera, 25)
        locked = follow(sequenced, camera, 40)
        groups = [sequenced.read().label.group for _ in range(8)]
        told = sequenced.status()["light_sequence"]
        assert 1 <= told["trims"] < 10
        assert told["clean"] + told["mixed"] + told["unknown"] == 25 + 40 + 8
        assert told["clean"] >= 39 + 8
        assert (told["light_mode"], told["groups"], told["frames_per_light"]) == ("free", 4, 1)
    assert locked["clean", "right"] >= 39
    assert locked["clean", "clean"] == locked["mixed", "clean"] == 0
    assert groups[4:] == groups[:4]
    assert sorted(groups[:4]) == [0, 1, 2, 3]
    assert camera.board.faults == []


def test_with_a_strobe_no_frame_is_mixed_at_all(monkeypatch: pytest.MonkeyPatch) -> None:
    camera = virtual_sensor(monkeypatch, strobe=True)
    with SequencedCamera(camera, TRIPLES, mode=LightMode.EXT, timing=TIMING) as sequenced:
        counts = follow(sequenced, camera, 25)
    assert counts["mixed", "mixed"] == 0
    assert counts["clean", "right"] >= 23


def test_with_a_strobe_what_a_light_may_show_is_in_the_middle_of_the_dark_or_as_early_as_can_be(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    camera, asked = virtual_sensor(monkeypatch, strobe=True), {}
    set_sync = camera.ring.set_sync
    monkeypatch.setattr(camera.ring, "set_sync", lambda mode, **how: (asked.update(how), set_sync(mode, **how)))
    for exposure_s in (0.008, 0.02):
        timing = CameraTiming(exposure_s=exposure_s, stamp_delay_s=0.003, pulse_period_s=0.0005)
        sequenced = SequencedCamera(camera, TRIPLES, mode=LightMode.EXT, timing=timing)
        sequenced.stop()
        assert asked["divider"] == sequenced.frames
        assert asked["timeout_us"] == round(4 * sequenced.frames * timing.period_s * 1e6)
        first_s, last_s = asked["delay_us"] * 1e-6 - 0.002, asked["delay_us"] * 1e-6 + 0.0005  # sent again; a pulse
        over_s, dark_s = timing.duration_s + 0.003, timing.period_s - timing.duration_s
        if dark_s > 0.01:
            assert (first_s + last_s) / 2 == pytest.approx(over_s + dark_s / 2, abs=1e-6)
        else:
            assert first_s == pytest.approx(over_s + timing.stamp_error_s + 0.001), "of both clocks"
    camera.close()


def test_a_strobe_that_falls_silent_leaves_the_ring_dark_and_no_frame_clean(monkeypatch: pytest.MonkeyPatch) -> None:
    camera = virtual_sensor(monkeypatch, strobe=True)
    with SequencedCamera(camera, TRIPLES, mode=LightMode.EXT, timing=TIMING) as sequenced:
        follow(sequenced, camera, 5)
        camera.strobe = False
        follow(sequenced, camera, 8)
        counts = follow(sequenced, camera, 3)
        assert Dark(camera.ring.status().dark) == Dark.TRIGGER_MISSED
    assert counts == {("dark", "unknown"): 3}


AT_NIGHT = pytest.mark.nightly


@pytest.mark.parametrize("mode", [LightMode.FREE, pytest.param(LightMode.EXT, marks=AT_NIGHT)])
def test_a_sequence_that_died_while_the_program_was_held_up_is_started_again(
    monkeypatch: pytest.MonkeyPatch, mode: LightMode
) -> None:
    camera = virtual_sensor(monkeypatch, strobe=mode is LightMode.EXT)
    with SequencedCamera(camera, TRIPLES, mode=mode, timing=TIMING) as sequenced:
        follow(sequenced, camera, 5)
        camera.board.run(1_500_000)
        assert not camera.board.lit.any()
        meanwhile = follow(sequenced, camera, 25)
        after = follow(sequenced, camera, 15)
    assert meanwhile["mixed", "clean"] == meanwhile["clean", "clean"] == meanwhile["dark", "clean"] == 0
    assert after["clean", "right"] >= 13


@pytest.mark.parametrize(
    "mode", [LightMode.FREE, *(pytest.param(mode, marks=AT_NIGHT) for mode in (LightMode.EXT, LightMode.HOLD))]
)
def test_a_sensor_that_was_unplugged_gets_its_sequence_again(monkeypatch: pytest.MonkeyPatch, mode: LightMode) -> None:
    camera = virtual_sensor(monkeypatch, strobe=mode is LightMode.EXT)
    with SequencedCamera(camera, TRIPLES, mode=mode, timing=TIMING) as sequenced:
        follow(sequenced, camera, 20)
        before, read = camera.ring, camera.read
        before.close()

        def away() -> CameraFrame:
            raise ReconnectingError("it was unplugged")

        camera.ring, camera.read = None, away
        for _ in range(2):
            with pytest.raises(ReconnectingError):
                sequenced.read()
        camera.ring, camera.read = LightRing(VirtualTransport(camera.board), keep_alive_s=None), read
        meanwhile = follow(sequenced, camera, 25)
        after = follow(sequenced, camera, 15)
        assert sequenced.ring is camera.ring is not before
    assert meanwhile["mixed", "clean"] == meanwhile["clean", "clean"] == meanwhile["dark", "clean"] == 0
    assert after["clean", "right"] >= 13


def test_a_ring_that_was_replugged_between_two_frames_is_no_fault(camera: VirtualCamera) -> None:
    """The camera notices nothing, but its ring is another one: the old one does not answer any more."""
    with SequencedCamera(camera, TRIPLES, timing=TIMING) as sequenced:
        follow(sequenced, camera, 5)
        camera.ring.close()
        camera.ring = LightRing(VirtualTransport(camera.board), keep_alive_s=None)
        counts = follow(sequenced, camera, 30)
    assert counts["clean", "right"] >= 10
    assert counts["mixed", "clean"] == counts["clean", "clean"] == 0


def test_a_running_sequence_adopts_controls_and_gives_the_new_light_back(
    camera: VirtualCamera, sequenced: SequencedCamera
) -> None:
    follow(sequenced, camera, 5)
    sequenced.adopt({}, RING // 2)
    counts = follow(sequenced, camera, 30)
    assert counts["clean", "right"] >= 10
    sequenced.stop()
    np.testing.assert_array_equal(camera.board.lit, RING // 2)
    sequenced.close()


def test_hold_gives_the_groups_in_turn(camera: VirtualCamera) -> None:
    with SequencedCamera(camera, TRIPLES, mode=LightMode.HOLD, timing=TIMING) as sequenced:
        for number in range(6):
            frame = sequenced.read()
            assert frame.label == camera.truth(TRIPLES) == LightLabel(state=LightState.CLEAN, group=number % 4)


def test_a_stamp_that_is_too_late_leaves_frames_unknown(monkeypatch: pytest.MonkeyPatch) -> None:
    """Such a frame ends, by its stamp, after it arrived: nobody has asked the board about that time yet."""
    camera = virtual_sensor(monkeypatch, late_s=0.0333)
    with SequencedCamera(camera, TRIPLES, timing=TIMING) as sequenced:
        counts = follow(sequenced, camera, 15)
    assert counts["clean", "clean"] == counts["mixed", "clean"] == counts["clean", "right"] == 0


def test_stopping_gives_the_light_back_and_leaves_the_camera_open(camera: VirtualCamera) -> None:
    before = RING // 3
    camera.ring.wait_for_light(camera.ring.set_leds(before).light_id)
    sequenced = SequencedCamera(camera, TRIPLES, timing=TIMING)
    sequenced.read()
    with pytest.raises(BoardError, match="running a sequence"):
        SequencedCamera(camera, TRIPLES, timing=TIMING)
    sequenced.stop()
    np.testing.assert_array_equal(camera.board.lit, before)
    assert camera.ring.event_listeners == camera.ring.ping_listeners == []
    camera.read()
    sequenced.close()
    assert not camera.board.lit.any()


def test_a_board_that_is_gone_is_an_error_not_a_label(camera: VirtualCamera, sequenced: SequencedCamera) -> None:
    sequenced.read()
    camera.board.power_off()
    with pytest.raises(BoardError, match="did not answer"):
        sequenced.read()


def test_a_frame_whose_time_is_estimated_has_no_known_light(
    camera: VirtualCamera, sequenced: SequencedCamera, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert follow(sequenced, camera, 60)["clean", "right"] > 20
    read = camera.read
    monkeypatch.setattr(camera, "read", lambda: replace(read(), estimated=True))
    assert {said for _, said in follow(sequenced, camera, 20)} == {"unknown"}


def test_a_line_that_was_silent_for_a_while_ends_no_stream(camera: VirtualCamera, sequenced: SequencedCamera) -> None:
    follow(sequenced, camera, 10)
    transport, silent_until_us = camera.ring.transport, camera.board.now_us + 1.05e6
    heard = transport.read

    def read(timeout_s: float) -> bytes:
        until_s = transport.monotonic() + timeout_s
        while camera.board.now_us < silent_until_us:
            heard(max(until_s - transport.monotonic(), 0.0))  # it is lost
            if transport.monotonic() >= until_s:
                return b""
        return heard(max(until_s - transport.monotonic(), 0.0))

    transport.read = read  # type: ignore[method-assign]
    with pytest.raises(ReconnectingError, match=r"answers again: .*did not answer STATUS"):
        sequenced.read()
    follow(sequenced, camera, 25)
    again = follow(sequenced, camera, 40)
    assert again["clean", "right"] >= 30
    assert again["clean", "clean"] == again["mixed", "clean"] == again["dark", "clean"] == 0


def test_a_line_that_took_no_bytes_for_a_while_ends_no_stream(
    camera: VirtualCamera, sequenced: SequencedCamera
) -> None:
    follow(sequenced, camera, 10)
    transport = camera.ring.transport
    write = transport.write

    def full(_: bytes) -> None:
        transport.write = write  # type: ignore[method-assign]
        raise SilentError("the board takes no bytes (Write timeout)")

    transport.write = full  # type: ignore[method-assign]
    with pytest.raises(ReconnectingError, match=r"answers again: .*takes no bytes"):
        sequenced.read()
    assert follow(sequenced, camera, 40)["clean", "right"] >= 30


def test_darkness_that_nobody_planned_is_no_group(camera: VirtualCamera, sequenced: SequencedCamera) -> None:
    """Another thread darkens the ring: frames that saw it are not clean, from the first on."""
    follow(sequenced, camera, 10)
    camera.ring.blank()
    counts = follow(sequenced, camera, 4)
    assert counts["dark", "unknown"] >= 3
    assert counts["dark", "clean"] == counts["mixed", "clean"] == 0


def test_more_groups_than_the_board_holds_or_a_camera_without_ring_are_refused(camera: VirtualCamera) -> None:
    with pytest.raises(InputError, match="17 light groups: the board holds 1 to 16"):
        SequencedCamera(camera, np.zeros((17, 12, 3), np.uint8), timing=TIMING)
    with open_simulated("sim://?board=0&programme=0") as dark, pytest.raises(CameraError, match="no light ring"):
        SequencedCamera(dark, TRIPLES)


def test_an_exposure_longer_than_the_measured_frame_period_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    camera = virtual_sensor(monkeypatch, fps=60.0)
    with pytest.raises(InputError, match="longer than the frame period of 16"):
        SequencedCamera(camera, TRIPLES, timing=CameraTiming(exposure_s=0.018))
