"""Close a gripper until the object hangs from it by 0.4 N and does not slip."""

import gellight
from gellight.frames.shear import SlipState

WEIGHT_N = 0.4
STEP_MM = 0.1

with gellight.connect("sim://?programme=0&board=0&dots=9x7&fps=10") as sensor:
    closed_mm, holds = 0.4, False
    while not holds:
        closed_mm += 0.2
        sensor.press("BALL", closed_mm)  # here: your gripper closes to closed_mm
        pulled_mm, slips = 0.0, 0
        while not holds and slips < 2 and pulled_mm < 2:  # one frame may be noise
            pulled_mm += STEP_MM
            sensor.drag(pulled_mm, 0.0)  # here: your arm lifts a little
            frame = sensor.next_frame()
            slips = slips + 1 if frame.slip.state is SlipState.FULL else 0
            holds = frame.shear.force_n[0] >= WEIGHT_N
        print(f"closed by {closed_mm:.1f} mm:", "it holds" if holds else "it slips")
    print(f"{frame.shear.force_n[0]:.2f} N along the gel, pressed with {frame.force.normal_n:.2f} N")
