"""GelNet: the network that maps a pixel's colour and place to the slope of the gel there."""

import os

# Before ONNX Runtime is loaded, which else sends its maker events; its own function comes too late.
os.environ.setdefault("ORT_DISABLE_TELEMETRY", "1")
