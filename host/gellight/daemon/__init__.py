"""The running sensor: frames come in, depth goes out, and a calibration may run beside it."""
