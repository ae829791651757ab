"""The committed image on an emulated RP2040: waveform, time, starts, and edges of the trigger."""

from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest

from gellight.ring import protocol as p
from gellight.ring.enumerations import ResetReason, SyncMode
from gellight.ring.firmware.image import BOOT2_BYTES
from gellight.ring.light_ring import LightRing, Step
from gellight.ring.wire import Packet, encode
from tests.firmware.emulator.waveform import WINDOWS_NS
from tests.firmware.helpers.examined import break_down
from tests.helpers.bench_board import GREEN, RED, BenchBoard, VirtualTransport

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


def test_the_event_tells_when_the_first_bit_left_the_pin(board: BenchBoard, ring: LightRing) -> None:
    event = ring.wait_for_light(ring.set_leds(RED).light_id)
    # the clock counts whole microseconds, and the first bit rises 0.6 us after the transfer has begun
    assert 0 <= board.waveform.frame_starts_us[-1] - board.timer_began_us - event.first_bit_us < 2
    latched = board.timeline[-1].time_us - board.timer_began_us
    assert latched <= event.latched_us <= latched + 25


# ---- time ----


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


AFTER_US = 1_500, 64_700, 70_000
"""it waits for the crystal, copies, and has begun; at night at the other end of each, too"""
OTHER_ENDS_US = (pytest.param(us, marks=pytest.mark.nightly) for us in (40_000, 65_300, 65_800))


def hang(board: BenchBoard) -> None:
    """No instruction gets through any more, and no interrupt."""
    board.chip.write_uint32(0x2003FF00, 0xE7FEE7FE)  # b . ; b .
    board.chip.core.pc, board.chip.core.pm, board.chip.core.waiting = 0x2003FF00, True, False


@pytest.mark.parametrize("after_us", [*AFTER_US, *OTHER_ENDS_US])
@pytest.mark.parametrize(
    ("disturb", "reason"), [(hang, ResetReason.WATCHDOG), (break_down, ResetReason.FAULT)], ids=["hang", "fault"]
)
def test_what_goes_wrong_while_starting_starts_anew(
    board: BenchBoard, disturb: Callable[[BenchBoard], None], reason: ResetReason, after_us: float
) -> None:
    board.run(after_us)
    disturb(board)
    assert board.run_until(lambda: board.resets, 500_000)
    with LightRing(VirtualTransport(board), keep_alive_s=None) as ring:
        assert ring.hello.reset_reason == reason
    assert board.resets == 1


def test_after_the_watchdog_nothing_waits_for_the_crystal(board: BenchBoard, ring: LightRing) -> None:
    ring.set_leds(RED)
    board.run(2_000)
    hang(board)
    assert board.run_until(lambda: board.resets, 150_000)
    assert board.lit.any()
    board.run(4_000)
    assert not board.lit.any()


# ---- two flags that the emulated processor (rp2040py 0.3.6) gets wrong, by random blocks beside QEMU's ----


SHIFTS, CARRIED = (2, 3, 4, 7), (5, 6)
"""of the arithmetic instructions: LSLS, LSRS, ASRS, RORS by a register; ADCS, SBCS"""
C, V = 2, 1


def known_wrong(word: int) -> int:
    """C, where a register shifts by 0 or by more than 32; V, where a sum with carry ends at 2^31."""
    operation = word >> 6 & 15 if word >> 10 == 0x10 else -1
    return C * (operation in SHIFTS) | V * (operation in CARRIED)


def asks_about(word: int) -> int:
    """Which of C and V an instruction of 16 bits goes by."""
    if word >> 12 == 0xD:
        condition = word >> 8 & 15
        return C * (condition in (2, 3, 8, 9)) | V * (condition in (6, 7, 10, 11, 12, 13))
    return C * (word >> 6 in (0x105, 0x106))


def test_the_image_asks_about_no_flag_that_the_emulator_gets_wrong(image: bytes) -> None:
    words = [int.from_bytes(image[at : at + 2], "little") for at in range(BOOT2_BYTES, len(image) - 1, 2)]
    assert any(known_wrong(word) for word in words)
    assert not [
        f"{first:04x} {second:04x}" for first, second in pairwise(words) if known_wrong(first) & asks_about(second)
    ]


# ---- an edge of the trigger at every instruction of a look at the timeout ----


DELAY_US, EDGE_TOLERANCE_US = 300, 3.0


def step(board: BenchBoard, count: int = 1) -> None:
    for _ in range(count):
        board._run_slice(1e6, 1)


def light_up(board: BenchBoard) -> None:
    """A step is lit, and the next waits for its edge."""
    board.set_trigger(True)
    board.run(2_500)
    board.set_trigger(False)


def look(board: BenchBoard) -> bool:
    """Light a step and bring the board to its next look at the timeout; false if it went dark before."""
    light_up(board)
    for asleep in (True, False):
        while board.chip.core.waiting != asleep:
            step(board)
    return bool(board.lit.any())


def start(board: BenchBoard, ring: LightRing, timeout_us: int) -> None:
    ring.set_sync(SyncMode.EXT, delay_us=DELAY_US, timeout_us=timeout_us)
    ring.load_sequence([RED], [Step(group=0, dwell_us=0)])
    ring.start()
    board.run(3_000)


def instructions_of_a_look(board: BenchBoard) -> int:
    """How many the board executes from waking to sleeping."""
    count = 0
    while not board.chip.core.waiting:
        step(board)
        count += 1
    return count


@pytest.mark.nightly
def test_before_the_timeout_every_edge_lights_its_step(board: BenchBoard, ring: LightRing) -> None:
    start(board, ring, timeout_us=50_000)
    assert look(board)
    instructions = instructions_of_a_look(board)
    assert 100 < instructions < 1000
    for after in range(instructions):
        assert look(board)
        step(board, after)
        edge_us, before = board.now_us, len(board.waveform.frame_starts_us)
        light_up(board)
        assert len(board.waveform.frame_starts_us) == before + 1, after
        assert abs(board.waveform.frame_starts_us[-1] - edge_us - DELAY_US) < EDGE_TOLERANCE_US
        if after % 20 == 0:
            ring.clock()
    assert ring.counters().trigger_timeouts == 0
