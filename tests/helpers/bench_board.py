"""The emulated board on a workbench, and the cable to it, on virtual time.

Its power can fail, its chip be warmed, its trigger pin be driven, and its USB bus fall silent.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from gellight.base.errors import BoardError
from gellight.lab.core_board.light_timeline import Light, LightTimeline
from tests.firmware.emulator.chip import ROOM_C, TEMPERATURE_CHANNEL, USB, EmulatedBoard, temperature_reading
from tests.firmware.emulator.clocks import Crystal
from tests.firmware.emulator.registers import TIMER, UsbGuard
from tests.firmware.emulator.waveform import Strip, WaveformDecoder

RED, GREEN = (np.tile(np.array(c, np.uint8), (12, 1)) for c in ((200, 0, 0), (0, 200, 0)))
"""(12, 3) uint8 of the whole ring"""
USB_INTERRUPT = 5
SIE_STATUS, INTS = 0x50, 0x98
SUSPENDED, RESUMED, SUSPEND_INTERRUPT = 1 << 4, 1 << 11, 1 << 14


class SuspendingUsb(UsbGuard):
    """The USB controller on a bus that may fall silent, which is a suspend (data sheet of the RP2040, 4.1)."""

    def __init__(self, chip: Any, held: Callable[[], bool], report: Callable[[str], None]) -> None:
        super().__init__(chip, held, report)
        self._chip, self._suspended = chip, False

    def suspend(self, suspended: bool = True) -> None:
        """The host has been silent for 3 ms; or the firmware has noticed it."""
        self._suspended = suspended
        self._tell()

    def _tell(self) -> None:
        """The interrupt comes where INTE asks for it."""
        if self._suspended and self.inner._int_enable & SUSPEND_INTERRUPT:
            self._chip.set_interrupt(USB_INTERRUPT, True)
        else:
            self.inner.check_interrupts()

    def resume(self) -> None:
        """The host drives the bus again."""
        self.inner._sie_status |= RESUMED
        self.inner._sie_status_updated()

    def read_uint32(self, offset: int) -> int:
        value = super().read_uint32(offset)
        asked = self._suspended and self.inner._int_enable & SUSPEND_INTERRUPT
        return value | SUSPEND_INTERRUPT if offset == INTS and asked else value

    def write_uint32_atomic(self, offset: int, value: int, alias: int) -> None:
        if offset == SIE_STATUS and value & SUSPENDED and self._suspended:
            self.suspend(False)
            value &= ~SUSPENDED
        super().write_uint32_atomic(offset, value, alias)


class NotingDecoder(WaveformDecoder):
    """Remembers when each frame on the wire began."""

    def __init__(self, timeline: LightTimeline, report: Callable[[str], None], strip: Strip) -> None:
        super().__init__(timeline, report, strip)
        self.frame_starts_us: list[float] = []

    def _rise(self, time_ns: float) -> None:
        self.settle(time_ns)
        if not self._frame:
            self.frame_starts_us.append(time_ns / 1e3)
        super()._rise(time_ns)


class BenchBoard(EmulatedBoard):
    """A board to which everything can happen that happens to hardware."""

    usb_block = SuspendingUsb
    decoder = NotingDecoder
    waveform: NotingDecoder

    def __init__(self, image: bytes, **options: Any) -> None:
        self.powered = True
        self.temperature_c = ROOM_C
        self.cut_after: int | None = None
        """power fails after that many bytes of flash were erased or programmed"""
        self._cut = False
        super().__init__(image, **options)
        self.flash_chip.until_cut = self._until_cut

    def _start(self, scratch: list[int] | None = None, reason: int = 0, crystal: Crystal | None = None) -> None:
        super()._start(scratch, reason, crystal)
        self.set_temperature(self.temperature_c)

    @property
    def lit(self) -> np.ndarray:
        """(leds, 3) what the LEDs show now."""
        return self.timeline.at(self.now_us)

    def power_on(self) -> None:
        """Start the chip; RAM, scratch registers and the colours of the LEDs are lost."""
        self.powered = True
        self._start()

    def power_off(self) -> None:
        """Take the power away from chip and LEDs; the flash keeps what it has."""
        self._past_ns += self._chip_ns
        self._chip_ns = 0.0
        self.powered = False
        self.waveform.settle(self._past_ns)
        self.waveform._frame, self.waveform._high = [], False
        last_us = self.timeline[-1].time_us if len(self.timeline) else 0.0
        self.timeline.append(Light(max(self.now_us, last_us), self.waveform.strip.dark))

    def leave_bootloader(self) -> None:
        """Start what is in flash, as the boot ROM does when it has written an image: by the watchdog (2.8.4)."""
        assert self.in_bootloader
        self._restart()

    def set_temperature(self, temperature_c: float) -> None:
        """Warm the chip; it stays so warm when it starts anew."""
        self.temperature_c = temperature_c
        self.chip.adc.channel_values[TEMPERATURE_CHANNEL] = temperature_reading(temperature_c)

    @property
    def timer_began_us(self) -> float:
        """Virtual time at which the timer of the chip was 0, by the ticks of now."""
        guard: Any = self.chip.peripherals[TIMER]
        return float(self.now_us - guard.inner._micros())

    def usb_text(self, name: str) -> str:
        """Return a string descriptor, as the host read it: manufacturer, product or serial."""
        return self.host.descriptors.get(name, b"")[2:].decode("utf-16le")

    def suspend(self) -> None:
        controller: Any = self.chip.peripherals[USB]
        controller.suspend()

    def resume(self) -> None:
        """Wake the bus; a program that has the port open notices nothing."""
        controller: Any = self.chip.peripherals[USB]
        controller.resume()

    def _until_cut(self, count: int) -> int:
        """Erase or program; where the power fails before the end, only the bytes before that."""
        if self.cut_after is None:
            return count
        if self.cut_after < count:
            self._cut = self._halted = True
            count = self.cut_after
        self.cut_after -= count
        return count

    def _run_slice(self, most_ns: float, steps: int = 32) -> None:
        if not self.powered:
            self._chip_ns += most_ns
            return
        super()._run_slice(most_ns, steps)
        if self._cut:
            self._cut, self.cut_after = False, None
            self.power_off()


class VirtualTransport:
    """The USB cable to an emulated board in this process, on virtual time: a timeout passes in no time."""

    url = "virtual"

    def __init__(self, board: BenchBoard) -> None:
        """Wait for the board's USB, and raise DTR."""
        self.board = board
        if not board.run_until(lambda: board.host.configured, 200_000):
            raise BoardError(f"the firmware did not enumerate: {board.faults or 'no fault was noticed'}")
        board.host.open()
        board.run_until(lambda: board.host.opened, 100_000)

    def monotonic(self) -> float:
        """Return the board's time, s: what the host's timeouts go by."""
        return self.board.now_us / 1e6

    def write(self, data: bytes) -> None:
        self.board.host.send(data)

    def read(self, timeout_s: float) -> bytes:
        self.board.run_until(lambda: self.board.host.received, timeout_s * 1e6)
        data = bytes(self.board.host.received)
        self.board.host.received.clear()
        return data

    def close(self) -> None:
        """Drop DTR and give the board time to notice."""
        if self.board.powered:
            self.board.host.close()
            self.board.run(5_000)
