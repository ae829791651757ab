"""What an agent may observe of a gel, by choice: each kind costs what it takes to compute, and no more."""

from collections.abc import Sequence
from typing import Any

import cv2
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from gellight.base.errors import InputError
from gellight.lab.touch.layer import Floats
from gellight.lab.touch.touch_sensor import Felt, TouchSensor

KINDS = ("depth", "wrench", "contact", "picture")
"""depth: (n, n) mm; wrench: normal force, N, and where it acts, x and y mm; contact: whether anything touches; picture:
(H, W, 3) uint8"""


class Observing:
    """The observation of one gel."""

    def __init__(self, sensor: TouchSensor, kinds: Sequence[str], depth_size: int) -> None:
        """Choose kinds of `KINDS`; depth maps have `depth_size` points a side. Raises InputError for others."""
        if depth_size < 1:
            raise InputError(f"depth_size {depth_size}: give the points a side of depth maps, 1 or more")
        if not kinds or set(kinds) - set(KINDS):
            raise InputError(f"observations {list(kinds)}: choose of {', '.join(KINDS)}")
        self.sensor, self._kinds, self._size = sensor, tuple(kinds), depth_size
        self.felt: Felt | None = None
        """what was observed last"""

    def space(self) -> spaces.Dict:
        """Return the space of the observation."""
        deepest, reach = self.sensor.geometry.deepest_press_mm, float(self.sensor.layer.at_mm[-1])
        force = float(np.finfo(np.float32).max)
        known: dict[str, spaces.Space[Any]] = {
            "depth": spaces.Box(-deepest, 2 * deepest, (self._size, self._size), np.float32),
            "wrench": spaces.Box(*np.array([[0, -reach, -reach], [force, reach, reach]], np.float32)),
            "contact": spaces.MultiBinary(1),
            "picture": spaces.Box(0, 255, (*self.sensor.geometry.image_shape, 3), np.uint8),
        }
        return spaces.Dict({kind: known[kind] for kind in self._kinds})

    def observe(self, felt: Felt) -> dict[str, NDArray[Any]]:
        """Return the observation of a felt gel."""
        self.felt = felt
        return {kind: getattr(self, f"_{kind}")(felt) for kind in self._kinds}

    def _depth(self, felt: Felt) -> Floats:
        return cv2.resize(felt.depth_mm, (self._size, self._size), interpolation=cv2.INTER_AREA)

    def _wrench(self, felt: Felt) -> Floats:
        return np.array([felt.force_n, *felt.centre_mm], np.float32)

    def _contact(self, felt: Felt) -> NDArray[np.int8]:
        return np.array([felt.contact.any()], np.int8)

    def _picture(self, felt: Felt) -> NDArray[np.uint8]:
        return self.sensor.picture(felt)
