"""Gymnasium environments that are learnt by touch; importing this registers them.

observing.py  what an agent may observe of a gel
tell.py       gellight/PressAndTell-v0: find out which object lies under the gel
lift.py       gellight/Lift-v0: lift what lies between two gels, of unknown weight and friction, without slip
"""

import gymnasium

from gellight.lab.touch.environments.lift import Lift
from gellight.lab.touch.environments.tell import PressAndTell

__all__ = ["Lift", "PressAndTell"]

for _name, _task in (("PressAndTell", PressAndTell), ("Lift", Lift)):
    gymnasium.register(f"gellight/{_name}-v0", entry_point=f"{_task.__module__}:{_task.__qualname__}")
