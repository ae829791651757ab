"""Have a function called with each frame, as for the controller of a gripper, while the program does other things."""

import sys
import time

import gellight
from gellight import TactileFrame

sys.tracebacklimit = 0  # errors in one line
name = sys.argv[1] if sys.argv[1:] else "auto"
deepest_mm = 0.0


def grip(frame: TactileFrame) -> None:
    """Remember how deep the deepest touch was; a robot would close or open its gripper here."""
    global deepest_mm
    deepest_mm = max(deepest_mm, frame.contact.indentation_mm)


with gellight.subscribe(name, wait_s=60) as frames:
    frames.listen(grip, on_error=print)
    time.sleep(2)
print(f"the deepest touch of two seconds was {deepest_mm:.2f} mm")
