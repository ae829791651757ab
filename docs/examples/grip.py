"""Close a gripper until the gel is pressed with 1 N, and stop it there."""

import gellight

WANTED_N = 1.0

with gellight.connect("sim://?programme=0") as sensor:  # "auto": the one that is plugged in
    closed_mm = force_n = 0.0
    while force_n < WANTED_N:
        closed_mm += 0.02 + 0.15 * (WANTED_N - force_n)  # ever slower
        sensor.press("BALL", closed_mm)  # here: your gripper moves on, until it stands at closed_mm
        force = sensor.next_frame().force
        force_n = force.normal_n
    print(f"stopped at {force_n:.2f} +- {force.error_n:.2f} N, closed by {closed_mm:.2f} mm")
