"""Put a peg into a slot: it hangs aside and tilted in the gripper, and the slot is not quite where it should be."""

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from gymnasium import spaces

from gellight_touch.environments.observing import OneGel, clipped
from gellight_touch.layer import Floats
from gellight_touch.mujoco_gels import MujocoGels
from gellight_touch.touch_sensor import Felt, TouchSensor

SENSOR = partial(TouchSensor, size=72, extent_mm=72.0)
MODEL = Path(__file__).parent.parent / "peg.xml"
ASIDE_MM, TILT_RAD = 3.0, np.radians(8)
"""by which the peg is displaced in the gripper, at most"""
SLOT_MM = 0.8
"""by which the slot is beside its place, at most; it is 0.4 mm wider than the peg on both sides"""
FARTHEST_MM, FARTHEST_RAD = 1.0, np.radians(4)
"""of the hand in a step, along and turning"""
REACH_MM, REACH_RAD = 8.0, np.radians(20)
ABOVE_MM, DEEP_MM, INSERTED_MM = 2.0, -8.0, -6.0
"""height of the peg's tip over the plate: between pushes, where a push ends, and where the task is done"""
MOVING, PUSHING = 150, 500
"""ms of a movement, and of a push"""
LONGEST = 30
MOST_PUSHES = 4
GELS, FRICTION = 2, 0.8


class InsertPeg(OneGel[Floats]):
    """Actions, -1 to 1: the hand along x (1 mm) and turning (4 degrees), and whether to push: above 0, no more moves.

    Observed beside the gel: `hand`, its place along x (mm), its turn (rad) and the height of the tip over the plate if
    the peg were held straight (mm). Reward: 1 for a peg 6 mm deep in the slot, which ends the episode, -1 for the
    fourth push in vain, -0.01 for a step. The gels hold the peg as stiffly as their layer. `info` tells the truth.
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
        self._model = mujoco.MjModel.from_xml_path(str(MODEL))
        self._gel = MujocoGels(self._model, ["gel"], touching=["peg"], sensor=lambda: self._sensor)["gel"]
        self._plate = self._model.body("plate").id
        _hold(self._model, self._sensor, self._gel.feel(self._begun()))
        reach = np.array([REACH_MM, REACH_RAD, 50.0], np.float32)
        self.observation_space = spaces.Dict({**self.observing.space(), "hand": spaces.Box(-reach, reach)})
        self.action_space = spaces.Box(-1, 1, (3,), np.float32)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Any], dict[str, Any]]:
        """Draw how the peg hangs in the gripper, and where the slot is."""
        self.begin(seed)
        furthest = np.array([ASIDE_MM, TILT_RAD, SLOT_MM])
        self._aside_mm, self._tilt, self._slot_mm = (float(one) for one in self.np_random.uniform(-furthest, furthest))
        self._model.body_pos[self._plate, 0] = self._slot_mm / 1e3
        for joint, at in (("aside", self._aside_mm / 1e3), ("tilt", self._tilt)):
            self._model.qpos_spring[self._model.joint(joint).qposadr] = at
        self._data, self._steps, self._pushes = self._begun(), 0, 0
        self._hand = np.zeros(2)
        return self._observed(), self._told()

    def step(self, action: Floats) -> tuple[dict[str, Any], float, bool, bool, dict[str, Any]]:
        """Lift the hand and move it, or push."""
        along, turn, push = clipped(action, 3)
        self._steps += 1
        if push > 0:
            self._pushes += 1
            self._go(DEEP_MM, PUSHING)
        else:
            self._go(ABOVE_MM, MOVING)
            moved = self._hand + np.array([along * FARTHEST_MM, turn * FARTHEST_RAD])
            self._hand = np.clip(moved, [-REACH_MM, -REACH_RAD], [REACH_MM, REACH_RAD])
            self._go(ABOVE_MM, MOVING)
        done, lost = self._height_mm() < INSERTED_MM, self._pushes >= MOST_PUSHES
        reward = 1.0 if done else -1.0 if lost else -0.01
        return self._observed(), reward, bool(done or lost), self._steps >= LONGEST, self._told()

    def _begun(self) -> mujoco.MjData:
        data = mujoco.MjData(self._model)
        data.qpos[:] = self._model.qpos_spring
        mujoco.mj_kinematics(self._model, data)
        return data

    def _go(self, height_mm: float, steps: int) -> None:
        """Let the hand go to its place, and to a height at an even pace."""
        begun_mm = self._height_mm()
        for share in np.linspace(0, 1, steps + 1)[1:]:
            up_mm = begun_mm + share * (height_mm - begun_mm) - ABOVE_MM
            self._data.ctrl[:] = [self._hand[0] / 1e3, up_mm / 1e3, self._hand[1]]
            mujoco.mj_step(self._model, self._data)

    def _height_mm(self) -> float:
        return float(self._data.joint("up").qpos[0]) * 1e3 + ABOVE_MM

    def _observed(self) -> dict[str, Any]:
        hand = np.array([*self._hand, self._height_mm()], np.float32)
        return {**self.observing.observe(self._gel.feel(self._data)), "hand": hand}

    def _told(self) -> dict[str, Any]:
        return {
            "aside_mm": self._aside_mm,
            "tilt_rad": self._tilt,
            "slot_mm": self._slot_mm,
            "pushes": self._pushes,
            "inserted": self._height_mm() < INSERTED_MM,
        }


def _hold(model: mujoco.MjModel, sensor: TouchSensor, felt: Felt) -> None:
    """Give the springs of the peg what both gels carry when it moves by 10 um, and turns by 1 mrad, without slip."""
    aside = sensor.drag(felt, (0.01, 0.0, 0.0), friction=FRICTION).force_n[0] / 0.01 * 1e3
    tilt = sensor.drag(felt, (0.0, 0.0, 1e-3), friction=FRICTION).torque_nmm
    for name, stiffness, inertia in (("aside", aside, model.body("peg").mass[0]), ("tilt", tilt, 1e-5)):
        joint = model.joint(name)
        joint.stiffness[0] = GELS * stiffness
        model.dof_damping[joint.dofadr] = np.sqrt(GELS * stiffness * inertia)
