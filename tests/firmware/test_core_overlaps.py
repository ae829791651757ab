"""The portable core on a virtual clock: commands that meet a light, a table or a closing port on its way."""

import pytest

from gellight.lab.core_board.core import FLASH_BYTES
from gellight.ring import protocol as p
from gellight.ring.enumerations import Dark, Status, SyncMode
from gellight.ring.wire import Packet, encode
from tests.firmware.helpers.virtual_board import BLACK, BLUE, GREEN, RED, VirtualBoard


def colours(core: VirtualBoard) -> list[bytes]:
    return [shown for _, _, shown in core.lights()]


# ---- the end of a sequence ----


@pytest.mark.parametrize("mode", [SyncMode.FREE, SyncMode.EXT])
def test_a_sequence_runs_until_its_last_light_has_ended(core: VirtualBoard, mode: SyncMode) -> None:
    core.play([RED], [p.SetStep(0, 0, 1, 500_000 if mode == SyncMode.FREE else 0, 0)], loops=1, mode=mode)
    core.edge()
    core.advance(100_000)
    assert (core.status().state, core.status().dark) == (1, Dark.NOT_DARK)
    assert core.ask("SET_LEDS", p.SetLeds(GREEN))[0] == Status.BUSY
    assert core.ask("START")[0] == Status.BUSY
    core.edge()
    core.advance(450_000)
    assert (core.status().state, core.status().dark) == (0, Dark.SEQUENCE_ENDED)
    core.ok("SET_LEDS", p.SetLeds(GREEN))
    core.advance(1000)
    assert colours(core)[-2:] == [BLACK, GREEN]


@pytest.mark.parametrize("mode", [SyncMode.FREE, SyncMode.EXT])
def test_a_sequence_that_waits_for_its_end_can_be_stopped(core: VirtualBoard, mode: SyncMode) -> None:
    core.play([RED], [p.SetStep(0, 0, 1, 500_000 if mode == SyncMode.FREE else 0, 0)], loops=1, mode=mode)
    core.edge()
    core.advance(10_000)
    core.ok("STOP")
    core.ok("SET_LEDS", p.SetLeds(GREEN))
    core.advance(600_000)
    core.edge()
    core.advance(10_000)
    assert core.light == GREEN


def test_a_transfer_of_a_stopped_sequence_is_no_step_of_the_next(core: VirtualBoard) -> None:
    core.play([RED, GREEN, BLUE], [p.SetStep(k, k, 1, 0, 0) for k in range(3)], mode=SyncMode.EXT)
    core.edge()
    core.advance(100)
    core.ok("STOP")
    core.ok("START")
    core.advance(2000)
    core.edge()
    core.advance(2000)
    assert colours(core)[1:] == [RED, RED]


# ---- tables ----


def test_a_committed_table_is_shown_as_it_was_committed(core: VirtualBoard) -> None:
    core.play([RED], [p.SetStep(0, 0, 1, 10_000, 0)])
    core.advance(3000)
    core.load_sequence([GREEN], [p.SetStep(0, 0, 1, 10_000, 0)])
    core.ok("SET_GROUP", p.SetGroup(0, BLUE))
    core.advance(60_000)
    assert colours(core)[1:] == [RED, RED] + [GREEN] * 5


def test_a_shift_to_before_the_start_of_the_board_is_at_once(core: VirtualBoard) -> None:
    core.play([RED], [p.SetStep(0, 0, 1, 5000, 0)])
    core.advance(10_000)
    before = len(core.lights())
    core.ok("TRIM", p.Trim(-60_000_000, 0))
    core.advance(100_000)
    assert len(core.lights()) - before >= 19
    assert core.flags & 1


def test_steps_that_are_late_do_not_pass_for_lights_that_never_come(core: VirtualBoard) -> None:
    core.load_sequence([RED], [p.SetStep(0, 0, 1, 5000, 0)])
    core.sync(SyncMode.FREE)
    core.advance(300_000)
    core.ok("START")
    core.advance(10_000)
    core.ok("TRIM", p.Trim(-200_000, 0))
    for _ in range(100):
        core.advance(1000)
        assert core.flags & 1
    assert core.ok("COUNTERS").late_steps > 20


# ---- the port ----


def test_nothing_is_lit_by_what_comes_after_the_port_closed(core: VirtualBoard) -> None:
    core.ok("SET_LEDS", p.SetLeds(RED))
    core.advance(5000)
    core.link(False)
    core.receive(encode(Packet(p.COMMANDS["SET_LEDS"].code, 99, GREEN)))
    core.advance(5000)
    assert core.light == BLACK


def test_half_a_packet_from_before_does_not_spoil_the_first_after_opening(core: VirtualBoard) -> None:
    core.receive(encode(Packet(p.COMMANDS["STATUS"].code, 1, b""))[:-1])
    core.link(False)
    core.link(True)
    assert core.status().state == 0


@pytest.mark.parametrize("dark", [False, True])
def test_only_a_port_that_closes_in_the_light_counts_as_a_fault(core: VirtualBoard, dark: bool) -> None:
    core.ok("SET_LEDS", p.SetLeds(RED))
    core.advance(2000)
    if dark:
        core.ok("BLANK")  # as the host does before it closes; its transfer is still under way
    core.link(False)
    core.advance(2000)
    core.link(True)
    assert core.ok("COUNTERS").dark_faults == (0 if dark else 1)


# ---- transfers that break off ----


def test_a_triggered_light_that_breaks_off_leaves_the_watchdog_unfed(core: VirtualBoard) -> None:
    """Not while it waits for its edge or its delay, however long."""
    core.play([RED], [p.SetStep(0, 0, 1, 0, 0)], mode=SyncMode.EXT, delay_us=500_000)
    core.advance(10_000)
    core.faults(stuck=True)
    core.edge()
    healthy = []
    for wait_us in (519_000, 2_000, 5_000_000):
        core.advance(wait_us)
        healthy.append(core.flags & 1)
    assert healthy == [1, 0, 0]


def test_a_light_that_does_not_get_through_leaves_the_watchdog_unfed(core: VirtualBoard) -> None:
    core.ok("SET_LEDS", p.SetLeds(RED))
    core.advance(20_000)
    assert core.flags & 1
    core.faults(stuck=True)
    core.ok("SET_LEDS", p.SetLeds(GREEN))
    core.advance(19_000)
    assert core.flags & 1
    core.advance(2_000)
    assert not core.flags & 1


# ---- flash ----


def test_saving_ends_where_the_flash_takes_nothing(core: VirtualBoard) -> None:
    board = VirtualBoard(core.library, bytes(FLASH_BYTES))
    board.faults(cut_after=0)
    assert board.ask("SAVE_CONFIG")[0] == Status.FLASH_FAILED
