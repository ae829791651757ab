"""The frame path in C: built once for each processor, loaded without a compiler, checked against NumPy at load.

frame_path.h    the terms, and what the stages share
difference.c    difference image, means over cells, mask
cells.c         slopes, blended between cells
network.c       the network, and its Jacobian
shadows.c       the light that cast shadows take
smoothing.c     noise out of the slopes
surface.c       slopes to depth and back, normals
contact.c       contact patch
library.py      the library that fits this machine
native_path.py  camera frame to tactile frame on that library
cells.py        the network at cells: the formula, its limits, and its answers at rest
network.py      the network on it, checked against ONNX Runtime
native_shadows.py  cast shadows on it
judge.py        the check against the NumPy form
"""
