"""Exposure, gain and white balance of a V4L2 camera, by number, for the names change with the kernel.

An automatic is switched off before its value is set: while it is on, the driver ignores the value or reports another.
Every value is read back from the device; one that does not hold is an error, not a warning.
"""

import errno
import os
import threading
from collections.abc import Mapping
from dataclasses import dataclass

from gellight.base.errors import CameraError, InputError
from gellight.sensor.v4l2 import structures as v
from gellight.sensor.v4l2.errors import explaining, explanation
from gellight.sensor.v4l2.formats import Ask

# Numbers of linux/v4l2-controls.h
_USER, _CAMERA = 0x00980900, 0x009A0900
WHITE_BALANCE_AUTO, WHITE_BALANCE = _USER + 12, _USER + 26
GAIN_AUTO, GAIN = _USER + 18, _USER + 19
POWER_LINE = _USER + 24
EXPOSURE_AUTO, EXPOSURE, DYNAMIC_RATE = _CAMERA + 1, _CAMERA + 2, _CAMERA + 3
FOCUS_AUTO = _CAMERA + 12

EXPOSURE_MANUAL = 1  # V4L2_EXPOSURE_MANUAL
REFUSALS = (errno.EINVAL, errno.ERANGE, errno.EACCES, errno.EIO, errno.EPIPE)
"""what a driver or a camera answers to a value that it does not take"""
POWER_LINE_VALUES = {0: 0, 50: 1, 60: 2}
"""frequency in Hz of the mains -> value of the control; 0: the camera does not follow any"""


@dataclass(frozen=True)
class ControlSpec:
    """A control by the name that users know: its number, what switches its automatic off, and its unit."""

    number: int
    automatic: int
    manual: int
    scale: float
    """what one step of the number means in the unit of the name"""


KNOBS = {
    "exposure_us": ControlSpec(EXPOSURE, EXPOSURE_AUTO, EXPOSURE_MANUAL, 100.0),
    "gain": ControlSpec(GAIN, GAIN_AUTO, 0, 1.0),
    "white_balance_k": ControlSpec(WHITE_BALANCE, WHITE_BALANCE_AUTO, 0, 1.0),
}
FIXED = ((DYNAMIC_RATE, 0, "the dynamic frame rate"), (FOCUS_AUTO, 0, "the automatic focus"))
"""what is off in every sensor: number, value, name for messages"""


@dataclass(frozen=True)
class Deviation:
    """A control that is not as it was set."""

    name: str
    wanted: float
    found: float

    def __str__(self) -> str:
        """In words."""
        return f"{self.name} was set to {self.wanted:g} and is {self.found:g}"


class V4l2Controls:
    """The `CameraControls` of an open V4L2 camera."""

    def __init__(self, ask: Ask, path: str) -> None:
        """Use `ask` for ioctls; `path` is for messages."""
        self._ask, self._path = ask, path
        self._changing = threading.RLock()
        """held while a value is set, so that no other thread sees it changed and not yet noted"""
        self._wanted: dict[int, tuple[str, float, int]] = {}
        """number -> name, scale and the value that was set"""
        self.period_us = float("inf")
        """a longer exposure than this is refused"""
        self.exposure_us: float | None = None
        """as it was set or read last, without asking the camera; None where it has no such control"""

    def names(self) -> tuple[str, ...]:
        """Names of the controls that this camera has."""
        return tuple(name for name, knob in KNOBS.items() if self.has(knob.number))

    def has(self, number: int) -> bool:
        """Whether the camera has a control that is not disabled."""
        description = v.ControlDescription(id=number)
        try:
            self._ask(v.QUERYCTRL, description)
        except OSError as error:
            if error.errno in (errno.EINVAL, errno.ENOTTY):
                return False
            raise explanation(self._path, "to describe a setting", error) from error
        return not description.flags & v.CTRL_DISABLED

    def range(self, name: str) -> tuple[float, float, float]:
        """Return smallest and largest value and the step; CameraError for a control that is not there."""
        knob = self._knob(name)
        found = self._describe(knob.number)
        largest: float = found.maximum * knob.scale
        if name == "exposure_us":
            largest = min(largest, self.period_us)
        return found.minimum * knob.scale, largest, max(found.step, 1) * knob.scale

    def read(self, name: str) -> float:
        """Return the value in force."""
        return self.get(self._knob(name).number) * KNOBS[name].scale

    def set(self, name: str, value: float) -> float:
        """Switch the automatic off, set the nearest value there is, read it back and return it.

        Raises InputError for a value out of range and CameraError where the camera does not keep it.
        """
        knob = self._knob(name)
        if name == "exposure_us" and value > self.period_us:
            raise InputError(exposure_too_long(value, self.period_us))
        low, high, step = self.range(name)
        if not low <= value <= high:
            raise InputError(f"{name} = {value:g}: {self._path} takes {low:g} to {high:g} in steps of {step:g}")
        self._manual(name, knob)
        steps = min(round((value - low) / step), int((high - low + 1e-6) / step))
        raw = round((low + steps * step) / knob.scale)
        self._put(knob.number, raw, name, knob.scale)
        if name == "exposure_us":
            self.exposure_us = raw * knob.scale
        return raw * knob.scale

    def lock(self, values: Mapping[str, float], *, power_line_hz: int = 0) -> None:
        """Switch everything automatic off, then set `values` by name; what is not named keeps its value, fixed.

        Raises as `set` does, and CameraError for a name that this camera does not have.
        """
        for number, value, words in FIXED:
            if self.has(number):
                self._put(number, value, words)
        # A filter against mains flicker that cannot be off stays on: inside a sensor there is no flicker.
        if self.has(POWER_LINE) and (power_line_hz or not self._describe(POWER_LINE).minimum):
            self._put(POWER_LINE, POWER_LINE_VALUES[power_line_hz], "the power line filter")
        for name, knob in KNOBS.items():
            self._manual(name, knob)
        for name, setting in values.items():
            self.set(name, setting)
        if "exposure_us" in self.names():
            self.exposure_us = self.read("exposure_us")
            if self.exposure_us > self.period_us:
                raise CameraError(exposure_too_long(self.exposure_us, self.period_us))

    def deviations(self) -> list[Deviation]:
        """Read everything back that was set, and return what does not hold."""
        with self._changing:
            found = [(name, scale, value, self.get(number)) for number, (name, scale, value) in self._wanted.items()]
        return [Deviation(name, value * scale, now * scale) for name, scale, value, now in found if now != value]

    def verify(self) -> None:
        """Raise CameraError unless everything that was set holds."""
        if wrong := self.deviations():
            raise CameraError(
                f"{self._path} does not keep its settings: {', '.join(map(str, wrong))}; end other programmes that "
                "change it, or use a camera whose settings can be fixed"
            )

    def locked(self) -> dict[str, bool]:
        """Return for each automatic that this camera has whether it is off."""
        automatic = {f"automatic {name}": (knob.automatic, knob.manual) for name, knob in KNOBS.items()}
        automatic |= {words: (number, value) for number, value, words in FIXED}
        return {words: self.get(number) == value for words, (number, value) in automatic.items() if self.has(number)}

    def get(self, number: int) -> int:
        """Return the value of a control by number."""
        control = v.Control(id=number)
        with explaining(self._path, "to tell a setting"):
            self._ask(v.G_CTRL, control)
        return int(control.value)

    def _manual(self, name: str, knob: ControlSpec) -> None:
        if self.has(knob.automatic):
            self._put(knob.automatic, knob.manual, f"automatic {name}")

    def _put(self, number: int, value: int, name: str, scale: float = 1.0) -> None:
        """Set a control and read it back; CameraError where it is refused or does not hold."""
        with self._changing:
            self._wanted.pop(number, None)
            self._send(number, value, f"{name} = {value * scale:g}")
            if (found := self.get(number)) != value:
                raise CameraError(
                    f"{self._path} does not keep its settings: {Deviation(name, value * scale, found * scale)}; use a "
                    "camera whose settings can be fixed"
                )
            self._wanted[number] = name, scale, value

    def _send(self, number: int, value: int, text: str) -> None:
        try:
            self._ask(v.S_CTRL, v.Control(id=number, value=value))
        except OSError as error:
            if error.errno not in REFUSALS:
                raise explanation(self._path, f"to set {text}", error) from error
            raise CameraError(
                f"{self._path} refuses {text} ({os.strerror(error.errno)}): choose another value, or a camera whose "
                "settings can be fixed"
            ) from error

    def _knob(self, name: str) -> ControlSpec:
        if name not in KNOBS or not self.has(KNOBS[name].number):
            there = ", ".join(self.names()) or "none"
            raise CameraError(f"{self._path} has no control {name} (it has: {there}): leave it out")
        return KNOBS[name]

    def _describe(self, number: int) -> v.ControlDescription:
        description = v.ControlDescription(id=number)
        with explaining(self._path, "to describe a setting"):
            self._ask(v.QUERYCTRL, description)
        return description


def exposure_too_long(exposure_us: float, period_us: float) -> str:
    """Return the message for an exposure that does not fit into the frame period."""
    return (
        f"an exposure of {exposure_us / 1e3:g} ms is longer than the frame period of {period_us / 1e3:.4g} ms: set "
        f"exposure_us to at most {period_us:.0f}, or fps to at most {1e6 / exposure_us:.3g}, and brighten the LEDs"
    )
