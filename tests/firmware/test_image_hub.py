"""Erratum RP2040-E5: silicon B0 and B1 on a hub where other devices are talking, and what the committed image does."""

from collections.abc import Callable
from pathlib import Path

from tests.firmware.emulator.busy_bus import B1, DATA_PLUS
from tests.firmware.helpers.wiring import wired
from tests.helpers.bench_board import BenchBoard

OLDER = Path(__file__).parent / "images/firmware-1.1.bin"
ENUMERATED_US = 300_000


def touched(board: BenchBoard) -> list[int]:
    """Every value that is written to CTRL of GPIO15 from now on."""
    written: list[int] = []
    pins = board.chip.peripherals[0x40014]
    write: Callable[[int, int, int], None] = pins.write_uint32_atomic

    def note(offset: int, value: int, alias: int) -> None:
        if offset == 4 + 8 * DATA_PLUS:
            written.append(value)
        write(offset, value, alias)

    pins.write_uint32_atomic = note
    return written


def test_it_joins_again_after_every_reset(image: bytes) -> None:
    board = BenchBoard(image, revision=B1, busy_hub=True)
    for _ in range(3):
        assert board.run_until(lambda: board.host.configured, ENUMERATED_US)
        board.run(2_000)
        board.host.reset_bus()
        board.run(12_000)  # the device has seen it, and forces nothing yet
        board.host.reset_bus()
    assert board.run_until(lambda: board.host.configured, ENUMERATED_US)
    assert board.faults == []


def test_the_older_image_does_not_join(image: bytes) -> None:
    board = BenchBoard(OLDER.read_bytes(), revision=B1, busy_hub=True)
    assert not board.run_until(lambda: board.host.configured, ENUMERATED_US)
    assert any("RP2040-E5" in fault for fault in board.faults)


def test_a_pin_that_is_in_use_is_left_alone(image: bytes) -> None:
    """Then a busy hub may fail, as the README says; the pin does what it was configured for."""
    board = wired(image, status_pin=DATA_PLUS, revision=B1)
    written = touched(board)
    board.run_until(lambda: board.host.configured, ENUMERATED_US)
    board.run(100_000)
    assert all(value & 31 == 5 for value in written)
    assert board.faults == []
