"""The running sensor: frames come in, depth goes out, and a calibration may run beside it.

daemon.py               Daemon: the running sensor, whose bundle, zero and light can be changed
in_use.py               the bundle that a sensor runs with, and what is said of it and of its frames
frame_threads.py        the threads that capture and reconstruct; the daemon's camera for a second reader
setting.py              how a sensor is set and lit, and how to set it the same again
assembly.py             puts a daemon together as the settings say
switched_camera.py      what stands in front of the sensor, replaced when the mode changes
modes.py                network or photometric
realtime.py             camera and reconstruction before all other programs
statistics.py           rates, ages and losses
calibration_service.py  a calibration beside the stream, for the wizard
needs.py                the check list before a calibration
installing.py           puts a bundle into service
"""
