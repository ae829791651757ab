"""Exposure, gain and white balance of the simulated camera."""

from collections.abc import Callable
from math import isfinite

from gellight.base.errors import CameraError, InputError

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
        self._values = dict(DEFAULTS)

    def names(self) -> tuple[str, ...]:
        """Names of the controls."""
        return tuple(RANGES)

    def range(self, name: str) -> tuple[float, float, float]:
        """Return smallest and largest value and the step; CameraError for a control that is not there."""
        if name not in RANGES:
            raise CameraError(f"the simulated camera has no control {name!r}: choose one of {', '.join(RANGES)}")
        return RANGES[name]

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
