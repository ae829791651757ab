"""Have a function called with each frame, as for the controller of a gripper, while the program does other things."""

import time

import gellight
from gellight import TactileFrame

deepest_mm = 0.0


def grip(frame: TactileFrame) -> None:
    """Remember how deep the deepest touch was; a robot would close or open its gripper here."""
    global deepest_mm
    deepest_mm = max(deepest_mm, frame.contact.indentation_mm)


with gellight.subscribe("auto") as frames:
    frames.listen(grip, on_error=print)
    time.sleep(2)
print(f"the deepest touch of two seconds was {deepest_mm:.2f} mm")
