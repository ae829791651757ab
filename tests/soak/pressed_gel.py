"""What the sensor of a soak looks at: a gel under whatever light is on, and a number in each picture of it.

Numbers are written at the top and again at the bottom, so faintly that no touch is seen in them. A bit is a column of
four rows, brighter and darker by `STEP_GREY` in turn: neither mean nor slope of the block changes, and a picture
that changes as smoothly as gel does not change the bit.
"""

import threading
from collections import OrderedDict
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import InputError
from gellight.lab.simulator.scene import Press, Scene
from sim_reference.camera import CameraResponse
from sim_reference.geometry import AS_BUILT

SHAPE = (120, 160)
PIXEL_MM = 0.0588 * 4
"""of the shipped simulated sensor, of which every pixel here is the mean of 4 x 4"""
KEPT_PICTURES = 32


class PressedGel:
    """A gel; safe to use from any thread."""

    def __init__(self) -> None:
        height, width = SHAPE
        geometry = replace(AS_BUILT, image_width_px=width, image_height_px=height, pixel_size_mm=PIXEL_MM)
        self._scene = Scene(geometry, CameraResponse())
        self.deepest_mm = 0.4 * geometry.gel_thickness_mm
        self.pressed: Press | None = None
        """what is in it now"""
        self._kept: OrderedDict[tuple[Press | None, bytes], NDArray[np.float32]] = OrderedDict()
        self._showing = threading.Lock()

    def press(self, object_name: str, depth_mm: float, x_mm: float, y_mm: float) -> Press:
        """Press an object, mm from the middle of the picture, until it is lifted."""
        press = Press(object_name, depth_mm, x_mm, y_mm)
        self._scene.prepare_ahead(press)
        self.pressed = press
        return press

    def lift(self) -> None:
        self.pressed = None

    def picture(self, colours: NDArray[np.float64]) -> NDArray[np.float32]:
        """(H, W, 3) grey levels under the light of (12, 3) `colours`, 0 to 255, without noise."""
        with self._showing:
            key = self.pressed, colours.tobytes()
            if key not in self._kept:
                self._kept[key] = self._scene.show(key[0], colours / 255)[0]
            while len(self._kept) > KEPT_PICTURES:
                self._kept.popitem(last=False)
            self._kept.move_to_end(key)
            return self._kept[key]


def place_px(press: Press) -> tuple[float, float]:
    """Return column and row of the middle of a press in the picture."""
    height, width = SHAPE
    return (width - 1) / 2 + press.x_mm / PIXEL_MM, (height - 1) / 2 + press.y_mm / PIXEL_MM


BITS = 32
ROWS = 4
STEP_GREY = 2
SIGNS = np.array([1, -1, -1, 1])


def marked(image: NDArray[np.uint8], number: int) -> NDArray[np.uint8]:
    """Return (H, W, 3) uint8 RGB with `number` in its first and last four rows; W is a multiple of 32."""
    bits = np.array([number >> bit & 1 for bit in range(BITS)]).repeat(image.shape[1] // BITS)
    step = STEP_GREY * (1 + np.where(bits, 1, -1) * SIGNS[:, None])[..., None]
    result = image.copy()
    for rows in (slice(ROWS), slice(-ROWS, None)):
        result[rows] = np.minimum(image[rows] + step, 255)
    return result


def read_number(image: NDArray[np.uint8]) -> int:
    """Return the number of a picture; InputError where top and bottom are of different pictures."""
    top, bottom = _number(image[:ROWS]), _number(image[-ROWS:])
    if top != bottom:
        raise InputError(f"the picture begins as number {top} and ends as number {bottom}: it is torn")
    return top


def _number(part: NDArray[np.uint8]) -> int:
    columns = part.reshape(ROWS, BITS, -1).astype(float).mean(axis=2)
    return sum(1 << bit for bit, step in enumerate(SIGNS @ columns) if step > 0)
