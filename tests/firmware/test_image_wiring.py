"""Pins, number and order of the LEDs, trigger output and status LED of the committed image, as its flash says."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from gellight.ring import protocol as p
from gellight.ring.board_link import RefusedError
from gellight.ring.enumerations import ColourOrder, OutputAt, ResetReason, SyncMode
from gellight.ring.light_ring import LightRing, Step
from gellight.ring.wire import Packet, encode
from tests.firmware.emulator import registers
from tests.firmware.emulator.chip import VTOR
from tests.firmware.emulator.waveform import Strip
from tests.firmware.helpers.wiring import opened, wired
from tests.helpers.bench_board import RED, BenchBoard

OUTPUT, PULSE_US = 4, 100
DWELL_US = 20_000
TIMER_0, TIMER_2, INSTRUCTIONS = 0, 2, 24
"""interrupts; instructions of the one of a pulse"""


def levels(board: BenchBoard, pin: int) -> list[tuple[float, bool]]:
    """Every change of a pin that the board drives, from now on."""
    changes: list[tuple[float, bool]] = []
    board.chip.gpio[pin].add_listener(lambda new, _old: changes.append((board.now_us, int(new) == 1)))
    return changes


@pytest.mark.parametrize(("leds", "order"), [(1, 0), (24, 0), (24, 2), (16, 1), (12, 2)])
def test_any_number_of_leds_in_any_order_at_any_pin(image: bytes, leds: int, order: int) -> None:
    strip = Strip(leds, ColourOrder(order), 9)
    board = wired(image, strip, data_pin=9, led_count=leds, colour_order=order)
    pattern = (np.arange(3 * leds, dtype=np.uint8) * 5 % 61).reshape(leds, 3)
    with opened(board) as ring:
        assert ring.hello.led_count == ring.led_count == leds
        event = ring.wait_for_light(ring.set_leds(pattern).light_id)
        board.run(1_000)
        np.testing.assert_array_equal(board.lit, pattern)
        assert event.latched_us - event.first_bit_us == strip.bits * 1.25 + 301
        ring.load_sequence([pattern, pattern[::-1]], [Step(group=k, dwell_us=2_000) for k in range(2)])
        ring.set_sync(SyncMode.FREE)
        ring.start()
        board.run(40_000)
        assert ring.counters().late_steps == 0
    assert board.faults == []


def test_colours_for_another_number_of_leds_are_refused(image: bytes) -> None:
    board = wired(image, Strip(5), led_count=5)
    with opened(board) as ring:
        with pytest.raises(ValueError, match=r"\(5, 3\) uint8"):
            ring.set_leds(RED)
        with pytest.raises(RefusedError, match=r"BAD_LENGTH .36."):
            ring._request("SET_LEDS", p.LightReply, p.SetLeds(RED.tobytes()))


def test_the_current_counts_every_led(image: bytes) -> None:
    board = wired(image, Strip(24), led_count=24)
    with opened(board) as ring:
        red = np.tile(np.array((100, 0, 0), np.uint8), (24, 1))
        assert ring.set_leds(red).current_ma == np.ceil(24 * (1 + 20 * 100 / 255))


def test_pins_and_leds_change_with_the_next_start_alone(board: BenchBoard, ring: LightRing) -> None:
    ring.configure(replace(ring.configuration(), led_count=24, data_pin=7))
    ring.set_leds(RED)
    board.run(2_000)
    np.testing.assert_array_equal(board.lit, RED)


@pytest.mark.parametrize(
    "fields",
    [{"data_pin": 3}, {"data_pin": 30}, {"output_pin": 2}, {"status_pin": 3}, {"status_pin": p.ACTIVE_LOW + 3},
     {"trigger_pin": p.NO_PIN}, {"data_pin": p.NO_PIN}, {"led_count": 0}, {"led_count": 25}, {"colour_order": 3},
     {"output_at": 2}],
)  # fmt: skip
def test_a_wiring_that_cannot_be_is_refused(board: BenchBoard, ring: LightRing, fields: dict[str, int]) -> None:
    before = ring.configuration()
    with pytest.raises(RefusedError, match="OUT_OF_RANGE"):
        ring.configure(replace(before, **fields))
    assert ring.configuration() == before


def test_the_trigger_may_come_at_another_pin(image: bytes) -> None:
    board = wired(image, trigger_pin=17)
    with opened(board) as ring:
        ring.set_sync(SyncMode.EXT)
        ring.load_sequence([RED], [Step(group=0, dwell_us=5_000)])
        ring.start()
        board.run(5_000)
        board.set_trigger(True)
        board.run(3_000)
        assert not board.lit.any()
        board.chip.gpio[17].set_input_value(True)
        board.run(3_000)
        assert board.lit.any()


@pytest.mark.parametrize("at", list(OutputAt))
def test_the_output_pulses_once_in_each_light(image: bytes, at: OutputAt) -> None:
    board = wired(image, output_pin=OUTPUT, output_at=at)
    with opened(board) as ring:
        ring.load_sequence([RED], [Step(group=0, dwell_us=DWELL_US, blank_us=DWELL_US)], loops=3)
        ring.set_sync(SyncMode.FREE)
        changes, since = levels(board, OUTPUT), len(board.waveform.frame_starts_us)
        ring.start()
        board.run(8 * DWELL_US)
        begun = board.waveform.frame_starts_us[since::2][:3]
        expected = [start + (DWELL_US / 2 if at is OutputAt.MIDDLE else 661) for start in begun]
        rises, falls = ([when for when, level in changes if level is up] for up in (True, False))
        assert len(rises) == len(falls) == 3
        np.testing.assert_allclose(rises, expected, atol=8)
        np.testing.assert_allclose(np.array(falls) - rises, PULSE_US, atol=5)
    assert board.faults == []


def test_no_pulse_comes_once_the_light_was_taken_away(image: bytes) -> None:
    board = wired(image, output_pin=OUTPUT, output_at=OutputAt.MIDDLE)
    with opened(board) as ring:
        ring.load_sequence([RED], [Step(group=0, dwell_us=DWELL_US)])
        ring.set_sync(SyncMode.FREE)
        changes = levels(board, OUTPUT)
        ring.start()
        board.run(DWELL_US / 4)
        ring.blank()
        board.run(3 * DWELL_US)
        assert changes == []


def test_a_step_that_heat_dims_pulses_once(image: bytes) -> None:
    board = wired(image, output_pin=OUTPUT)
    with opened(board) as ring:
        ring.set_sync(SyncMode.EXT)
        ring.load_sequence([RED], [Step(group=0, dwell_us=0)])
        ring.start()
        changes = levels(board, OUTPUT)
        board.run(3_000)
        board.set_trigger(True)
        board.set_temperature(p.HOTTEST_C + 8)
        for _ in range(80):
            board.run(100_000)
            ring.clock()
        assert ring.status().dimmed == 1
        assert [level for _, level in changes] == [True, False]


def half_periods_ms(board: BenchBoard, pin: int, duration_us: float) -> list[int]:
    changes = levels(board, pin)
    board.run(duration_us)
    return [round((b - a) / 1e4) * 10 for (a, _), (b, _) in pairwise(changes)]


@pytest.mark.parametrize(("pin", "low"), [(25, False), (16, True)])
def test_the_status_led_tells_host_and_fault_apart(image: bytes, pin: int, low: bool) -> None:
    board = wired(image, status_pin=pin + (p.ACTIVE_LOW if low else 0))
    assert board.run_until(lambda: board.host.configured, 200_000)
    assert set(half_periods_ms(board, pin, 2_600_000)) == {500}
    with opened(board):
        board.run(600_000)
        assert half_periods_ms(board, pin, 1_200_000) == []
        assert (board.chip.sio.gpio_value >> pin & 1) == (not low)
    core = board.chip.core
    board.chip.write_uint32(0x2003FF00, 0xE7FEE7FE)
    core.pc, core.pm, core.waiting = 0x2003FF00, True, False
    assert board.run_until(lambda: board.resets, 150_000)
    assert board.run_until(lambda: board.host.configured, 200_000)
    assert set(half_periods_ms(board, pin, 1_000_000)) == {100}
    with opened(board) as ring:
        assert ring.hello.reset_reason == ResetReason.WATCHDOG
        board.run(600_000)
        assert half_periods_ms(board, pin, 1_200_000) == []


SWITCH = 6


@pytest.mark.parametrize("low", [0, p.ACTIVE_LOW], ids=["high", "low"])
def test_the_load_switch_is_closed_while_the_leds_are_lit_alone(image: bytes, low: int) -> None:
    """The emulated LEDs are dark while it is open, and report light that comes before their supply has risen."""
    board = wired(image, Strip(switch=SWITCH + low), switch_pin=SWITCH + low)
    with opened(board) as ring:
        changes = levels(board, SWITCH)
        for end in (ring.blank, lambda: board.run(1_200_000)):  # the second: a host that is silent
            ring.wait_for_light(ring.set_leds(RED).light_id)
            board.run(1_000)
            np.testing.assert_array_equal(board.lit, RED)
            end()
            board.run(2_000)
            assert not board.lit.any()
        ring.load_sequence([RED], [Step(group=0, dwell_us=5_000, blank_us=5_000)], loops=3)
        ring.set_sync(SyncMode.FREE)
        ring.start()
        board.run(100_000)
        assert ring.counters().late_steps == 0
        assert [level for _, level in changes] == 3 * [not low, bool(low)]
    assert board.faults == []


def test_a_fault_and_a_hang_leave_the_load_switch_open(image: bytes) -> None:
    board = wired(image, Strip(switch=SWITCH), switch_pin=SWITCH)
    for vector in (None, 12):
        with opened(board) as ring:
            ring.wait_for_light(ring.set_leds(RED).light_id)
            board.run(1_000)
            assert board.lit.any()
            core, resets, begun_us = board.chip.core, board.resets, board.now_us
            board.chip.write_uint32(0x2003FF00, 0xE7FEE7FE)
            target = (
                0x2003FF00 if vector is None else board.chip.read_uint32(board.chip.read_uint32(VTOR) + vector) & ~1
            )
            core.pc, core.pm, core.waiting = target, vector is None, False
            assert board.run_until(lambda: not board.lit.any(), 130_000)
            if vector is not None:
                assert board.now_us - begun_us < 100  # before the LEDs are told, and before the chip starts anew
            assert board.run_until(lambda n=resets: board.resets > n, 150_000)
            assert board.run_until(lambda: board.host.configured, 200_000)


def test_an_image_that_lights_leds_without_power_is_told(image: bytes) -> None:
    board = wired(image, Strip(switch=SWITCH))  # it knows nothing of the switch
    with opened(board) as ring:
        ring.set_leds(RED)
        board.run(2_000)
        assert not board.lit.any()
    assert any("supply of the LEDs" in fault for fault in board.faults)


def test_a_light_that_latches_while_a_pulse_begins_takes_it_away(image: bytes) -> None:
    """At every instruction of the pulse's interrupt, which that of the light goes before."""
    board, risen = wired(image, output_pin=OUTPUT, output_at=OutputAt.MIDDLE), []
    with opened(board) as ring:
        ring.load_sequence([RED], [Step(group=0, dwell_us=DWELL_US)])
        ring.set_sync(SyncMode.FREE)
        changes = levels(board, OUTPUT)
        handler = board.chip.read_uint32(board.chip.read_uint32(VTOR) + 4 * (16 + TIMER_2))
        for after in range(INSTRUCTIONS):
            since, changes[:] = len(board.waveform.frame_starts_us), []
            ring.start()
            assert board.run_until(lambda n=since: len(board.waveform.frame_starts_us) > n, DWELL_US)
            board.run(DWELL_US / 2 - 400)
            board.host.send(encode(Packet(p.COMMANDS["BLANK"].code, 9, b"")))  # its light is on its way then
            end_us = board.now_us + 900
            while board.chip.core.pc | 1 != handler:
                board._run_slice(1e6, 1)
                assert board.now_us < end_us
            for _ in range(after):
                board._run_slice(1e6, 1)
            timer = board.chip.peripherals[registers.TIMER].inner
            timer._int_raw |= 1 << TIMER_0
            board.chip.core.set_interrupt(TIMER_0, True)
            latched_us = board.now_us
            risen.append(bool(changes))
            board.run(DWELL_US)
            assert [level for _, level in changes] in ([], [True, False]), after
            assert all(when < latched_us + 2 for when, _ in changes), after
    assert set(risen) == {False, True}, "all of what comes before the pulse begins was tried"
    assert board.faults == []
