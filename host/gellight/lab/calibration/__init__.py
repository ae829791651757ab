"""The calibration routine: from an untouched gel to a verified bundle, guided or all by itself.

`routine.Routine` is what the command line and the dashboard drive. Its steps, each in a module of its own:

prepare     preparing.py, led_check.py   lock the camera, check and balance the LEDs
reference   untouched.py                 the untouched gel, its noise and its drift
pixel_size  probing.py                   the cylinder probe gives mm per pixel
presses     pressing.py, coverage.py     ball presses, found and judged while they come in
fit         fitting.py                   the light of each LED; the network, in a child process
verify      verifying.py                 fresh presses of the ball, and the verdict

`readiness.py` checks before the first step what all of them need.
`records.py` says what is measured, `state.py` and `folder.py` keep it on disk, `display.py` shows it, `report.py`
makes a page of it. `run.py` is what the steps share.
`force/` measures what turns depth into newtons.
"""
