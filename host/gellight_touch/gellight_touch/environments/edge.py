"""Slide a gel over a flat part until the part's edge lies under the middle of the view, and say so."""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
from gymnasium import spaces

from gellight_touch.environments.observing import OneGel, clipped
from gellight_touch.layer import NOTHING, Floats
from gellight_touch.touch_sensor import TouchSensor

SENSOR = partial(TouchSensor, size=72, extent_mm=72.0)
PRESSED_MM = 0.3
ROUNDED_MM = 0.5
"""radius of the edge"""
AWAY_MM = 4.0, 16.0
"""of the edge from the middle of the gel, at first"""
TURNED_RAD = np.pi / 6
"""by which the way to the edge may differ from x"""
FASTEST_MM = 2.0
TOLERANCE_MM = 0.5
LONGEST = 30
"""steps of an episode"""
STEP_COSTS = 0.01


class SlideToEdge(OneGel[Floats]):
    """Actions, -1 to 1: the way along x and y (2 mm), and whether the edge is there: above 0 ends the episode.

    At first the edge is 4 to 16 mm away, along x to 30 degrees. Reward: 1 for an edge within 0.5 mm of the middle of
    the view when it is said to be there, else -1; -0.01 for a step. `info`: distance of the edge, and its turn.
    """

    def __init__(
        self,
        observe: Sequence[str] = ("depth",),
        *,
        depth_size: int = 32,
        sensor: Callable[[], TouchSensor] = SENSOR,
        render_mode: str | None = None,
    ) -> None:
        """Choose what is observed (see `observing.KINDS`) and what makes the sensor. Raises InputError."""
        super().__init__(observe, depth_size, sensor, render_mode)
        self.action_space = spaces.Box(-1, 1, (3,), np.float32)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Any], dict[str, Any]]:
        """Draw where the edge is, and press."""
        self.begin(seed)
        self._away_mm = float(self.np_random.uniform(*AWAY_MM))
        self._turn, self._steps = float(self.np_random.uniform(-TURNED_RAD, TURNED_RAD)), 0
        return self._pressed(), self._told()

    def step(self, action: Floats) -> tuple[dict[str, Any], float, bool, bool, dict[str, Any]]:
        """Slide, or say that the edge is there."""
        x, y, there = clipped(action, 3)
        self._steps += 1
        if there > 0:
            right = abs(self._away_mm) <= TOLERANCE_MM
            return self._pressed(), 1.0 if right else -1.0, True, False, self._told()
        self._away_mm -= FASTEST_MM * float(x * np.cos(self._turn) + y * np.sin(self._turn))
        return self._pressed(), -STEP_COSTS, False, self._steps >= LONGEST, self._told()

    def _pressed(self) -> dict[str, Any]:
        at = self._sensor.layer.at_mm
        beyond = at[None, :] * np.cos(self._turn) + at[:, None] * np.sin(self._turn) - self._away_mm
        round_off = np.clip(beyond + ROUNDED_MM, 0, ROUNDED_MM)
        gap = ROUNDED_MM - np.sqrt(ROUNDED_MM**2 - round_off**2) - PRESSED_MM
        felt = self._sensor.feel(np.where(beyond > 0, NOTHING, gap))
        return self.observing.observe(felt)

    def _told(self) -> dict[str, Any]:
        return {"away_mm": self._away_mm, "turn_rad": self._turn}
