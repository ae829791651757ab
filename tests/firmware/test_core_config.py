"""The portable core on a virtual clock: the configuration in flash, restarts."""

import dataclasses
import struct
import zlib

import pytest

from gellight.lab.core_board.core import FLASH_BYTES
from gellight.ring import protocol as p
from gellight.ring.enumerations import Status
from tests.firmware.helpers.virtual_board import BLACK, RED, VirtualBoard


def named(name: str) -> p.Configuration:
    return p.Configuration(1000, 450, 1000, 20000, 300, 0, 0, name.encode().ljust(16, b"\0"))


def flash_of(record: bytes) -> bytes:
    """Return a flash that holds a configuration as some firmware wrote it."""
    page = (struct.pack("<II", 0x474C4346, 7) + record).ljust(252, b"\xff")
    return (page + struct.pack("<I", zlib.crc32(page))).ljust(FLASH_BYTES, b"\xff")


def save(core: VirtualBoard, name: str) -> int:
    core.ok("SET_CONFIG", named(name))
    return core.ask("SAVE_CONFIG")[0]


def test_the_configuration_survives_many_saves(core: VirtualBoard) -> None:
    for number in range(100):
        core.advance(p.SAVE_EVERY_US)
        assert save(core, f"sensor {number}") == Status.OK
    again = core.restarted()
    assert again.ok("GET_CONFIG") == named("sensor 99")
    assert again.status().config_saves == 100


def test_the_bundle_of_the_sensor_is_remembered_without_power(core: VirtualBoard) -> None:
    marked = dataclasses.replace(named("finger 3"), bundle=bytes(range(8)))
    core.ok("SET_CONFIG", marked)
    core.ok("SAVE_CONFIG")
    again = core.restarted()
    assert again.ok("GET_CONFIG") == marked


@pytest.mark.parametrize(
    ("unknown_bytes", "bundle"), [(17, b"\xff" * 8), (9, bytes(8)), (2, bytes(8))], ids=["bundle", "wiring", "heat"]
)
def test_a_record_of_firmware_that_knew_less_still_counts(
    core: VirtualBoard, unknown_bytes: int, bundle: bytes
) -> None:
    """Pins and LEDs are then those of a board as it comes."""
    board = VirtualBoard(core.library, flash_of(named("veteran").pack()[:-unknown_bytes]))
    assert board.ok("GET_CONFIG") == dataclasses.replace(named("veteran"), bundle=bundle)


def test_saves_are_limited_in_rate(core: VirtualBoard) -> None:
    """Or a program that saves for ever wears the flash out within hours."""
    for number in range(p.SAVES_AT_ONCE):
        assert save(core, f"sensor {number}") == Status.OK
    core.ok("SET_CONFIG", named("one more"))
    assert core.ask("SAVE_CONFIG")[:2] == (Status.SAVED_TOO_OFTEN, 60)
    assert core.status().config_saves == p.SAVES_AT_ONCE
    core.advance(p.SAVE_EVERY_US)
    assert core.ask("SAVE_CONFIG")[0] == Status.OK
    assert core.ask("SAVE_CONFIG")[0] == Status.OK  # nothing to write
    assert save(core, "too early") == Status.SAVED_TOO_OFTEN
    core.advance(1000 * p.SAVE_EVERY_US)
    assert [save(core, f"later {number}") for number in range(p.SAVES_AT_ONCE + 1)].count(0) == p.SAVES_AT_ONCE


def test_no_restart_gives_more_saves(core: VirtualBoard) -> None:
    """How many were used outlives it; time counts on from there."""
    board, saves, left = core, 0, []
    for start in range(2 * p.SAVES_AT_ONCE):
        board.advance(1_000_000)
        left.append(save(board, f"start {start}"))
        saves = board.noted_saves
        board = VirtualBoard(core.library, board.flash(), saves=saves)
    assert left == [Status.OK] * p.SAVES_AT_ONCE + [Status.SAVED_TOO_OFTEN] * p.SAVES_AT_ONCE
    board.advance(p.SAVE_EVERY_US)
    assert [save(board, name) for name in "ab"] == [Status.OK, Status.SAVED_TOO_OFTEN]


def test_saving_the_same_writes_nothing(core: VirtualBoard) -> None:
    save(core, "same")
    before = core.flash()
    save(core, "same")
    assert core.flash() == before


@pytest.mark.parametrize("field", ["host_timeout_ms", "limit_ma", "quiescent_ua", "channel_ua", "latch_us"])
def test_a_configuration_out_of_range_is_refused(core: VirtualBoard, field: str) -> None:
    wrong = dataclasses.replace(named("wrong"), **{field: 0xFFFF})
    assert core.ask("SET_CONFIG", wrong)[0] == Status.OUT_OF_RANGE


def test_a_record_that_undercuts_every_led_keeps_the_rest(core: VirtualBoard) -> None:
    """Firmware of before took 1 mA a colour where the LEDs have a supply of their own, and knew two policies."""
    old = dataclasses.replace(named("veteran"), unused=1, external_supply=1, limit_ma=2000, channel_ua=1_000)
    board = VirtualBoard(core.library, flash_of(old.pack()))
    assert board.ok("GET_CONFIG") == dataclasses.replace(old, channel_ua=p.CHANNEL_EXTERNAL_UA)


def test_a_power_cut_at_any_byte_loses_at_most_the_record_being_written(core: VirtualBoard) -> None:
    """Both cases: appending a record, and erasing a sector first because the other one is full."""
    for saves, span in ((3, 256), (16, 4096 + 256)):
        core_before = VirtualBoard(core.library)
        for number in range(saves):
            core_before.advance(p.SAVE_EVERY_US)
            save(core_before, f"old {number}")
        flash = core_before.flash()
        for cut in range(span + 1):
            victim = VirtualBoard(core.library, flash)
            victim.ok("SET_CONFIG", named("new"))
            victim.faults(cut_after=cut)
            victim.ask("SAVE_CONFIG")
            survivor = victim.restarted()
            expected = "new" if cut >= span else f"old {saves - 1}"
            found = survivor.ok("GET_CONFIG")
            assert found in (named(expected), named("new")), cut
            assert save(survivor, "later") == Status.OK
            after = survivor.restarted()
            assert after.ok("GET_CONFIG") == named("later")


def test_an_empty_or_ruined_flash_gives_the_built_in_configuration(core: VirtualBoard) -> None:
    for flash in (b"\xff" * FLASH_BYTES, bytes(FLASH_BYTES), bytes(i * 7 & 255 for i in range(FLASH_BYTES))):
        board = VirtualBoard(core.library, flash)
        assert board.ok("GET_CONFIG") == named("GelLight")
        assert save(board, "recovered") == Status.OK


def test_restarting_waits_for_the_reply_and_the_dark(core: VirtualBoard) -> None:
    core.ok("SET_LEDS", p.SetLeds(RED))
    core.advance(2000)
    core.ok("BOOTLOADER", p.Magic(p.BOOTLOADER_MAGIC))
    assert core.flags & 6 == 0
    core.advance(50_000)
    assert core.flags & 6 == 6
    assert core.light == BLACK


@pytest.mark.parametrize("leds", [5, 24])
def test_another_number_of_leds_counts_from_the_next_start_on(core: VirtualBoard, leds: int) -> None:
    """Sequence, current and length of a request go by it."""
    colours = bytes(range(3 * leds))
    core.ok("SET_CONFIG", dataclasses.replace(named("large"), led_count=leds))
    core.ok("SAVE_CONFIG")
    assert core.ask("SET_LEDS", p.SetLeds(colours))[:2] == (Status.BAD_LENGTH, 3 * leds)
    again = core.restarted()
    again.led_count = leds
    assert again.ok("HELLO").led_count == leds
    assert again.ok("SET_LEDS", p.SetLeds(colours)).current_ma == -(
        -(leds * 1000 + -(-sum(colours) * 20000 // 255)) // 1000
    )
    assert again.ask("SET_LEDS", p.SetLeds(RED))[:2] == (Status.BAD_LENGTH, 36)
    again.play([colours, colours[::-1]], [p.SetStep(k, k, 1, 5000, 0) for k in range(2)])
    again.advance(20_000)
    assert [light[2] for light in again.lights()[-2:]] in ([colours, colours[::-1]], [colours[::-1], colours])


@pytest.mark.parametrize(
    "fields",
    [
        {"data_pin": 3},
        {"output_pin": 2},
        {"status_pin": p.ACTIVE_LOW + 2},
        {"data_pin": 30},
        {"data_pin": p.NO_PIN},
        {"trigger_pin": p.NO_PIN},
        {"switch_pin": 3},
        {"switch_pin": p.ACTIVE_LOW + 25},
        {"hottest_c": 39},
        {"hottest_c": 86},
        {"led_count": 0},
        {"led_count": 25},
        {"colour_order": 3},
        {"output_at": 2},
    ],
)
def test_what_a_board_cannot_be_is_refused(core: VirtualBoard, fields: dict[str, int]) -> None:
    assert core.ask("SET_CONFIG", dataclasses.replace(named("mixed up"), **fields))[0] == Status.OUT_OF_RANGE
