"""The controls of the virtual camera: what a host may set over USB, what is in force, and how it acts on the picture.

The simulated camera is set by them. The automatics hold what they have: a host has to take the controls from them.
"""

import struct
import threading
from typing import NamedTuple

from gellight.frames.camera import CameraControls
from tests.virtual_usb.descriptors import CAMERA_UNIT, PROCESSING_UNIT

SET_CURRENT, GET_CURRENT, GET_MINIMUM, GET_MAXIMUM, GET_RESOLUTION, GET_LENGTH, GET_INFO, GET_DEFAULT = (
    0x01, 0x81, 0x82, 0x83, 0x84, 0x85, 0x86, 0x87,
)  # fmt: skip
READABLE, SETTABLE, CHANGES_ITSELF = 0x01, 0x02, 0x08
MANUAL, APERTURE_PRIORITY = 1, 8
"""auto exposure modes (UVC 1.1, 4.2.2.1.2)"""


class UvcControl(NamedTuple):
    """One control as USB Video Class describes it."""

    name: str
    unit: int
    selector: int
    size: int
    """bytes of its value"""
    least: int
    most: int
    step: int
    default: int
    automatic: str = ""
    """name of the control that keeps the host from setting this one, but at its value `free`"""
    free: int = 0


CONTROLS = (
    UvcControl("auto_exposure", CAMERA_UNIT, 2, 1, 1, 8, 9, 8),
    UvcControl("dynamic_frame_rate", CAMERA_UNIT, 3, 1, 0, 1, 1, 1),
    UvcControl("exposure_us", CAMERA_UNIT, 4, 4, 1, 5000, 1, 80, "auto_exposure", MANUAL),
    UvcControl("gain", PROCESSING_UNIT, 4, 2, 0, 112, 1, 0),
    UvcControl("power_line", PROCESSING_UNIT, 5, 1, 0, 2, 1, 1),
    UvcControl("white_balance_k", PROCESSING_UNIT, 10, 2, 2800, 6500, 10, 4600, "auto_white_balance"),
    UvcControl("auto_white_balance", PROCESSING_UNIT, 11, 1, 0, 1, 1, 1),
)
"""units: exposure 100 us, gain 1/16 above one, white balance K, power line 0 off, 1 50 Hz, 2 60 Hz"""


class ControlState:
    """The values in force. Thread-safe: the kernel sets them while a picture is taken."""

    def __init__(self) -> None:
        """Begin with the defaults, as after power-on."""
        self._values = {control.name: control.default for control in CONTROLS}
        self._lock = threading.Lock()

    def snapshot(self) -> dict[str, int]:
        """Return all values by name."""
        with self._lock:
            return dict(self._values)

    def request(self, unit: int, selector: int, code: int, data: bytes) -> bytes | None:
        """Answer a control request of USB Video Class; None: the device refuses (stalls)."""
        control = next((known for known in CONTROLS if (known.unit, known.selector) == (unit, selector)), None)
        if control is None:
            return None
        if code == SET_CURRENT:
            return self._set(control, data)
        if code == GET_INFO:
            return bytes((READABLE | SETTABLE | CHANGES_ITSELF,))
        if code == GET_LENGTH:
            return struct.pack("<H", control.size)
        with self._lock:
            value = {GET_CURRENT: self._values[control.name], GET_MINIMUM: control.least, GET_MAXIMUM: control.most,
                     GET_RESOLUTION: control.step, GET_DEFAULT: control.default}.get(code)  # fmt: skip
        return None if value is None else value.to_bytes(control.size, "little")

    def _set(self, control: UvcControl, data: bytes) -> bytes | None:
        """Take a value; refused like a real camera does: out of range, or held by an automatic."""
        value = int.from_bytes(data[: control.size], "little")
        with self._lock:
            if len(data) < control.size or not control.least <= value <= control.most:
                return None
            if control.name == "auto_exposure" and value not in (MANUAL, APERTURE_PRIORITY):
                return None
            if control.automatic and self._values[control.automatic] != control.free:
                return None
            self._values[control.name] = value
        return b""


def set_up(camera: CameraControls, values: dict[str, int]) -> None:
    """Set a camera that has controls of its own to the values, as near as its ranges allow."""
    wanted = {
        "exposure_us": values["exposure_us"] * 100.0,
        "gain": 1 + values["gain"] / 16,
        "white_balance_k": float(values["white_balance_k"]),
    }
    for name in wanted.keys() & set(camera.names()):
        low, high, _ = camera.range(name)
        nearest = min(max(wanted[name], low), high)
        if camera.read(name) != nearest:
            camera.set(name, nearest)
