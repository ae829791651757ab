"""Environments with one gel: what an agent may observe of it, by choice, for each kind costs time; seed and picture."""

from collections.abc import Callable, Sequence
from typing import Any, TypeVar

import cv2
import gymnasium
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from gellight.base.errors import InputError
from gellight_touch.layer import Floats
from gellight_touch.touch_sensor import Felt, TouchSensor

KINDS = ("depth", "wrench", "contact", "picture")
"""depth: (n, n) mm; wrench: normal force, N, and where it acts, x and y mm; contact: whether anything touches; picture:
(H, W, 3) uint8"""
Action = TypeVar("Action")


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


class OneGel(gymnasium.Env[dict[str, Any], Action]):
    """An environment whose agent feels by one gel."""

    metadata: dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": 2}  # noqa: RUF012 - as Gymnasium has it

    def __init__(
        self, observe: Sequence[str], depth_size: int, sensor: Callable[[], TouchSensor], render_mode: str | None
    ) -> None:
        """Make the sensor, and choose what is observed (see `observing.KINDS`). Raises InputError."""
        self._sensor, self.render_mode = sensor(), render_mode
        self.observing = Observing(self._sensor, observe, depth_size)
        self.observation_space = self.observing.space()

    def begin(self, seed: int | None) -> None:
        """Seed the environment where a seed is given, and the noise of the pictures in any case."""
        gymnasium.Env.reset(self, seed=seed)
        self._sensor.seed(int(self.np_random.integers(2**31)))

    def render(self) -> Any:
        """Return the picture of what was felt last, where `render_mode` is rgb_array."""
        felt = self.observing.felt
        return self._sensor.picture(felt) if self.render_mode == "rgb_array" and felt else None


def clipped(action: Floats, count: int) -> list[float]:
    """Return the `count` numbers of an action within -1 to 1; InputError where it is none."""
    numbers = np.asarray(action, np.float64)
    if numbers.shape != (count,) or not np.isfinite(numbers).all():
        raise InputError(f"action {numbers.tolist()}: give {count} finite numbers, -1 to 1")
    return [float(one) for one in np.clip(numbers, -1, 1)]
