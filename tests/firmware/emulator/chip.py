"""An RP2040 with a flash chip and a ring of LEDs: PyPI's rp2040py, driven on virtual time with strict checks.

Everything the emulator warns of, every access to a block in reset, every bit on the LED pin that a WS2812B might
misread is a fault of the firmware; `faults` lists them. rp2040py is pinned: it models no PLL and no resets, and its
own loop stamps PIO edges late, so clocks, loop and USB host are ours.
"""

from collections.abc import Callable
from functools import partial
from math import inf
from random import Random
from types import SimpleNamespace
from typing import Any

from rp2040py.rp2040 import RP2040
from rp2040py.simulator import Simulator

from firmware.tools.build import boot2_crc
from gellight.lab.core_board.light_timeline import LightTimeline
from gellight.lab.core_board.simulated_board import thermistor_ohm
from gellight.ring.firmware.image import FLASH_BASE
from gellight.ring.protocol import Configuration
from tests.firmware.emulator import clocks, registers, ticks
from tests.firmware.emulator.analog import OUTPUT_OFF, THERMISTOR_PIN, AnalogInputs, Divider
from tests.firmware.emulator.bootrom import BOOT2_RAM, Function, rom_words
from tests.firmware.emulator.busy_bus import B2, CHIP_ID, BusyBus
from tests.firmware.emulator.flash_bus import RAN_ASTRAY, FlashBus, RomFlash
from tests.firmware.emulator.flash_chip import FlashChip
from tests.firmware.emulator.usb_host import UsbHost
from tests.firmware.emulator.waveform import Strip, WaveformDecoder

FLASH_BYTES = 2 << 20
RAM_BASE, RAM_END = 0x20000000, 0x20042000
PIO0, USB, PSM, ADC, IO_QSPI, WATCHDOG = 0x50200, registers.USB, 0x40010, 0x4004C, 0x40018, 0x40058
"""windows (address >> 12)"""
VTOR = 0xE000ED08
WATCHDOG_SELECTION, CRYSTAL, PROCESSOR, ALL_BUT_OSCILLATORS = 0x8, 1 << 1, 1 << 15, 0x1FFFC
"""PSM_WDSEL: what a watchdog resets (data sheet 2.13.5)"""
POWER_ON_SEED = 2040
CRYSTAL_WAIT_NS = 100_000.0
NEVER_DUE = 1 << 62
"""of the emulator's PIO: no state machine runs, or all of them wait"""
MOST_FAULTS = 50
UNIQUE_ID = bytes.fromhex("e6605838833a5d2f")
TEMPERATURE_CHANNEL = 4
ROOM_C = 25.0


def temperature_reading(temperature_c: float) -> int:
    """Return what the converter reads of the chip's sensor: 0.706 V at 27 degrees, -1.721 mV a degree (4.9.5)."""
    return round((0.706 - 0.001721 * (temperature_c - 27)) / 3.3 * 4096)


def log_of(report: Callable[[str], None]) -> SimpleNamespace:
    """Return a logger for the emulator, whose warnings are faults of the firmware."""

    def ignore(*_: object) -> None:
        pass

    def warn(*words: object) -> None:
        report("emulator: " + " ".join(map(str, words)))

    return SimpleNamespace(debug=ignore, info=ignore, warning=warn, warn=warn, error=warn)


class EmulatedBoard:
    """A board with power; `run` lets virtual time pass."""

    usb_block = registers.UsbGuard
    decoder = WaveformDecoder

    def __init__(self, image: bytes, *, unique_id: bytes = UNIQUE_ID, strip: Strip | None = None, revision: int = B2,
                 busy_hub: bool = False) -> None:  # fmt: skip
        """Flash an image and switch the power on; `strip` are the LEDs, by default those of a board as it comes.

        `busy_hub`: it hangs at a hub where other devices are talking.
        """
        self.unique_id, self.revision, self.busy_hub = unique_id, revision, busy_hub
        self.flash = bytearray(image.ljust(FLASH_BYTES, b"\xff"))
        self.faults: list[str] = []
        strip = strip or Strip()
        self.timeline = LightTimeline(strip.leds)
        self.waveform = self.decoder(self.timeline, self.fault, strip)
        self.dividers: dict[int, Divider] = {}
        """what hangs at inputs of the converter, by GPIO"""
        self.resets = 0
        self._rom_flash: RomFlash | None = None
        self.in_bootloader = False
        self._noise = Random(POWER_ON_SEED)
        self._past_ns = self._chip_ns = 0.0
        """before the last start of the chip, and since then"""
        self.flash_chip = FlashChip(self.flash, unique_id, self._flash_ns, self.fault)
        self._start()

    def fault(self, text: str) -> None:
        """Note something that real silicon or real LEDs would not forgive."""
        if len(self.faults) < MOST_FAULTS:
            self.faults.append(f"{self.now_us:.1f} us: {text}")

    @property
    def now_us(self) -> float:
        """Virtual time since the first power-on."""
        return (self._past_ns + self._chip_ns) / 1e3

    def _flash_ns(self) -> float:
        """What time it is for the flash, also within a function of the boot ROM."""
        return self._past_ns + self._chip_ns + (self._rom_flash.elapsed_ns if self._rom_flash else 0.0)

    def _start(self, scratch: list[int] | None = None, reason: int = 0, crystal: clocks.Crystal | None = None) -> None:
        chip = RP2040()
        for memory in ("sram", "usb_dpram"):  # hold anything at power-on (2.6.2), and outlast a reset
            kept = getattr(self.chip, memory) if scratch else self._noise.randbytes(len(getattr(chip, memory)))
            getattr(chip, memory)[:] = kept
        self.chip: RP2040 = chip
        chip.logger = log_of(self.fault)
        chip.load_bootrom(rom_words())
        chip.adc.channel_values[TEMPERATURE_CHANNEL] = temperature_reading(ROOM_C)
        AnalogInputs(chip, lambda pin: self.dividers.get(pin), self.fault)
        self._simulator = Simulator(rp2040=chip)
        chip.on_break = self._rom_function
        self._watchdog_fired = self._halted = False
        self._waits_until_ns = 0.0
        """the processor is inside a function of the boot ROM, which no interrupt ends"""
        chip.watchdog.on_watchdog_trigger = self._note_watchdog
        if scratch:
            chip.watchdog.scratch_data[:] = scratch
        chip.watchdog._reason = reason
        self._cycle_ns, self._skipped_ns = 1e9 / clocks.RING_OSCILLATOR_HZ, 0.0
        self._raised = False
        crystal = crystal or clocks.Crystal(lambda: self.now_us, self._pass_over)
        self.clocks = clocks.ClockTree(crystal, self.fault, self._reclock)
        self._install_registers(chip)
        self._pio_ns, self._pio_busy, self._pio_behind = 0.0, True, 0
        strip = self.waveform.strip
        chip.gpio[strip.pin].add_listener(lambda new, _old: self._pin_changed(int(new)))
        if strip.switch_pin is not None:
            self._switch_changed(-1)  # its pin is not driven any more
            chip.gpio[strip.switch_pin].add_listener(lambda new, _old: self._switch_changed(int(new)))
        self.host = UsbHost(chip.usb_ctrl, self.fault, lambda: self.clocks.usb_hz > 0)
        if self.busy_hub:
            self.usb_guard.bus = BusyBus(chip, self.revision, self.host.enumerate, self.fault)
        self._boot()

    def _install_registers(self, chip: Any) -> None:
        blocks, timer = chip.peripherals, ticks.Timer(chip)
        self.resets_block = registers.Resets(self._usb_held, timer.reset, lambda: self.now_us)
        blocks[registers.TIMER] = timer
        blocks[WATCHDOG] = self.ticks = ticks.Ticks(chip.watchdog, timer, lambda: self.clocks.reference_hz)
        blocks[0x4000C], blocks[0x40008], blocks[0x40024] = (
            self.resets_block,
            self.clocks.generators,
            self.clocks.crystal,
        )
        blocks[0x40000] = registers.RegisterBlock({0: self.revision << 28 | CHIP_ID})
        blocks[0x40028], blocks[0x4002C] = self.clocks.pll_sys, self.clocks.pll_usb
        blocks[0x18000] = bus = FlashBus(chip, self.flash_chip, self.clocks.set_flash_divider,
                                         lambda by: 8 * by * self._cycle_ns, self.fault)  # fmt: skip
        self._rom_flash = RomFlash(bus, blocks[IO_QSPI], lambda: self._cycle_ns, self.fault)
        for window, bit in registers.RESET_BITS.items():
            blocks[window] = registers.Guard(blocks[window], partial(self._held, bit), self.fault)
        blocks[PIO0] = registers.PioGuard(blocks[PIO0].inner, self._pio_held, self.fault)
        adc_held = partial(self._held, registers.RESET_BITS[ADC])
        blocks[ADC] = registers.AdcGuard(blocks[ADC].inner, adc_held, self.fault, lambda: self.clocks.adc_hz)
        self.usb_guard = self.usb_block(chip, partial(self._held, registers.RESET_BITS[USB]), self.fault)
        blocks[USB] = self.usb_guard

    def _usb_held(self) -> None:
        self.usb_guard.unplugged()
        self.host.unplugged()

    def _held(self, bit: int) -> bool:
        return bool(self.resets_block.held >> bit & 1)

    def _pio_held(self) -> bool:
        self._wake_pio()
        return self._held(registers.RESET_BITS[PIO0])

    def _reclock(self) -> None:
        self._cycle_ns = 1e9 / self.clocks.system_hz
        self.ticks.look()
        if self.clocks.raised and not self._raised:
            self._raised = True
            self._check_safety()

    def _check_safety(self) -> None:
        """Before the clock is raised a hang or a fault must already lead to a new start."""
        if not self.chip.watchdog.timer.enable:
            self.fault("the clock is raised before the watchdog runs")
        vectors = self.chip.read_uint32(VTOR)
        for number, name in ((2, "NMI"), (3, "HardFault")):
            handler = self.chip.read_uint32(vectors + 4 * number)
            code = FLASH_BASE < handler < FLASH_BASE + FLASH_BYTES or RAM_BASE < handler < RAM_END
            if not (handler & 1 and code):
                self.fault(f"the clock is raised while the vector of {name} holds 0x{handler:08x}, which is no code")

    def _pass_over(self) -> None:
        """Let time pass while the firmware waits for the crystal, instead of executing its loop for 64 ms."""
        self._skipped_ns, self._halted = CRYSTAL_WAIT_NS, True

    def _boot(self) -> None:
        """Do what the boot ROM does: accept boot2 by its checksum, copy it to RAM and call it."""
        boot2 = bytes(self.flash[:256])
        if boot2_crc(boot2[:252]) != int.from_bytes(boot2[252:], "little"):
            self.in_bootloader = True
            return
        self.in_bootloader = False
        for offset in range(0, 256, 4):
            self.chip.write_uint32(BOOT2_RAM + offset, int.from_bytes(boot2[offset : offset + 4], "little"))
        core = self.chip.core
        core.sp, core.pc = BOOT2_RAM, BOOT2_RAM
        core.registers[14] = 0

    def _note_watchdog(self) -> None:
        self._watchdog_fired = self._halted = True

    def _pin_changed(self, level: int) -> None:
        if level in (0, 1) and not self.chip.gpio[self.waveform.strip.pin].pad_value & OUTPUT_OFF:
            self.waveform.edge(self._past_ns + (self._pio_ns if self._pio_busy else self._chip_ns), bool(level))

    def _switch_changed(self, level: int) -> None:
        self.waveform.supply(self._past_ns + self._chip_ns, self.waveform.strip.powered(level))

    def _rom_function(self, number: int) -> None:
        if number == Function.UB:
            self.in_bootloader = self._halted = True
        elif number == RAN_ASTRAY:
            self._run_astray()
        elif number in set(Function):
            self._call_rom(Function(number))
        else:
            self.fault(f"breakpoint {number}")

    def _call_rom(self, function: Function) -> None:
        """Do what a function of the boot ROM does to the flash, and let the processor wait as long as it takes."""
        rom, values = self._rom_flash, self.chip.core.registers
        assert rom is not None
        if function in (Function.RE, Function.RP):
            self._check_caller(values[14])
        if function == Function.RE:
            rom.erase(values[0], values[1])
        elif function == Function.RP:
            rom.program(values[0], bytes(self.chip.read_uint8(values[1] + i) for i in range(values[2])))
        else:
            {Function.IF: rom.connect, Function.EX: rom.leave_xip, Function.FC: rom.flush,
             Function.CX: rom.enter_xip}[function]()  # fmt: skip
        self._wait(rom.elapsed_ns)
        rom.elapsed_ns = 0.0

    def _check_caller(self, returns_to: int) -> None:
        if not RAM_BASE <= returns_to < RAM_END:
            self.fault(f"the flash was changed by code at 0x{returns_to:x}, which is not RAM")
        if not self.chip.core.pm:
            self.fault("interrupts were on while the flash did not answer")

    def _wait(self, duration_ns: float) -> None:
        self._waits_until_ns = self._chip_ns + duration_ns
        self._halted = self.in_bootloader or duration_ns > 0

    def run(self, duration_us: float) -> None:
        self.run_until(lambda: False, duration_us)

    def set_trigger(self, high: bool) -> None:
        """Drive the trigger pin, to which a camera's strobe is wired."""
        self._wake_pio()
        self.chip.gpio[Configuration.trigger_pin].set_input_value(high)

    def set_ring_temperature(self, temperature_c: float | None) -> None:
        """Warm the NTC of the ring, as the carrier wires it; None: its wire is broken."""
        ohm = inf if temperature_c is None else thermistor_ohm(temperature_c)
        self.dividers[THERMISTOR_PIN] = Divider(to_ground=ohm)

    def run_until(self, reached: Callable[[], object], timeout_us: float) -> bool:
        """Run until the condition holds, looked at after every few instructions; False if time is up first."""
        end_us = self.now_us + timeout_us
        while True:
            if reached():
                return True
            left_us = end_us - self.now_us
            if left_us <= 0:
                return False
            if self.in_bootloader:
                self._chip_ns += left_us * 1e3
            else:
                self._run_slice(left_us * 1e3)
            self.waveform.settle(self._past_ns + self._chip_ns)

    def _run_slice(self, most_ns: float, steps: int = 32) -> None:
        if self._chip_ns < self._waits_until_ns:
            self._pass_time(min(self._chip_ns + most_ns, self._waits_until_ns))
        else:
            self._execute(most_ns, steps)
            if self.chip.core.pc >= RAM_END:
                self._run_astray()
        if self._skipped_ns:
            self._skip()
        if self._watchdog_fired:
            self._bite()

    def _run_astray(self) -> None:
        """A processor that is lost does nothing more, until the watchdog bites."""
        self.fault(f"the processor runs astray, at 0x{self.chip.core.pc:08x}")
        self._wait(inf)

    def _pass_time(self, end_ns: float) -> None:
        """Let the processor wait until something else is due."""
        self._halted = self.in_bootloader
        pio, cycle_ns = self.chip.pio[0], self._cycle_ns
        cycles = self._idle_cycles(pio, end_ns)
        self.chip.clock.tick(cycles * cycle_ns)
        if self._pio_busy:
            self._advance_pio(pio, cycles, cycle_ns)
        else:
            self._pio_behind += cycles
        self._chip_ns += cycles * cycle_ns

    def _execute(self, most_ns: float, steps: int) -> None:
        """Execute some instructions, or sleep until something is due."""
        core, pio, tick = self.chip.core, self.chip.pio[0], self.chip.clock.tick
        execute, chip_ns = core.execute_instruction, self._chip_ns
        end_ns = chip_ns + most_ns
        for _ in range(steps):
            cycle_ns, asleep = self._cycle_ns, core.waiting
            cycles = self._sleep_cycles(core, pio, end_ns) if asleep else execute()
            elapsed_ns = cycles * cycle_ns
            tick(elapsed_ns)
            if self._pio_busy:
                self._advance_pio(pio, cycles, cycle_ns)
            else:
                self._pio_behind += cycles
            self._chip_ns = chip_ns = chip_ns + elapsed_ns
            if asleep or chip_ns >= end_ns or self._halted:
                break

    def _skip(self) -> None:
        self._halted = self.in_bootloader
        self.chip.clock.tick(self._skipped_ns)
        self._chip_ns += self._skipped_ns
        self._pio_behind += round(self._skipped_ns / self._cycle_ns)
        self._skipped_ns = 0.0

    def _sleep_cycles(self, core: Any, pio: Any, end_ns: float) -> int:
        if core.pending_interrupts & core.enabled_interrupts:
            core.waiting = False  # an interrupt that was pending before the WFI ends it at once
            return 1
        return self._idle_cycles(pio, end_ns)

    def _idle_cycles(self, pio: Any, end_ns: float) -> int:
        """Cycles until something is due."""
        clock = self.chip.clock
        sleep = max(1, int((end_ns - self._chip_ns) // self._cycle_ns) + 1)
        if clock.has_scheduled_alarm:
            sleep = min(sleep, max(1, -int(-clock.nanos_to_next_alarm // self._cycle_ns)))
        due = pio.next_due_fp - pio.cycle_fp
        return max(1, -(-due >> 8)) if due < sleep << 8 else sleep

    def _advance_pio(self, pio: Any, cycles: int, cycle_ns: float) -> None:
        """Hand the PIO its cycles up to each instruction, so that every edge is stamped on its own cycle."""
        self._pio_ns = self._chip_ns
        while cycles:
            due = pio.next_due_fp - pio.cycle_fp
            step = cycles if due >= cycles << 8 else max(1, -(-due >> 8))
            self._pio_ns += step * cycle_ns
            pio.advance(step)
            cycles -= step
        self._pio_busy = pio.next_due_fp < NEVER_DUE

    def _wake_pio(self) -> None:
        """Give the PIO the cycles that passed while it had nothing to do, before it is given something to do."""
        if not self._pio_busy:
            self._pio_ns, self._pio_busy = self._chip_ns, True
            self.chip.pio[0].advance(self._pio_behind)
            self._pio_behind = 0

    def _bite(self) -> None:
        """Reset what the image told the watchdog to; where that is not the processor, it goes on (2.13)."""
        selected = self.chip.read_uint32(PSM << 12 | WATCHDOG_SELECTION)
        if left := ALL_BUT_OSCILLATORS & ~selected:
            self.fault(f"the watchdog bites, and does not reset 0x{left:05x} of what PSM_WDSEL knows")
        if selected & PROCESSOR:
            self._restart()
        else:
            self._watchdog_fired, self._halted = False, self.in_bootloader

    def _restart(self) -> None:
        """Start a new chip after the watchdog: flash and scratch registers stay, and so do LEDs and crystal."""
        self.resets += 1
        crystal = None if self.chip.read_uint32(PSM << 12 | WATCHDOG_SELECTION) & CRYSTAL else self.clocks.crystal
        scratch, reason = list(self.chip.watchdog.scratch_data), self.chip.watchdog.read_uint32(0x08)
        self._past_ns += self._chip_ns
        self._chip_ns = 0.0
        self._start(scratch, reason or 1, crystal)
