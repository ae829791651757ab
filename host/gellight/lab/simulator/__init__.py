"""The sensor that needs no hardware: a gel computed by `sim_reference`, lit by the core of the firmware.

simulated_camera.py    the camera of sim://
simulated_url.py       its parameters
stage.py               what presses objects into its gel
objects.py             objects by name: those of the reference, probes, and plates of known roughness
bodies.py              bodies that can be turned, as objects
sequence.py            an object that moves as a file says
scene.py               what it looks at, computed once for a press
unit.py                a real unit as its bundle tells of it
measured_light.py      what the camera of a real unit shows of a slope
dragging.py            the gel along its surface, under an object that is moved sideways
printed_dots.py        marker dots on the gel
shutter.py             its rolling shutter under pulsed LEDs, its noise, exposure, gain and white balance
selfcheck.py           the host judged by the simulator
virtual_hand.py        presses for the user in a calibration
"""
