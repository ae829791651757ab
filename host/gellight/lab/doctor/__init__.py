"""What stands between a user and good frames, found by trying it: each finding with its remedy.

examination.py     the checks of this computer, and of all that is plugged in
sensor_checks.py   those that open a sensor
shutter_meter.py   the readout time of a rolling shutter, by the light of the ring
"""
