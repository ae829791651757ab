"""A hub where other devices are talking, and the silicon that does not join such a bus by itself (erratum RP2040-E5).

After a bus reset the controller of B0 and B1 waits for 800 us of the idle state J. Traffic for other devices, which a
hub passes on, interrupts it. So the firmware has to force J, by the override of GPIO15 (data sheet, RP2040-E5).
"""

from collections.abc import Callable
from typing import Any

B1, B2 = 1, 2
"""SYSINFO CHIP_ID, revision: of B0 and B1, and of B2"""
CHIP_ID = 0x00002927
RESET_NS, RECOVERY_NS = 3e6, 10e6
"""how long the reset goes on after the device has seen it, and how much later the first request comes"""
IDLE_NS = 800e3
LINE_STATE, IDLE_STATE, CONNECTED = 3 << 2, 1 << 2, 1 << 16
"""SIE_STATUS; no line state means that the host resets"""
MUXING, DIRECT, OVERRIDE = 0x74, 0x7C, 0x80
TO_PHY, TO_PADS = 0x9, 0xC
DATA_PLUS, DATA_MINUS, FUNCTION_USB, UNUSED = 15, 16, 8, 31
FORCED_HIGH = 3 << 16 | 2 << 12 | FUNCTION_USB
"""CTRL of GPIO15: input high, output off"""
BUS_KEEP = 0xC
PULL_UP, PULL_UP_OVERRIDE = 1 << 1, 1 << 2


class BusyBus:
    """What a controller sees of such a hub after a reset."""

    def __init__(self, chip: Any, revision: int, enumerate_: Callable[[], None], report: Callable[[str], None]) -> None:
        """Stand between the controller and the host, which begins by `enumerate_` once the reset is over."""
        self._chip, self._enumerate, self._report = chip, enumerate_, report
        self._waits = revision == B1
        self._registers = {MUXING: 0, DIRECT: 0, OVERRIDE: 0}
        self._ends_ns, self._joined = 0.0, True
        self._alarm = chip.clock.create_alarm(self._first_request)
        self._forced_ns: float | None = None
        chip.usb_ctrl.on_reset_received = self._reset

    def _reset(self) -> None:
        """The device has seen the beginning of a reset."""
        self._ends_ns = self._chip.clock.nanos + RESET_NS
        self._joined, self._forced_ns = not self._waits, None
        self._alarm.schedule(RESET_NS + RECOVERY_NS)

    def status(self, value: int) -> int:
        """Return SIE_STATUS with the state of the lines, and whether the controller has joined the bus."""
        self._look()
        resets = self._chip.clock.nanos < self._ends_ns
        return value & ~(LINE_STATE | CONNECTED) | (0 if resets else IDLE_STATE) | CONNECTED * self._joined

    def _look(self) -> None:
        if self._forced_ns is not None and self._chip.clock.nanos - self._forced_ns >= IDLE_NS:
            self._joined = True

    def write(self, offset: int, value: int) -> None:
        """Follow what the lines are taken from."""
        self._look()
        self._registers[offset] = value
        if offset != MUXING:
            return
        self._forced_ns = self._chip.clock.nanos if value == TO_PADS and self._forces() else None
        if value == TO_PADS and self._chip.clock.nanos < self._ends_ns:
            self._report("USB: J is forced while the host still resets the bus")

    def _forces(self) -> bool:
        plus, minus = self._chip.gpio[DATA_PLUS], self._chip.gpio[DATA_MINUS]
        if not (self._registers[DIRECT] & PULL_UP and self._registers[OVERRIDE] & PULL_UP_OVERRIDE):
            self._report("USB: the pull-up falls while the lines are taken from the pads")
        high = plus.ctrl == FORCED_HIGH and plus.pad_value & BUS_KEEP == BUS_KEEP
        return bool(high and minus.ctrl & 31 != FUNCTION_USB)

    def _first_request(self) -> None:
        self._look()
        if not self._joined:
            self._report("USB: a busy hub, and the controller has not joined the bus (erratum RP2040-E5)")
            return
        if self._registers[MUXING] != TO_PHY or self._registers[OVERRIDE]:
            self._report("USB: the lines do not come from the PHY when the host begins")
        self._enumerate()
