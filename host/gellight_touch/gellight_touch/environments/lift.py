"""Lift a body between two gels: neither its weight nor its friction is known before it is felt."""

from collections.abc import Sequence
from typing import Any

import gymnasium
import mujoco
import numpy as np
from gymnasium import spaces

from gellight_touch import GRIPPER
from gellight_touch.environments.observing import Observing, clipped
from gellight_touch.layer import Floats
from gellight_touch.mujoco_carry import Carrying, Held
from gellight_touch.mujoco_gels import MujocoGels
from gellight_touch.touch_sensor import TouchSensor

MASSES_KG = 0.01, 0.08
FRICTIONS = 0.4, 1.0
STRONGEST_N = 4.0
FASTEST_MM_S = 40.0
HELD_MM = 20.0
"""lifted so far, the task is done"""
STEPS = 20
"""of the simulation for each of the agent: 25 a second"""
LONGEST = 100
"""steps of an episode"""
HARD_GRIP_COSTS = 0.002
"""for each N and step"""


class Lift(gymnasium.Env[dict[str, Any], Floats]):
    """Actions, -1 to 1: the change of the grip (by 0.5 N a step), and the speed of the hand upwards (40 mm/s).

    Reward: what the object rose, in cm, less 0.002 for each N of grip; 1 when it was lifted by 20 mm, -1 when it fell
    behind the hand by 3 mm, which ends the episode. `info`: mass, friction, height, grip, and whether both gels stick.
    """

    metadata: dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": 25}  # noqa: RUF012 - as Gymnasium has it

    def __init__(
        self,
        observe: Sequence[str] = ("depth", "wrench"),
        *,
        depth_size: int = 32,
        points: int = 48,
        render_mode: str | None = None,
    ) -> None:
        """Choose what is observed of each gel (see `observing.KINDS`), and the points a side of the layer."""
        self._points, self.render_mode = points, render_mode
        self.watching = {name: Observing(self._sensor(), observe, depth_size) for name in ("left", "right")}
        self.observation_space = spaces.Dict({name: one.space() for name, one in self.watching.items()})
        self.action_space = spaces.Box(-1, 1, (2,), np.float32)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Any], dict[str, Any]]:
        """Draw mass and friction, and close the gripper softly."""
        super().reset(seed=seed)
        self._mass_kg, self._friction = (float(self.np_random.uniform(*span)) for span in (MASSES_KG, FRICTIONS))
        self._model = mujoco.MjModel.from_xml_path(str(GRIPPER))
        _weigh(self._model, "object", self._mass_kg)
        self._data = mujoco.MjData(self._model)
        gels = MujocoGels(self._model, ["left", "right"], touching=["object"], sensor=self._sensor)
        self._carry = Carrying(gels, friction=self._friction)
        self._grip_n, self._hand_mm, self._steps, self._held = 0.5, 0.0, 0, list[Held]()
        self._go(5 * STEPS, 0.0)
        return self._observed(), self._told()

    def step(self, action: Floats) -> tuple[dict[str, Any], float, bool, bool, dict[str, Any]]:
        """Change the grip and move the hand for 40 ms."""
        change, speed = clipped(action, 2)
        self._grip_n = float(np.clip(self._grip_n + 0.5 * change, 0, STRONGEST_N))
        before_mm = self._height_mm()
        self._go(STEPS, FASTEST_MM_S * float(speed))
        self._steps += 1
        rose_mm = self._height_mm() - before_mm
        hand_mm = float(self._data.joint("up").qpos[0]) * 1e3
        done, lost = self._height_mm() > HELD_MM, hand_mm - self._height_mm() > 3.0
        reward = rose_mm / 10 - HARD_GRIP_COSTS * self._grip_n + float(done) - float(lost)
        return self._observed(), reward, bool(done or lost), self._steps >= LONGEST, self._told()

    def render(self) -> Any:
        """Return the picture of the left gel, where `render_mode` is rgb_array."""
        gel = self._carry.gels["left"]
        return gel.sensor.picture(gel.feel(self._data)) if self.render_mode == "rgb_array" else None

    def _sensor(self) -> TouchSensor:
        seed = int(self.np_random.integers(2**31)) if self._np_random is not None else 0
        return TouchSensor(size=self._points, extent_mm=48.0, seed=seed)

    def _go(self, steps: int, speed_mm_s: float) -> None:
        for _ in range(steps):
            self._hand_mm = max(self._hand_mm + speed_mm_s * self._model.opt.timestep, 0.0)
            self._data.ctrl[:] = [self._hand_mm / 1e3, self._grip_n, self._grip_n]
            self._held = self._carry.step(self._data)

    def _height_mm(self) -> float:
        return float(self._data.body("object").xpos[2]) * 1e3

    def _observed(self) -> dict[str, Any]:
        gels = self._carry.gels
        return {name: one.observe(gels[name].feel(self._data)) for name, one in self.watching.items()}

    def _told(self) -> dict[str, Any]:
        return {
            "mass_kg": self._mass_kg,
            "friction": self._friction,
            "height_mm": self._height_mm(),
            "grip_n": self._grip_n,
            "sticks": bool(self._held) and all(one.sticks for one in self._held),
        }


def _weigh(model: mujoco.MjModel, body: str, mass_kg: float) -> None:
    """Give a body another mass, and the inertia that belongs to it."""
    number = model.body(body).id
    model.body_inertia[number] *= mass_kg / model.body_mass[number]
    model.body_mass[number] = mass_kg
    mujoco.mj_setConst(model, mujoco.MjData(model))
