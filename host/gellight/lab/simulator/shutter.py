"""What a rolling shutter sees of pulsed light.

A WS2812B dims by pulse width: in every cycle of its own free-running oscillator a colour is on for value / 255 of the
cycle, and a new colour is taken over at the LED's next cycle, up to a whole one after it was latched. A rolling shutter
exposes each row at its own time. So a row's picture is the sum over the LEDs of their light, each weighted with how
long it was on while the row was exposed. Where the exposure is a whole number of cycles and the light does not change,
all rows see the same, and the weight is value / 255.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gellight.lab.core_board.light_timeline import Light

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Shutter:
    """When a camera exposes its rows, and how its LEDs pulse."""

    exposure_us: float = 8000.0
    readout_us: float = 12000.0
    """from the start of the first row to the start of the last"""
    transfer_us: float = 10000.0
    """from the end of the last row to the frame in the host"""
    pulse_period_us: float = 500.0
    """2 kHz, as a WS2812B-V5; older ones pulse at some 450 Hz"""

    @property
    def duration_us(self) -> float:
        """From the start of the first row to the end of the last."""
        return self.readout_us + self.exposure_us


def row_weights(lights: list[Light], start_us: float, rows: int, phases_us: Array, shutter: Shutter) -> Array:
    """(rows, 12, 3) share of full light that each row sees of each LED and colour.

    `lights` is what was latched from one pulse period before `start_us`, the start of the first row, to the end of the
    last; `phases_us` (12,) is when each LED's oscillator began a cycle.
    """
    if len(lights) == 1 and shutter.exposure_us % shutter.pulse_period_us == 0:
        return np.repeat(lights[0].colours[None] / 255.0, rows, axis=0)
    begins = start_us + shutter.readout_us * np.arange(rows) / max(rows - 1, 1)
    times = np.concatenate([begins, begins + shutter.exposure_us])
    on_us = on_time(lights, times, start_us, phases_us, shutter)
    return np.asarray((on_us[rows:] - on_us[:rows]) / shutter.exposure_us)


def on_time(lights: list[Light], times_us: Array, start_us: float, phases_us: Array, shutter: Shutter) -> Array:
    """(n, 12, 3) how long each colour has been on since its LED's last cycle before `start_us`, at `times_us` (n,)."""
    period, leds = shutter.pulse_period_us, np.arange(len(phases_us))
    first = phases_us + np.floor((start_us - phases_us) / period) * period
    count = int(np.ceil((start_us + shutter.duration_us - first.min()) / period)) + 1
    cycles = first[:, None] + period * np.arange(count)
    latched = np.searchsorted([light.time_us for light in lights], cycles, side="right") - 1
    duty = np.array([light.colours for light in lights])[np.maximum(latched, 0), leds[:, None]] / 255.0
    before = np.zeros((len(leds), count + 1, 3))
    np.cumsum(duty * period, axis=1, out=before[:, 1:])
    cycle = np.minimum(((times_us[:, None] - first) // period).astype(int), count - 1)
    inside = (times_us[:, None] - first - cycle * period)[..., None]
    return np.asarray(before[leds, cycle] + np.minimum(inside, duty[leds, cycle] * period))
