"""Short checks of a firmware image in the emulator; a sound image passes all of them."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import islice

import numpy as np

from gellight.base.errors import BoardError
from gellight.ring import protocol as p
from gellight.ring.enumerations import Dark, ResetReason, SyncMode
from gellight.ring.heat import ring_temperature_c
from gellight.ring.light_ring import LightRing, Step
from gellight.ring.wire import Packet, encode
from tests.firmware.emulator.busy_bus import B1, B2, DATA_PLUS
from tests.firmware.emulator.flash_chip import WORN_ERASE_NS
from tests.firmware.helpers.examined import PATTERN, break_down, bus, dark, refusals, reopen, wiring
from tests.helpers.bench_board import BenchBoard, VirtualTransport

TRIGGER_DELAY_US, EDGE_TOLERANCE_US = 300.0, 3.0
DMA_LEFT, DMA_ABORT, PIO_CLEAR = 0x50000008, 0x50000444, 0x50203000
"""words that channel 0 still has; registers that end a transfer, and that stop state machines"""
OTHER_TRIGGER = 22
"""whose bits do not lie where those of the usual one lie in the registers of eight pins"""


def examine(image: bytes, check: str) -> list[str]:
    """Return what is wrong with an image by one check, which stops at the first problem; empty for a sound image."""
    board = BenchBoard(image)
    try:
        ring = LightRing(VirtualTransport(board), keep_alive_s=None, timeout_s=0.03, attempts=2)
        problems = list(islice(CHECKS[check](board, ring), 1))
    except (BoardError, IndexError, AssertionError) as error:  # no frame on the pin, or no answer to a request
        problems = [str(error) or "nothing came"]
    return board.faults + problems


def _colours(board: BenchBoard, ring: LightRing) -> Iterator[str]:
    if board.usb_text("serial") != board.unique_id.hex().upper():
        yield "unique number"
    if [board.usb_text(name) for name in ("manufacturer", "product")] != ["GelLight", "GelLight light ring"]:
        yield "its name"
    ring.set_leds(PATTERN)
    ring.set_leds(PATTERN)
    board.run(3_000)
    if not np.array_equal(board.lit, PATTERN):
        yield "colours"


def _sequence(board: BenchBoard, ring: LightRing) -> Iterator[str]:
    ring.load_sequence([PATTERN], [Step(group=0, dwell_us=2_011)])
    ring.set_sync(SyncMode.FREE)
    since = len(board.waveform.frame_starts_us)
    ring.start()
    for number in range(800):  # so that the interrupt of USB is busy when a step falls due; then quiet
        board.host.send(encode(Packet(p.COMMANDS["CLOCK"].code, number & 255, bytes(8))))
    board.run(90_000)
    times = np.array(board.waveform.frame_starts_us[since:])
    ring.blank()
    board.run(3_000)
    planned = times[:1] + 2_011 * np.arange(len(times))
    if len(times) < 8 or np.abs(times - planned).max() > 1:
        yield "steps are not on time"


def _trimmed(board: BenchBoard, ring: LightRing) -> Iterator[str]:
    """Long durations stretched: a product of the run-time library with a carry in the middle."""
    ring.load_sequence([PATTERN], [Step(group=0, dwell_us=60_011)])
    ring.set_sync(SyncMode.FREE)
    ring.start()
    ring.trim(period=0.00987)
    board.run(70_000)
    since = len(board.waveform.frame_starts_us)
    board.run(600_000)
    times = np.array(board.waveform.frame_starts_us[since:])
    ring.blank()
    board.run(3_000)
    planned = times[:1] + 60_011 * 1.00987 * np.arange(len(times))
    if len(times) < 8 or np.abs(times - planned).max() > 1.5:
        yield "stretched steps are not on time"


def _torn(board: BenchBoard, ring: LightRing) -> Iterator[str]:
    """A light of which words are left in the DMA, or in the FIFO, is never told as latched: the chip starts anew."""
    for register, value, left in ((DMA_ABORT, 1, 5), (PIO_CLEAR, 1, 0)):
        ring.set_leds(PATTERN)
        board.run(3_000)
        resets = board.resets
        ring.set_leds(PATTERN[::-1])
        for wanted in (5, left):
            board.run_until(lambda wanted=wanted: board.chip.read_uint32(DMA_LEFT) == wanted, 1_000)
        board.chip.write_uint32(register, value)
        if not board.run_until(lambda resets=resets: board.resets > resets, 250_000):
            yield "a light that broke off passes for one that was latched"
        ring = reopen(board)
        board.faults.clear()  # the bits that were torn


def _trigger(board: BenchBoard, ring: LightRing) -> Iterator[str]:
    yield from _pulled(board, ring, p.Configuration.trigger_pin)


def _pulled(board: BenchBoard, ring: LightRing, pin: int) -> Iterator[str]:
    """Wait for an edge at the pin of the trigger."""
    ring.set_sync(SyncMode.EXT, delay_us=round(TRIGGER_DELAY_US))
    ring.load_sequence([PATTERN], [Step(group=0, dwell_us=2_011)])
    ring.start()
    board.run(3_000)
    since = len(board.waveform.frame_starts_us)
    board.chip.gpio[pin].set_input_value(True)
    edge = board.now_us
    board.run(3_000)
    board.chip.gpio[pin].set_input_value(False)
    ring.blank()
    late = board.waveform.frame_starts_us[since] - edge - TRIGGER_DELAY_US
    if abs(late) > EDGE_TOLERANCE_US:
        yield f"trigger off by {late} us"


def _configuration(board: BenchBoard, ring: LightRing) -> Iterator[str]:
    """Twice, first on a worn chip, which takes as long to erase as any may; and read the flash after it."""
    board.run(3_000)
    before = bytes(board.flash[: 1 << 20])
    ring.timeout_s, board.flash_chip.erase_ns = 0.6, WORN_ERASE_NS
    ring.configure(p.Configuration(900, 410, 1000, 20000, 300, 0, 0, b"worn".ljust(16, b"\0")), save=True)
    if board.resets or ring.self_test().failed:
        yield "the watchdog bites while the flash is erased, or the flash cannot be read afterwards"
    ring.configure(p.Configuration(900, 400, 1000, 20000, 300, 0, 0, b"mutant".ljust(16, b"\0")), save=True)
    if bytes(board.flash[: 1 << 20]) != before:
        yield "the image in flash was changed"
    board.power_off()
    board.power_on()
    again = reopen(board)
    if again.configuration().name.rstrip(b"\0") != b"mutant":
        yield "configuration lost"


def _flood(board: BenchBoard, ring: LightRing) -> Iterator[str]:
    before = ring.counters()
    code = p.COMMANDS["SELFTEST"].code  # 60 ms of work, while bytes pile up
    board.run(3_000)
    board.host.send(encode(Packet(code, 200, b"")))
    for number in range(150):
        board.host.send(encode(Packet(p.COMMANDS["CLOCK"].code, number, bytes(8))))
    board.run_until(lambda: not board.host.unsent, 400_000)
    board.run(40_000)
    after = ring.counters()
    damaged = after.bad_framing + after.bad_crc - before.bad_framing - before.bad_crc
    if after.packets - before.packets != 152 or damaged:
        yield "packets lost"


def _suspend(board: BenchBoard, ring: LightRing) -> Iterator[str]:
    ring.set_leds(PATTERN)
    board.run(3_000)
    board.suspend()
    if not dark(board):
        yield "lit while suspended"
    reopen(board)


def _close(board: BenchBoard, ring: LightRing) -> Iterator[str]:
    for after_us in (1_300, 2_000):  # at one of them both happens while the main loop is busy
        ring.set_leds(PATTERN)
        for number in range(30):
            board.host.send(encode(Packet(p.COMMANDS["COMMIT"].code, number, p.Commit(0, 0, 32).pack())))
        board.run(after_us)
        board.host.close()
        board.host.open()
        if not dark(board):
            yield "lit after closing"
        ring = reopen(board)


def _short_packets(board: BenchBoard, ring: LightRing) -> Iterator[str]:
    """Answers of 192 bytes pile up behind one that the host fetches late: packets of 64 bytes would end no read."""
    group = p.SetGroup(15, bytes(36)).pack()
    piled = [("HELLO", b"")] * 3 + [("SET_GROUP", group)] * 2 + [("CLOCK", bytes(8))] * 2
    for _ in range(3):  # at different places of a USB frame
        ring.clock()
        board.run(290)
        board.host.received.clear()
        board.host.latency_us = 3_000.0
        for number, (name, record) in enumerate(piled):
            board.host.send(encode(Packet(p.COMMANDS[name].code, 210 + number, record)))
        board.run(20_000)
        board.host.latency_us = 0.0
        if board.host.received.count(0) != len(piled):
            yield "an answer waits for the next one"
        late = bytes(board.host.received).split(b"\0")[1:]
        if sum(len(answer) + 1 for answer in late if answer) % 64:
            yield "what piles up is no whole number of packets of 64 bytes: choose other answers"


def _long_rest(board: BenchBoard, ring: LightRing) -> Iterator[str]:
    """What the board says after ten seconds in which nobody said anything has to wait for its place in a USB frame."""
    ring.configure(replace(ring.configuration(), host_timeout_ms=10_100))
    for place_us in range(0, 1000, 200):
        ring.set_leds(PATTERN)
        board.run(1000 - (board.now_us - place_us) % 1000)
        ring.clock()
        board.run(10_130_000)
        if not board.host.opened:
            yield "a controller that works is reset as one that hangs"
        if ring.status().dark != Dark.HOST_SILENT:
            yield "lit without a host"


def _heat(board: BenchBoard, ring: LightRing) -> Iterator[str]:
    for celsius, dimmed in ((20.0, 0), (70.0, 1)):
        board.set_temperature(celsius)
        for _ in range(8):
            ring.clock()
            board.run(900_000)
        status = ring.status()
        if abs(status.temperature / 10 - celsius) > 0.5 or status.dimmed != dimmed:
            yield f"says {status} at {celsius} degrees"
    board.set_temperature(20.0)
    for ring_c, dimmed in ((None, 0), (40.0, 0), (66.0, 1), (25.0, 0)):
        if ring_c is not None:
            board.set_ring_temperature(ring_c)
        for _ in range(12):
            ring.clock()
            board.run(900_000)
        said, known = ring.status(), ring_temperature_c(ring.status())
        right = known is None if ring_c is None else known is not None and abs(known - ring_c) < 0.5
        if not right or said.dimmed != dimmed:
            yield f"says {said} with a ring at {ring_c} degrees"


def _watchdog(board: BenchBoard, ring: LightRing) -> Iterator[str]:
    """Let the processor hang with interrupts off."""
    resets, core = board.resets, board.chip.core
    board.chip.write_uint32(0x2003FF00, 0xE7FEE7FE)
    core.pc, core.pm, core.waiting = 0x2003FF00, True, False
    if not board.run_until(lambda: board.resets > resets, 150_000):
        yield "the watchdog does not bite"
    reopen(board)


def _fault(board: BenchBoard, ring: LightRing) -> Iterator[str]:
    ring.set_leds(PATTERN)
    board.run(3_000)
    resets = board.resets
    ring.set_leds(PATTERN)
    board.run_until(lambda: board.waveform.frame_starts_us[-1] > board.now_us - 100, 1_000)
    break_down(board)
    board.run_until(lambda: board.resets > resets, 150_000)
    if board.lit.any():
        yield "lit after a fault"
    again = reopen(board)
    if again.hello.reset_reason != ResetReason.FAULT:
        yield "the fault is not told"


def _start_fault(board: BenchBoard, ring: LightRing) -> Iterator[str]:
    if board.resets or ring.hello.reset_reason != ResetReason.POWER:
        yield "a start by power is told as another, or the watchdog bites while the crystal settles"
    board.power_off()
    board.power_on()
    resets = board.resets
    board.run(30_000)
    break_down(board)
    if not board.run_until(lambda: board.resets > resets, 1_000):
        yield "a fault at the start does not start anew"
        return
    again = reopen(board)
    if again.hello.reset_reason != ResetReason.FAULT:
        yield "a fault at the start is not told"


def _reflash(board: BenchBoard, ring: LightRing) -> Iterator[str]:
    ring.enter_bootloader()
    board.run_until(lambda: board.in_bootloader, 100_000)
    board.leave_bootloader()
    again = reopen(board)
    if again.hello.reset_reason != ResetReason.COMMAND:
        yield "a start after flashing is told as another"
    board.host.open(baud=1200)
    board.run(5_000)
    board.host.close()
    if not board.run_until(lambda: board.in_bootloader, 100_000):
        yield "1200 baud do not ask for the boot loader"


def _noise(board: BenchBoard, ring: LightRing) -> Iterator[str]:
    board.run(3_000)
    board.host.received.clear()
    board.host.send(b"\x55" * 768 + b"\0" + encode(Packet(p.COMMANDS["CLOCK"].code, 99, bytes(8))))
    # The frame of USB that begins next, and the one after it for what was sent as it began.
    if not board.run_until(lambda: board.host.received.count(0), 2_500):
        yield "a command behind noise waits"


def _paused(board: BenchBoard, ring: LightRing) -> Iterator[str]:
    ring.set_leds(PATTERN)
    board.run(30_000)
    board.host.latency_us = 9e6
    board.run(3_000_000)
    if not board.host.opened:
        yield "a host that does not read loses its port"


def _hub(board: BenchBoard, ring: LightRing) -> Iterator[str]:
    """Silicon B1 joins a busy hub and gives GPIO15 back; nobody touches it on B2, or where it is in use."""
    for revision in (B1, B2):
        other = BenchBoard(bytes(board.flash), revision=revision, busy_hub=True)
        pin, taken = other.chip.gpio[DATA_PLUS], []
        if not other.run_until(lambda b=other, p=pin, t=taken: t.append(p.ctrl) or b.host.configured, 200_000):
            yield "does not join a busy hub"
        joined = pin.ctrl
        other.run(2_000)
        other.host.reset_bus()
        other.run(12_000)  # the device has seen it, and forces nothing yet
        other.host.reset_bus()
        if not other.run_until(lambda b=other: b.host.configured, 300_000):
            yield "does not join again after a reset"
        if {joined, pin.ctrl} != {taken[0]} or (revision == B2 and set(taken) != {taken[0]}):
            yield "GPIO15 is taken, or not given back"
        yield from other.faults
    ring.blank()
    board.run(3_000)
    before = ring.configuration()
    ring.configure(replace(before, status_pin=DATA_PLUS, trigger_pin=OTHER_TRIGGER), save=True)
    used = BenchBoard(bytes(board.flash), revision=B1)
    seen: set[int] = set()
    used.run_until(lambda: seen.add(used.chip.gpio[DATA_PLUS].ctrl & 31), 120_000)
    if not seen <= {5, 31}:
        yield "GPIO15 is taken while it is in use"
    yield from _pulled(used, reopen(used), OTHER_TRIGGER)
    ring.configure(before, save=True)


CHECKS: dict[str, Callable[[BenchBoard, LightRing], Iterator[str]]] = {
    check.__name__.strip("_"): check
    for check in (
        _colours, _hub, _short_packets, _long_rest, _sequence, _trimmed, _torn, _trigger, _configuration, _flood,
        _suspend, _close, _watchdog, _fault, _start_fault, _reflash, _heat, bus, wiring, _noise, _paused,
        refusals,
    )
}  # fmt: skip
