"""The running sensor: frames come in, depth goes out, and a calibration may run beside it.

configuration.py        mode_config: all that runs, as one value, of a bundle and the settings
active_pipeline.py      what was built of it, which every frame goes through
session.py              SensorSession: the running sensor, and the one way to exchange what runs
assembly.py             opens the sensor that the settings name
bundle_choice.py        which bundle belongs to a sensor, and what stands for none
switched_camera.py      the camera whose front is exchanged while it runs, and how it is set the same again
calls.py                what may be asked of it: each call once, and `Commands`, which carries them out
frame_threads.py        the threads that capture and reconstruct; the session's camera for a second reader
statistics.py           rates, ages and losses
calibration_service.py  a calibration beside the stream, for the wizard
needs.py                the check list before a calibration
installing.py           puts a bundle into service
"""
