"""What a rolling shutter sees of pulsed light.

A WS2812B dims by pulse width: in every cycle of its own free-running oscillator a colour is on for value / 255 of the
cycle, and a new colour is taken over at the LED's next cycle, up to a whole one after it was latched. A rolling shutter
exposes each row at its own time. So a row's picture is the sum over the LEDs of their light, each weighted with how
long it was on while the row was exposed. Where the exposure is a whole number of cycles and the light does not change,
all rows see the same, and the weight is value / 255.
"""

from collections.abc import Callable
from dataclasses import dataclass
from math import isfinite

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import CameraError, InputError
from gellight.lab.core_board.light_timeline import Light
from sim_reference.camera import WHITE

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


PLACES = 1 << 21
"""where the noise of a row may begin"""


class ReadNoise:
    """Digitises frames with Gaussian noise, white in space, and independent from frame to frame, shifted or not."""

    def __init__(self, rng: np.random.Generator) -> None:
        """Draw with `rng`, once a picture is there."""
        self._rng = rng
        self._bank = np.zeros(0, np.float32)
        self._noisy = np.zeros(0, np.float32)

    def digitise(self, grey: NDArray[np.float32], noise_grey: float) -> NDArray[np.uint8]:
        """Add noise to grey levels, round and clip them: (H, W, 3) uint8; as `sim_reference.camera.digitise`."""
        rows, row_values = grey.shape[0], grey[0].size
        if self._noisy.shape != grey.shape:
            self._bank = self._rng.standard_normal(PLACES + row_values, dtype=np.float32)
            self._noisy = np.empty(grey.shape, np.float32)
        noisy, by_row = self._noisy, self._noisy.reshape(rows, row_values)
        starts: NDArray[np.int64] = self._rng.integers(PLACES, size=(rows,))
        for row, start in enumerate(starts):
            by_row[row] = self._bank[start : start + row_values]
        noisy *= np.float32(noise_grey)
        noisy += grey
        np.rint(noisy, out=noisy)
        return np.clip(noisy, 0, WHITE, out=noisy).astype(np.uint8)


RANGES = {"exposure_us": (100.0, 30000.0, 100.0), "gain": (1.0, 8.0, 0.01), "white_balance_k": (2800.0, 6500.0, 10.0)}
"""smallest, largest and step of each control, as plain UVC cameras have them"""
DEFAULTS = {"exposure_us": 8000.0, "gain": 1.0, "white_balance_k": 4600.0}
_TINT = 0.6
"""how the channels follow the white balance: red with its power, blue with its inverse; a stand-in for the tables that
cameras keep"""


class SimulatedControls:
    """The controls as `camera.CameraControls` describes them; at their defaults the picture is as designed."""

    def __init__(self, apply: Callable[[float, tuple[float, float, float]], None]) -> None:
        """Begin with the defaults; `apply` gets the exposure, us, and the gain of each channel when they change."""
        self._apply = apply
        self._ranges, self._values = dict(RANGES), dict(DEFAULTS)

    def names(self) -> tuple[str, ...]:
        """Names of the controls."""
        return tuple(self._ranges)

    def range(self, name: str) -> tuple[float, float, float]:
        """Return smallest and largest value and the step; CameraError for a control that is not there."""
        if name not in self._ranges:
            known = ", ".join(self._ranges)
            raise CameraError(f"the simulated camera has no control {name!r}: choose one of {known}")
        return self._ranges[name]

    def read(self, name: str) -> float:
        """Return the value in force."""
        self.range(name)
        return self._values[name]

    def set(self, name: str, value: float) -> float:
        """Set a value, to its step, and return what holds now; InputError for a value out of range."""
        low, high, step = self.range(name)
        if not (isfinite(value) and low <= value <= high):
            raise InputError(f"{name} = {value}: choose {low:g} to {high:g}")
        self._values[name] = min(high, round(low + round((value - low) / step) * step, 6))
        tint = (self._values["white_balance_k"] / DEFAULTS["white_balance_k"]) ** _TINT
        gain = self._values["gain"]
        self._apply(self._values["exposure_us"], (gain * tint, gain, gain / tint))
        return self._values[name]
