"""Press a gel on an object that nobody names, move, press again, and tell which it is."""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
from gymnasium import spaces

from gellight.base.errors import InputError
from gellight_touch.environments.observing import OneGel
from gellight_touch.touch_sensor import TouchSensor
from sim_reference.objects import OBJECT_NAMES, object_height

SENSOR = partial(TouchSensor, size=80, extent_mm=80.0)
MOVES_MM = ((2.0, 0.0), (-2.0, 0.0), (0.0, 2.0), (0.0, -2.0))
"""of the object under the gel, by the first four actions"""
PRESSED_MM = 0.5
FARTHEST_MM = 8.0
PRESS_COSTS = 0.02


class PressAndTell(OneGel[int]):
    """Actions 0 to 3 move by 2 mm and press again, action 4 + k tells that it is object k and ends the episode.

    Reward: 1 for the right object, -1 for a wrong one, -0.02 for a press. `info` names object, place and turn.
    """

    def __init__(
        self,
        objects: Sequence[str] = OBJECT_NAMES,
        observe: Sequence[str] = ("depth",),
        *,
        depth_size: int = 32,
        sensor: Callable[[], TouchSensor] = SENSOR,
        render_mode: str | None = None,
    ) -> None:
        """Choose the objects, what is observed (see `observing.KINDS`) and what makes the sensor. Raises InputError."""
        if len(objects) < 2 or set(objects) - set(OBJECT_NAMES):
            raise InputError(f"objects {list(objects)}: choose two or more of {', '.join(OBJECT_NAMES)}")
        super().__init__(observe, depth_size, sensor, render_mode)
        self._objects = tuple(objects)
        self.action_space = spaces.Discrete(len(MOVES_MM) + len(objects))  # type: ignore[assignment]
        self._object, self._turn, self._place = 0, 0.0, np.zeros(2)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Any], dict[str, Any]]:
        """Draw an object, its turn and its place, and press it."""
        self.begin(seed)
        self._object = int(self.np_random.integers(len(self._objects)))
        self._turn, self._place = float(self.np_random.uniform(0, 2 * np.pi)), self.np_random.uniform(-4, 4, 2)
        return self._pressed(), self._told()

    def step(self, action: int) -> tuple[dict[str, Any], float, bool, bool, dict[str, Any]]:
        """Move and press, or tell; raises InputError for another action."""
        if not 0 <= action < len(MOVES_MM) + len(self._objects):
            raise InputError(f"action {action}: give 0 to {len(MOVES_MM) + len(self._objects) - 1}")
        if action >= len(MOVES_MM):
            right = action - len(MOVES_MM) == self._object
            return self._pressed(), 1.0 if right else -1.0, True, False, self._told()
        self._place = np.clip(self._place + MOVES_MM[action], -FARTHEST_MM, FARTHEST_MM)
        return self._pressed(), -PRESS_COSTS, False, False, self._told()

    def _pressed(self) -> dict[str, Any]:
        at, cos, sin = self._sensor.layer.at_mm, np.cos(self._turn), np.sin(self._turn)
        x, y = np.meshgrid(at - self._place[0], at - self._place[1])
        height = object_height(self._objects[self._object], cos * x + sin * y, cos * y - sin * x)
        felt = self._sensor.feel(-(height + PRESSED_MM))
        return self.observing.observe(felt)

    def _told(self) -> dict[str, Any]:
        return {"object": self._objects[self._object], "place_mm": self._place.copy(), "turn_rad": self._turn}
