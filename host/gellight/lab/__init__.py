"""The laboratory: what makes, calibrates, simulates and designs a sensor.

The running sensor (every other room of this package) needs it through three doors alone: `opening.py` and
`ring/transport.py` open what is simulated, `daemon/calibration_service.py` calibrates beside the stream.

emulator/     the firmware image in an emulated RP2040: sim://
simulator/    the sensor that needs no hardware
report/       pictures and charts for people
doctor/       what stands between a user and good frames
training/     from labelled presses to a network
design/       the illumination study, and the parts to make
calibration/  the guided routine
"""
