"""The committed image on an emulated RP2040: the waveform on the pin, time, USB, safety, flash."""

import numpy as np
import pytest

from gellight.ring import protocol as p
from gellight.ring.board_link import RefusedError
from gellight.ring.enumerations import Dark, ResetReason, SyncMode
from gellight.ring.light_ring import LightRing, Step
from gellight.ring.wire import Packet, encode
from tests.firmware.emulator.waveform import WINDOWS_NS
from tests.helpers.bench_board import BLUE, GREEN, RED, BenchBoard, VirtualTransport

PATTERN = np.arange(36, dtype=np.uint8).reshape(12, 3) * 7 % 97
JITTER_US = 1.0


def starts(board: BenchBoard, since: int) -> np.ndarray:
    """First bits of the frames on the pin, on the firmware's clock (the chip was not restarted)."""
    return np.array(board.waveform.frame_starts_us[since:])


# ---- the wire ----


def test_the_leds_are_dark_before_the_board_is_on_the_bus(image: bytes) -> None:
    board = BenchBoard(image)
    board.run_until(lambda: board.host.configured, 200_000)
    assert len(board.timeline) == 1
    assert not board.timeline[0].colours.any()
    assert board.waveform.frame_starts_us[0] < 64_000 + 2_000 < board.now_us  # the crystal takes 64 ms


def test_every_bit_keeps_the_windows_of_the_data_sheets(board: BenchBoard, ring: LightRing) -> None:
    ring.set_leds(PATTERN)
    board.run(2_000)
    bits = board.waveform.bits
    assert len(bits) == board.waveform.strip.bits == 288
    for bit in bits:
        name = "T1" if bit.high_ns > 500 else "T0"
        assert WINDOWS_NS[name + "H"][0] <= bit.high_ns <= WINDOWS_NS[name + "H"][1]
        assert bit.low_ns is None or WINDOWS_NS[name + "L"][0] <= bit.low_ns <= WINDOWS_NS[name + "L"][1]
    highs = {round(bit.high_ns) for bit in bits}
    periods = {round(bit.high_ns + bit.low_ns) for bit in bits if bit.low_ns}
    assert highs == {333, 667}
    assert periods == {1250}
    np.testing.assert_array_equal(board.lit, PATTERN)


def test_an_led_frame_is_never_torn(board: BenchBoard, ring: LightRing) -> None:
    """Lights that follow each other faster than the wire: some are left out, none is mixed."""
    shades = [np.full((12, 3), value, np.uint8) for value in range(1, 60)]
    code, before = p.COMMANDS["SET_LEDS"].code, len(board.timeline)
    for number, shade in enumerate(shades):
        board.host.send(encode(Packet(code, 100 + number, shade.tobytes())))
        board.run(137.0)
    board.run(20_000)
    shown = [board.timeline[i].colours for i in range(before, len(board.timeline))]
    assert 5 < len(shown) < len(shades)
    assert all((colours == colours[0, 0]).all() for colours in shown)
    np.testing.assert_array_equal(shown[-1], shades[-1])


@pytest.mark.parametrize("triggered", [False, True])
def test_after_a_transfer_that_breaks_off_the_watchdog_makes_the_leds_dark(image: bytes, triggered: bool) -> None:
    """The DMA is stopped in the middle: the LEDs show the part they took for 120 ms at most."""
    board = BenchBoard(image)
    with LightRing(VirtualTransport(board), keep_alive_s=None) as ring:
        if triggered:
            ring.set_sync(SyncMode.EXT)
            ring.load_sequence([PATTERN], [Step(group=0, dwell_us=0)])
            ring.start()
            board.run(3_000)
        begun = len(board.waveform.frame_starts_us)
        if triggered:
            board.set_trigger(True)
        else:
            ring.set_leds(PATTERN)
        board.run_until(lambda: len(board.waveform.frame_starts_us) > begun, 2_000)
        board.run(50)
        board.chip.write_uint32(0x50000444, 1)  # CHAN_ABORT
        assert board.run_until(lambda: board.resets, 140_000)
        board.run(10_000)
        assert [fault.split(": ")[-1] for fault in board.faults] == ["torn"]
        assert not board.lit.any()
    with LightRing(VirtualTransport(board), keep_alive_s=None) as again:
        assert again.hello.reset_reason == ResetReason.WATCHDOG


def test_the_event_tells_when_the_first_bit_left_the_pin(board: BenchBoard, ring: LightRing) -> None:
    event = ring.wait_for_light(ring.set_leds(RED).light_id)
    # the clock counts whole microseconds, and the first bit rises 0.6 us after the transfer has begun
    assert 0 <= board.waveform.frame_starts_us[-1] - board.timer_began_us - event.first_bit_us < 2
    latched = board.timeline[-1].time_us - board.timer_began_us
    assert latched <= event.latched_us <= latched + 25


# ---- time ----


def free_run(board: BenchBoard, ring: LightRing, steps: list[Step], duration_us: float) -> np.ndarray:
    since = len(board.waveform.frame_starts_us)
    ring.load_sequence([RED, GREEN, BLUE], steps)
    ring.set_sync(SyncMode.FREE)
    ring.start()
    elapsed = 0.0
    while elapsed < duration_us:
        board.run(min(200_000, duration_us - elapsed))
        ring.clock()
        elapsed += 200_000
    return starts(board, since)


def test_sequence_steps_fall_on_their_microsecond(board: BenchBoard, ring: LightRing) -> None:
    times = free_run(board, ring, [Step(group=0, dwell_us=4_000), Step(group=1, dwell_us=7_000)], 400_000)
    planned = times[0] + np.array([11_000 * (k // 2) + 4_000 * (k % 2) for k in range(len(times))])
    assert len(times) > 60
    assert np.abs(times - planned).max() <= JITTER_US
    assert ring.counters().late_steps == 0


def test_steps_keep_their_time_while_the_host_talks(board: BenchBoard, ring: LightRing) -> None:
    """Replies, events and rejected packets keep the processor and its USB interrupt busy meanwhile."""
    since = len(board.waveform.frame_starts_us)
    ring.load_sequence([RED, GREEN], [Step(group=0, dwell_us=2_300), Step(group=1, dwell_us=2_300)])
    ring.set_sync(SyncMode.FREE)
    ring.start()
    for _ in range(100):
        ring.status()
        board.host.send(b"\x07rubbish\0")
        ring.counters()
    times = starts(board, since)
    assert len(times) > 6
    assert np.abs(times - times[0] - 2_300 * np.arange(len(times))).max() <= JITTER_US
    assert ring.counters().bad_framing == 100


@pytest.mark.nightly
def test_the_fastest_sequence_keeps_its_time_under_the_longest_commands(board: BenchBoard, ring: LightRing) -> None:
    """A whole table is loaded again and again, which takes all 32 steps' checksum, while the shortest steps run."""
    since = len(board.waveform.frame_starts_us)
    steps = [Step(group=k % 2, dwell_us=p.DWELL_MIN_US) for k in range(p.STEP_COUNT)]
    ring.load_sequence([RED, GREEN], steps)
    ring.set_sync(SyncMode.FREE)
    ring.start()
    for _ in range(24):
        ring.counters()
        ring.configuration()
        ring.load_sequence([RED, GREEN], steps)
    times = starts(board, since)
    assert len(times) > 60
    assert np.abs(times - times[0] - p.DWELL_MIN_US * np.arange(len(times))).max() <= JITTER_US
    assert ring.counters().late_steps == 0


def test_the_trigger_pin_lights_after_its_delay(board: BenchBoard, ring: LightRing) -> None:
    ring.set_sync(SyncMode.EXT, delay_us=300, divider=2)
    ring.load_sequence([RED, GREEN], [Step(group=0, dwell_us=2_000), Step(group=1, dwell_us=2_000)])
    ring.start()
    edges, begun = [], []
    for number in range(8):
        board.run(5_000)
        before = len(board.waveform.frame_starts_us)
        board.set_trigger(True)
        edge = board.now_us
        board.run(1_000)
        board.set_trigger(False)
        if number % 2:
            edges.append(edge)
            begun.append(board.waveform.frame_starts_us[before])
    delays = np.array(begun) - np.array(edges)
    assert np.abs(delays - 300).max() <= 2 * JITTER_US  # the edge itself is stamped to 1 us
    assert ring.counters().triggers == 4


def test_a_second_of_sleep_costs_nothing(board: BenchBoard, ring: LightRing) -> None:
    before = ring.clock().received_us
    board.run(1_000_000)
    assert abs(ring.clock().received_us - before - 1_000_000) < 2_000


# ---- safety ----


def test_a_silent_host_leaves_the_leds_dark(board: BenchBoard, ring: LightRing) -> None:
    ring.set_leds(RED)
    board.run(900_000)
    assert board.lit.any()
    board.run(200_000)
    assert not board.lit.any()
    assert ring.status().dark == Dark.HOST_SILENT


def test_closing_the_port_darkens(board: BenchBoard, ring: LightRing) -> None:
    ring.set_leds(RED)
    board.run(3_000)
    board.host.close()
    board.run(3_000)
    assert not board.lit.any()


def test_nothing_is_lit_by_what_was_under_way_when_the_port_closed(board: BenchBoard, ring: LightRing) -> None:
    ring.set_leds(RED)
    for number in range(40):
        packet = Packet(p.COMMANDS["SET_LEDS"].code, 100 + number, GREEN.tobytes())
        board.host.send(encode(packet))
    board.run(1_500)
    board.host.close()
    board.run(20_000)
    assert not board.lit.any()


def test_a_port_that_is_opened_again_at_once_has_been_dark(board: BenchBoard, ring: LightRing) -> None:
    """Also while the board is busy with packets, and looks at the bus only when both has happened."""
    ring.set_leds(RED)
    for number in range(30):
        board.host.send(encode(Packet(p.COMMANDS["SET_GROUP"].code, number, p.SetGroup(9, bytes(36)).pack())))
    board.run(2_000)
    before = len(board.timeline)
    board.host.close()
    board.host.open()
    board.run(30_000)
    assert len(board.timeline) > before
    assert not board.lit.any()


def test_suspending_the_bus_darkens(board: BenchBoard, ring: LightRing) -> None:
    ring.set_leds(RED)
    board.run(3_000)
    board.suspend()
    board.run(3_000)
    assert not board.lit.any()


def test_an_exception_darkens(board: BenchBoard) -> None:
    def fail() -> None:
        with LightRing(VirtualTransport(board), keep_alive_s=None) as ring:
            ring.set_leds(RED)
            board.run(2_000)
            assert board.lit.any()
            raise KeyError

    with pytest.raises(KeyError):
        fail()
    board.run(2_000)
    assert not board.lit.any()


def test_full_white_is_refused(board: BenchBoard, ring: LightRing) -> None:
    with pytest.raises(RefusedError, match="OVER_CURRENT"):
        ring.set_leds(np.full((12, 3), 255, np.uint8))
    board.run(2_000)
    assert not board.lit.any()


def test_a_processor_that_hangs_is_restarted_in_the_dark(board: BenchBoard, ring: LightRing) -> None:
    """Interrupts off for ever: the main loop makes no progress, the watchdog is not fed."""
    ring.set_leds(RED)
    board.run(2_000)
    board.chip.write_uint32(0x20000000 + 0x3FF00, 0xE7FE_E7FE)  # b . ; b .
    board.chip.core.pc = 0x2003FF00
    board.chip.core.pm = True
    board.chip.core.waiting = False
    board.run_until(lambda: board.resets, 150_000)
    assert board.resets == 1
    board.run(8_000)
    assert not board.lit.any()
    board.run_until(lambda: board.host.configured, 200_000)
    with LightRing(VirtualTransport(board), keep_alive_s=None) as again:
        assert again.hello.reset_reason == ResetReason.WATCHDOG


def test_a_fault_of_the_processor_darkens_and_restarts(image: bytes) -> None:
    board = BenchBoard(image)
    with LightRing(VirtualTransport(board), keep_alive_s=None) as ring:
        ring.set_leds(RED)
        board.run(2_000)
        vectors = board.chip.read_uint32(0xE000ED08)
        board.chip.core.pc = board.chip.read_uint32(vectors + 12) & ~1  # what HardFault would enter
        board.chip.core.waiting = False
        board.run_until(lambda: board.resets, 150_000)
        assert not board.lit.any()
    board.run_until(lambda: board.host.configured, 200_000)
    with LightRing(VirtualTransport(board), keep_alive_s=None) as again:
        assert again.hello.reset_reason == ResetReason.FAULT
    assert board.faults == []
