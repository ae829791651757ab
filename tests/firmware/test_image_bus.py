"""The committed image on an emulated RP2040: its bus, itself, its flash."""

import dataclasses
import struct

import numpy as np
import pytest

from gellight.base.errors import BoardError
from gellight.ring import protocol as p
from gellight.ring.enumerations import Check, SyncMode
from gellight.ring.firmware.image import FLASH_BASE, HEADER, header_at, image_crc
from gellight.ring.light_ring import LightRing, Step
from tests.helpers import usb_requests as usb
from tests.helpers.bench_board import GREEN, RED, BenchBoard, VirtualTransport

# ---- the bus ----


def test_unplug_and_replug_in_mid_sequence(board: BenchBoard) -> None:
    ring = LightRing(VirtualTransport(board), keep_alive_s=None, timeout_s=0.02, attempts=2)
    ring.load_sequence([RED], [Step(group=0, dwell_us=5_000)])
    ring.set_sync(SyncMode.FREE)
    ring.start()
    board.run(20_000)
    assert board.lit.any()
    board.power_off()
    assert not board.lit.any()
    with pytest.raises(BoardError, match="did not answer"):
        ring.status()
    ring.close()
    board.power_on()
    with LightRing(VirtualTransport(board), keep_alive_s=None) as again:
        assert again.status().state == 0
        again.set_leds(GREEN)
        board.run(2_000)
        np.testing.assert_array_equal(board.lit, GREEN)


def test_a_resume_opens_no_port_that_was_closed(board: BenchBoard, ring: LightRing) -> None:
    ring.close()
    board.suspend()
    board.run(5_000)
    board.resume()
    board.run(5_000)
    board.host.send(b"\x01\x01\0")
    board.run(5_000)
    assert not board.host.received


def test_what_does_not_fit_its_request_is_refused(board: BenchBoard, ring: LightRing) -> None:
    """Bytes that nobody takes, fewer than were told, an interface that is not there."""
    coding = (0x21, 0x20, 0, 0)
    refused = (
        ((*coding, 2), b"\x55\x66"), ((*coding, 0), b""), ((*coding, 8), bytes(8)), ((*coding, 7), bytes(3)),
        ((0x21, 0x22, 3, 0, 1), b"\0"), ((0x81, 0, 0, 2, 2), b""),
    )  # fmt: skip
    taken = (((0x81, 0, 0, 1, 2), b""), ((*coding, 7), b"\x80\x25\0\0\0\0\x08"))
    answers = []
    for request, data in refused + taken:
        answers.append(usb.ask(board, request, data))
        board.run(1_000)
        answers.append(usb.ask(board, usb.GET_LINE_CODING))
        board.run(1_000)
    assert answers[:-4] == [None, usb.LINE_CODING] * len(refused)
    assert answers[-4:] == [bytes(2), usb.LINE_CODING, b"", taken[1][1]]


@pytest.mark.parametrize("after_us", [20, 400, 700, 1_100])
def test_a_reset_in_mid_transfer_enumerates_anew(image: bytes, after_us: float) -> None:
    board = BenchBoard(image)
    with LightRing(VirtualTransport(board), keep_alive_s=None) as ring:
        ring.set_leds(RED)
        board.run(2_000)
        board.host.latency_us = 300.0
        board.host.control(*usb.GET_CONFIGURATION, lambda _: None)
        board.run(after_us)
        board.host.reset_bus()
        board.host.latency_us = 0.0
        assert board.run_until(lambda: board.host.configured, 200_000)
        board.run(3_000)
        assert not board.lit.any()
    with LightRing(VirtualTransport(board), keep_alive_s=None) as again:
        again.set_leds(RED)
        board.run(2_000)
        assert board.lit.any()
    assert board.faults == []


# ---- itself ----


def test_the_self_test_passes_and_the_stack_is_bounded(board: BenchBoard, ring: LightRing, image: bytes) -> None:
    board.run(2_000)
    result = ring.self_test()
    assert result.failed == 0
    assert result.tested == Check.IMAGE | Check.LIGHT_PATH | Check.STACK
    assert result.image_crc == ring.hello.image_crc == image_crc(image)
    assert result.stack_free > 2048


def test_a_power_cut_while_saving_keeps_the_configuration_before(board: BenchBoard, ring: LightRing) -> None:
    board.run(2_000)
    first = dataclasses.replace(ring.configuration(), name=b"first".ljust(16, b"\0"))
    ring.configure(first, save=True)
    for cut in (0, 1, 40, 200, 255):
        transport = VirtualTransport(board)
        now = LightRing(transport, keep_alive_s=None, timeout_s=0.02, attempts=1)
        board.run(2_000)
        assert now.configuration() == first
        board.cut_after = cut
        with pytest.raises(BoardError, match="did not answer"):
            now.configure(dataclasses.replace(first, name=b"second".ljust(16, b"\0")), save=True)
        assert not board.powered
        board.power_on()


def test_no_restart_gives_a_save_but_power_does(board: BenchBoard, ring: LightRing) -> None:
    def save(name: bytes) -> None:
        again = LightRing(VirtualTransport(board), keep_alive_s=None)
        board.run(2_000)
        again.configure(dataclasses.replace(again.configuration(), name=name.ljust(16, b"\0")), save=True)

    for number in range(p.SAVES_AT_ONCE):
        save(b"%d" % number)
        if number % 2:
            LightRing(VirtualTransport(board), keep_alive_s=None).reset()
        else:
            board.chip.write_uint32(0x40058000, 1 << 31)  # the watchdog, by force
        board.run(200_000)
    with pytest.raises(BoardError, match=r"SAVED_TOO_OFTEN \(60\); its flash wears out"):
        save(b"one more")
    board.power_off()
    board.power_on()
    save(b"with power")


def test_picotool_finds_name_version_and_pins(image: bytes, ring: LightRing) -> None:
    told = binary_info(image)
    hello, factory = ring.hello, ring.configuration()
    version = f"{hello.firmware_major}.{hello.firmware_minor}.{hello.firmware_patch}"
    assert told[PROGRAM_NAME] == "GelLight light ring"
    assert told[PROGRAM_VERSION] == version
    pins = {number: told[1 << number].removesuffix(" (default)") for number in range(30) if 1 << number in told}
    assert pins == {factory.data_pin: "LEDs", factory.trigger_pin: "trigger", factory.status_pin: "status LED"}


PROGRAM_NAME, PROGRAM_VERSION = 0x02031C86, 0x11A9BC3A


def binary_info(image: bytes) -> dict[int, str]:
    """The texts of the pico-sdk's binary_info, by their identities or by a mask of pins, found as picotool does."""

    def words(address: int, count: int) -> tuple[int, ...]:
        return struct.unpack_from(f"<{count}I", image, address - FLASH_BASE)

    first = words(FLASH_BASE + 256, 64)
    at = first.index(0x7188EBF2)
    start, end, moved, stop = first[at + 1 : at + 5]
    assert stop == 0xE71AA390
    assert words(moved, 1) == (0,)
    told = {}
    for entry in words(start, (end - start) // 4):
        kind, what, text = words(entry, 3)
        assert kind in (0x5052 << 16 | 6, 0x5052 << 16 | 9)
        told[what] = image[text - FLASH_BASE :].partition(b"\0")[0].decode()
    return told


def test_the_image_is_small(image: bytes) -> None:
    """1 % of the flash: copying it to RAM holds the first darkness up by 7 ms at 30 MHz."""
    count = HEADER.unpack_from(image, header_at(image))[1]
    assert header_at(image) + HEADER.size + count <= (2 << 20) // 100
