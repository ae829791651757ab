"""What the converter reads at its pins: the divider of an NTC, the pulls of the pad, or nothing at all."""

from collections.abc import Callable
from dataclasses import dataclass
from math import inf
from random import Random
from typing import Any

FIRST_INPUT, INPUTS = 26, 4
"""GPIO26 to 29 are channels 0 to 3"""
PULL_OHM = 60e3
"""of a pad; the data sheet says 50 to 80 kohm"""
PULL_DOWN, PULL_UP, INPUT_ON, OUTPUT_OFF = 1 << 2, 1 << 3, 1 << 6, 1 << 7
"""of a pad"""
FULL = 4096
THERMISTOR_PIN = 26
"""of the carrier"""
SEED = 1


@dataclass(frozen=True, kw_only=True)
class Divider:
    """Resistors at an input, ohm; inf: not there."""

    to_supply: float = 10e3
    to_ground: float


class AnalogInputs:
    """The pins of the converter; a `Divider` hangs at one of them, or none."""

    def __init__(self, chip: Any, divider: Callable[[int], Divider | None], report: Callable[[str], None]) -> None:
        """Let the converter of a chip read `divider` of a GPIO."""
        self._chip, self._divider, self._report = chip, divider, report
        self._convert, self._floating = chip.adc.on_adc_read, Random(SEED)
        chip.adc.on_adc_read = self._read

    def _read(self, channel: int) -> None:
        if channel < INPUTS:
            self._chip.adc.channel_values[channel] = self._reading(FIRST_INPUT + channel)
        self._convert(channel)

    def _reading(self, pin: int) -> int:
        pad = self._chip.gpio[pin].pad_value
        if pad & INPUT_ON or not pad & OUTPUT_OFF:  # data sheet 4.9
            self._report(f"ADC: GPIO{pin} is converted while its digital input or output is on")
        there = self._divider(pin) or Divider(to_supply=inf, to_ground=inf)
        up = 1 / there.to_supply + bool(pad & PULL_UP) / PULL_OHM
        down = 1 / max(there.to_ground, 1e-3) + bool(pad & PULL_DOWN) / PULL_OHM
        share = up / (up + down) if up + down else self._floating.random()
        return min(FULL - 1, int(share * FULL))
