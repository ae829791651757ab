"""How exposure, gain and white balance act on the picture, and what the camera's automatics do with them.

A camera that has these controls itself is set by them; the picture of any other is changed after it was taken.
"""

import numpy as np
from numpy.typing import NDArray

from gellight.frames.camera import CameraControls
from gellight.simulator.usb.controls import APERTURE_PRIORITY, ControlState

NOMINAL_EXPOSURE, NOMINAL_WHITE_BALANCE_K = 80, 4600
"""in the units of the controls: with these, and without gain, the picture is as the simulated camera took it"""
WANTED_GREY = 110.0
POWER_LINE_CYCLE = {1: 100, 2: 83}
"""exposures that do not flicker are multiples of this, in 100 us"""


def developed(image: NDArray[np.uint8], values: dict[str, int]) -> NDArray[np.uint8]:
    """Return (H, W, 3) uint8 RGB as it looks with the values of the controls.

    Grey levels are proportional to exposure and gain; white balance shifts red against blue; what exceeds 255 clips.
    """
    gains = channel_gains(values)
    if np.all(gains == 1):
        return image
    return np.asarray(np.clip(np.rint(image * gains), 0, 255), np.uint8)


def channel_gains(values: dict[str, int]) -> NDArray[np.float32]:
    """(3,) factor of each colour against the nominal values; a warmer setting gives bluer pictures."""
    level = values["exposure_us"] / NOMINAL_EXPOSURE * (1 + values["gain"] / 16)
    warmth = values["white_balance_k"] / NOMINAL_WHITE_BALANCE_K
    return np.array([level * warmth, level, level / warmth], np.float32)


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


def run_automatics(controls: ControlState, image: NDArray[np.uint8], period: int) -> None:
    """Do after a picture what a camera's automatics do; `period` is that of the frames, in 100 us.

    Auto exposure steers the mean grey level; where the frame rate may fall, exposures reach two periods. Auto white
    balance steers red and blue to one mean.
    """
    values = controls.snapshot()
    red, green, blue = (float(mean) for mean in image.reshape(-1, 3).mean(axis=0))
    if values["auto_exposure"] == APERTURE_PRIORITY:
        ratio = WANTED_GREY / max((red + green + blue) / 3, 1.0)
        wanted = values["exposure_us"] * min(max(ratio, 0.7), 1.4)
        cycle = POWER_LINE_CYCLE.get(values["power_line"], 1)
        longest = 2 * period if values["dynamic_frame_rate"] else period
        controls.adjust("exposure_us", int(min(max(round(wanted / cycle), 1) * cycle, longest)))
    if values["auto_white_balance"]:
        change = 50 if red < blue else -50
        controls.adjust("white_balance_k", values["white_balance_k"] + change)
