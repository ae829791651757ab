"""Checks of a firmware image: what a host may ask on the bus besides reading and writing."""

from collections.abc import Iterator
from dataclasses import replace

from gellight.ring import protocol as p
from gellight.ring.light_ring import LightRing
from gellight.ring.wire import Packet, encode
from tests.firmware.emulator.usb_host import ADDRESS
from tests.firmware.helpers.examined_board import PATTERN, dark, reopen
from tests.helpers import usb_requests as usb
from tests.helpers.bench_board import BenchBoard


def bus(board: BenchBoard, ring: LightRing) -> Iterator[str]:
    board.suspend()
    board.run(5_000)
    board.resume()
    ring.clock()
    device = board.host.descriptors["device"]
    for abandoned in (usb.GET_CONFIGURATION, usb.SET_ADDRESS, usb.GET_INTERFACE, usb.SEND_BREAK):
        if usb.ask_after_abandoning(board, abandoned, usb.GET_DEVICE) != device:
            yield "a transfer that was cut short answers the next"
    if board.chip.read_uint32(usb.ADDRESS_REGISTER) != ADDRESS:
        yield "the address of a transfer that was cut short"
    if usb.ask(board, usb.status_of(usb.NOTIFY_IN)) != b"\0\0":
        yield "the endpoint of notifications is not known"
    if usb.ask(board, usb.GET_LINE_CODING) != usb.LINE_CODING:
        yield "the line coding is another than the host has set"
    yield from _halt(board, ring)
    yield from _halted_for_long(board, ring)
    for request in (*[usb.CLEAR_HALT_IN] * 2, *[usb.CLEAR_HALT_OUT] * 2, usb.SET_INTERFACE, usb.SEND_BREAK):
        ring.clock()  # one packet between two of a kind
        if usb.ask(board, request) != b"":
            yield f"request {request} refused"
    board.host.reset_bus()
    board.run(5_000)
    ring = reopen(board)
    ring.set_leds(PATTERN)
    board.run(30_000)
    board.host.hangs = True
    if not board.run_until(lambda: not board.host.configured, 11_500_000) or not dark(board):
        yield "a controller that hangs is not reset in the dark"


def _halt(board: BenchBoard, ring: LightRing) -> Iterator[str]:
    """A packet that waits while its endpoint is halted comes after the halt."""
    board.host.latency_us = 10_000.0
    board.host.send(encode(Packet(p.COMMANDS["CLOCK"].code, 99, bytes(8))))
    board.run(3_000)
    board.host.latency_us = 0.0
    usb.ask(board, usb.halt(usb.BULK_IN))
    board.run(60_000)  # frames are noted meanwhile
    board.host.received.clear()
    if usb.BULK_IN not in board.host.stalled or usb.ask(board, usb.status_of(usb.BULK_IN)) != b"\1\0":
        yield "an endpoint that is halted does not stall"
    usb.ask(board, usb.clear_halt(usb.BULK_IN))
    board.run(3_000)
    if board.host.received.count(0) != 1:
        yield "a packet lost, or doubled, by a halt"


def _halted_for_long(board: BenchBoard, ring: LightRing) -> Iterator[str]:
    """A halt is no hang, and ends where a configuration is chosen (USB 2.0, 9.4.5)."""
    before = ring.configuration()
    ring.configure(replace(before, host_timeout_ms=5_000))
    ring.set_leds(PATTERN)
    usb.ask(board, usb.halt(usb.BULK_IN))
    board.host.send(encode(Packet(p.COMMANDS["CLOCK"].code, 99, bytes(8))))
    board.run(1_300_000)
    if not board.host.opened:
        yield "a controller whose host halted an endpoint is reset as one that hangs"
    usb.ask(board, usb.SET_CONFIGURATION)
    if usb.ask(board, usb.status_of(usb.BULK_IN)) != b"\0\0":
        yield "a halt outlives the choice of a configuration"
    board.host.open()
    board.run(5_000)
    ring.configure(before)


def refusals(board: BenchBoard, ring: LightRing) -> Iterator[str]:
    if usb.ask(board, (0x80, 6, 0x0600, 0, 10)) is not None:  # a qualifier, which a device without high speed refuses
        yield "a descriptor that is not there is given"
    if usb.ask(board, (0x21, 0x02, 1, 0, 2), b"\0\0") is not None:  # SET_COMM_FEATURE, which the board does not have
        yield "a request that is not known takes data"
    if usb.ask(board, usb.SET_OTHER_SETTING) is not None:
        yield "an alternate setting that is not there is chosen"
    ring.clock()
