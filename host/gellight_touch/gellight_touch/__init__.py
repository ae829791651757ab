"""Touch for robot simulators: the gap between gel and objects in; pressure, depth, wrench and picture out.

layer.py          the elastic layer: pressure and depth from a gap
picture.py        the picture of a gel surface, in milliseconds
traction.py       sticking and slipping along the gel
touch_sensor.py   `TouchSensor`: all of it for one sensor
episode.py        touches as the frames of a recording
mujoco_gap.py     the gap of a gel in a MuJoCo model
mujoco_gels.py    `MujocoGels`: the gels of a model, as they look and feel
mujoco_drag.py    along a gel while objects that it feels move
mujoco_carry.py   the layer's forces in place of MuJoCo's contact
environments/     tasks for Gymnasium
gripper.xml       a parallel gripper with two gels, to try it
peg.xml           a peg in a gripper over a slot
"""

from pathlib import Path

from gellight_touch.touch_sensor import Felt, TouchSensor
from gellight_touch.traction import Sheared

__all__ = ["GRIPPER", "Felt", "Sheared", "TouchSensor"]

GRIPPER = Path(__file__).parent / "gripper.xml"
"""a model of MuJoCo: sites left and right are gels, the body object lies between them"""
