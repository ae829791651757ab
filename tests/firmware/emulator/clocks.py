"""The clocks of the emulated RP2040 (data sheet 2.15 to 2.18): crystal, PLLs, generators, and the rules they keep.

rp2040py models no PLL, and its crystal is stable at once. Here an image that breaks a rule of the data sheet gets a
fault, also where most chips on a desk would forgive it.
"""

from collections.abc import Callable

from tests.firmware.emulator.registers import RegisterBlock

CRYSTAL_HZ = 12e6
RING_OSCILLATOR_HZ = 6.5e6
SLOWEST_CRYSTAL_US = 64_000.0
"""until the crystal of some boards has settled, as they declare; the counter of XOSC knows nothing of that"""
VCO_HZ = (750e6, 1600e6)
FEEDBACK = (16, 320)
LOWEST_REFERENCE_HZ = 5e6
HIGHEST_SYSTEM_HZ = 133e6
USB_HZ = 48e6
SYSTEM_OVER_USB = 1.1
"""clk_sys / clk_usb, or SETUP and other status may be lost (erratum RP2040-E16)"""
SLOW_READ_HZ = 33e6
"""of the command 03h, which the slowest of the usual flash chips allow"""
CRYSTAL_RANGE = 0xAA0
"""1 to 15 MHz; the other values are reserved (data sheet 2.16.7)"""
LOCK_US = 20.0
"""until a PLL has locked; the data sheet (2.18.3) names no time, so an image has to look"""
POST_DIVIDERS_OFF = 1 << 3
"""of PWR"""
CTRL, STATUS, STARTUP = 0x0, 0x4, 0xC
"""of XOSC"""
CS, PWR, FBDIV, PRIM = 0x0, 0x4, 0x8, 0xC
"""of a PLL"""
REF_CTRL, REF_SELECTED, SYS_CTRL, SYS_DIV, SYS_SELECTED, USB_CTRL, ADC_CTRL = 0x30, 0x38, 0x3C, 0x40, 0x44, 0x54, 0x60
"""of CLOCKS"""


class Crystal(RegisterBlock):
    """XOSC with a slow crystal: STABLE only says that the counter of STARTUP is over."""

    def __init__(self, now_us: Callable[[], float], waiting: Callable[[], None]) -> None:
        """Stand still; `waiting` hears of each look at STATUS that comes too early."""
        super().__init__({STARTUP: 0xC4})
        self.now_us, self._waiting = now_us, waiting
        self._started_us: float | None = None

    def write_uint32(self, offset: int, value: int) -> None:
        """Set a register; CTRL starts or stops the crystal."""
        super().write_uint32(offset, value)
        starts = value >> 12 & 0xFFF == 0xFAB and value & 0xFFF == CRYSTAL_RANGE
        if offset == CTRL and starts and self._started_us is None:
            self._started_us = self.now_us()
        elif offset == CTRL and value >> 12 & 0xFFF == 0xD1E:
            self._started_us = None

    def read_uint32(self, offset: int) -> int:
        """STATUS carries STABLE and ENABLED."""
        if offset != STATUS:
            return super().read_uint32(offset)
        delay_us = (self.values[STARTUP] & 0x3FFF) * (4 if self.values[STARTUP] >> 20 & 1 else 1) * 256e6 / CRYSTAL_HZ
        stable = self._started_us is not None and self.running_us >= delay_us
        if not stable:
            self._waiting()
        return stable << 31 | (self._started_us is not None) << 12

    @property
    def running_us(self) -> float:
        """For how long it has been running."""
        return 0.0 if self._started_us is None else self.now_us() - self._started_us


class Pll(RegisterBlock):
    """A PLL: locks a while after it has got power and a feedback divider."""

    def __init__(self, changed: Callable[[], None], now_us: Callable[[], float]) -> None:
        """Tell when the frequency may have changed."""
        super().__init__({CS: 1, PWR: 0x2D, FBDIV: 0, PRIM: 0x77000})
        self._changed, self._now_us = changed, now_us
        self._loop, self._locks_us = 0.0, 0.0
        """what the VCO is held to, 0 without power; and when it has got there"""

    def read_uint32(self, offset: int) -> int:
        """CS carries the lock bit."""
        return super().read_uint32(offset) | (offset == CS and self.locked) << 31

    def write_uint32(self, offset: int, value: int) -> None:
        super().write_uint32(offset, value)
        loop = self.reference_hz * self.values[FBDIV] if self.oscillates else 0.0
        if loop != self._loop:
            self._loop, self._locks_us = loop, self._now_us() + LOCK_US
        self._changed()

    @property
    def locked(self) -> bool:
        """It has power, and has had the time that it needs."""
        return self.oscillates and self._now_us() >= self._locks_us

    @property
    def oscillates(self) -> bool:
        """PLL and VCO have power, and there is a feedback divider."""
        return bool(not self.values[PWR] & 0x21 and self.values[FBDIV])

    @property
    def reference_hz(self) -> float:
        """What the VCO is compared with."""
        return CRYSTAL_HZ / max(1, self.values[CS] & 63)

    @property
    def post_dividers(self) -> tuple[int, int]:
        """The first and the second."""
        return self.values[PRIM] >> 16 & 7, self.values[PRIM] >> 12 & 7

    @property
    def hz(self) -> float:
        """Output frequency, 0 while it is off."""
        first, second = self.post_dividers
        if not self.oscillates or self.values[PWR] & POST_DIVIDERS_OFF or not first * second:
            return 0.0
        return self.reference_hz * self.values[FBDIV] / (first * second)

    def violations(self) -> list[str]:
        """Name the limits of 2.18 that it breaks."""
        if not self.oscillates:
            return []
        found = []
        if self.reference_hz < LOWEST_REFERENCE_HZ:
            found.append(f"its reference is {self.reference_hz / 1e6:g} MHz, not 5 MHz or more")
        if not FEEDBACK[0] <= self.values[FBDIV] <= FEEDBACK[1]:
            found.append(f"its feedback divider is {self.values[FBDIV]}, not 16 to 320")
        vco_hz = self.reference_hz * self.values[FBDIV]
        if not VCO_HZ[0] <= vco_hz <= VCO_HZ[1]:
            found.append(f"its oscillator runs at {vco_hz / 1e6:g} MHz, not 750 to 1600 MHz")
        if self.values[PWR] & POST_DIVIDERS_OFF:
            return found
        if not self.locked:
            found.append("its post dividers get power before it has locked")
        first, second = self.post_dividers
        if not 1 <= second <= first:
            found.append(f"its post dividers are {first} and {second}, not 1 to 7 with the higher one first")
        return found


class Generators(RegisterBlock):
    """Clock generators: every switch succeeds at once."""

    def __init__(self, changed: Callable[[], None]) -> None:
        """Tell when a clock may have changed."""
        super().__init__({REF_CTRL: 0, SYS_CTRL: 0, SYS_DIV: 0x100, USB_CTRL: 0, ADC_CTRL: 0})
        self._changed = changed

    def read_uint32(self, offset: int) -> int:
        """SELECTED shows the source that was chosen."""
        if offset == REF_SELECTED:
            return int(1 << (self.values[REF_CTRL] & 3))
        if offset == SYS_SELECTED:
            return int(1 << (self.values[SYS_CTRL] & 1))
        return super().read_uint32(offset)

    def write_uint32(self, offset: int, value: int) -> None:
        super().write_uint32(offset, value)
        self._changed()


class ClockTree:
    """All that makes clk_sys and clk_usb; `report` hears of each broken rule once."""

    def __init__(self, crystal: Crystal, report: Callable[[str], None], changed: Callable[[], None]) -> None:
        """Run on the ring oscillator; tell when clk_sys may have changed."""
        self.crystal = crystal
        self.pll_sys, self.pll_usb = Pll(self._note, crystal.now_us), Pll(self._note, crystal.now_us)
        self.generators = Generators(self._note)
        self._report, self._changed = report, changed
        self._flash_divider = 0
        self._reported: set[str] = set()

    @property
    def raised(self) -> bool:
        """The ring oscillator is left."""
        return bool(self.generators.values[REF_CTRL] & 3 or self.generators.values[SYS_CTRL] & 1)

    @property
    def reference_hz(self) -> float:
        """Frequency of clk_ref, from which the tick of timer and watchdog is made."""
        return CRYSTAL_HZ if self.generators.values[REF_CTRL] & 3 == 2 else RING_OSCILLATOR_HZ

    @property
    def system_hz(self) -> float:
        """Frequency of clk_sys; a stopped source leaves the ring oscillator, as the data sheet's resuscitation."""
        control = self.generators.values[SYS_CTRL]
        auxiliary_hz = {0: self.pll_sys.hz, 1: self.pll_usb.hz}.get(control >> 5 & 7, 0.0) or RING_OSCILLATOR_HZ
        return (auxiliary_hz if control & 1 else self.reference_hz) / max(1, self.generators.values[SYS_DIV] >> 8)

    @property
    def usb_hz(self) -> float:
        """Frequency of clk_usb, 0 while it is off."""
        return self._from_plls(USB_CTRL)

    @property
    def adc_hz(self) -> float:
        """Frequency of clk_adc, 0 while it is off."""
        return self._from_plls(ADC_CTRL)

    def _from_plls(self, register: int) -> float:
        control = self.generators.values[register]
        return {0: self.pll_usb.hz, 1: self.pll_sys.hz}.get(control >> 5 & 7, 0.0) if control >> 11 & 1 else 0.0

    def set_flash_divider(self, divider: int) -> None:
        """Note what the serial interface to the flash divides clk_sys by."""
        self._flash_divider = divider
        self._note()

    def _note(self) -> None:
        self._changed()
        for text in self._violations():
            if text not in self._reported:
                self._reported.add(text)
                self._report(text)

    def _violations(self) -> list[str]:
        found = []
        in_use = self.generators.values[REF_CTRL] & 3 == 2 or self.pll_sys.oscillates or self.pll_usb.oscillates
        if in_use and self.crystal.running_us < SLOWEST_CRYSTAL_US:
            found.append("the crystal is used before it has settled: slow ones need 64 ms (data sheet 2.16.3)")
        for name, pll in (("PLL_SYS", self.pll_sys), ("PLL_USB", self.pll_usb)):
            found += [f"{name}: {text} (data sheet 2.18)" for text in pll.violations()]
        if self.system_hz > HIGHEST_SYSTEM_HZ:
            found.append(f"clk_sys is {self.system_hz / 1e6:g} MHz, more than 133 MHz (data sheet 2.15)")
        if self._flash_divider and self.system_hz / self._flash_divider > SLOW_READ_HZ:
            found.append(
                f"the flash is read at {self.system_hz / self._flash_divider / 1e6:g} MHz, above 33 MHz for 03h"
            )
        if self.usb_hz:
            found += self._usb_violations()
        return found

    def _usb_violations(self) -> list[str]:
        found = []
        if self.usb_hz != USB_HZ:
            found.append(f"clk_usb is {self.usb_hz / 1e6:g} MHz, not 48 MHz")
        if self.system_hz < SYSTEM_OVER_USB * self.usb_hz:
            found.append(f"clk_sys is {self.system_hz / 1e6:g} MHz, below 1.1 times clk_usb (erratum RP2040-E16)")
        return found
