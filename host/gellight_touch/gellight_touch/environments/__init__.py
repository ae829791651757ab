"""Gymnasium environments that are learnt by touch; importing this registers them.

observing.py  what environments with one gel have in common, and what an agent may observe of it
tell.py       gellight/PressAndTell-v0: find out which object lies under the gel
lift.py       gellight/Lift-v0: lift what lies between two gels, of unknown weight and friction, without slip
edge.py       gellight/SlideToEdge-v0: slide over a part until its edge lies under the middle of the view
peg.py        gellight/InsertPeg-v0: put a peg that hangs aside and tilted in the gripper into a slot
"""

import gymnasium

from gellight_touch.environments.edge import SlideToEdge
from gellight_touch.environments.lift import Lift
from gellight_touch.environments.peg import InsertPeg
from gellight_touch.environments.tell import PressAndTell

__all__ = ["InsertPeg", "Lift", "PressAndTell", "SlideToEdge"]

for _task in (PressAndTell, Lift, SlideToEdge, InsertPeg):
    gymnasium.register(f"gellight/{_task.__name__}-v0", entry_point=f"{_task.__module__}:{_task.__qualname__}")
