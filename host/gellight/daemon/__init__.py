"""The running sensor: frames come in, depth goes out, and a calibration may run beside it.

daemon.py         Daemon: capture, reconstruction, statistics
assembly.py       puts one together as the settings say
modes.py          network, photometric or hybrid
shared_camera.py  the daemon's camera for a second reader
statistics.py     rates, ages and losses
desk.py           a calibration that runs beside the stream
installing.py     puts a bundle into service
"""
