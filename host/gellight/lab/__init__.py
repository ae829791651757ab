"""The laboratory: what makes, calibrates, simulates and designs a sensor.

The running sensor (every other room of this package) needs it through three doors alone: `opening.py` and
`ring/transport.py` open what is simulated, `daemon/calibration_service.py` calibrates beside the stream.
CONTRIBUTING.md lists its rooms.
"""
