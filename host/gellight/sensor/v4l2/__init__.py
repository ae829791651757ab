"""Capture from V4L2 cameras by ioctl, mmap and poll: no permissively licensed library gives the newest frame together
with its sequence number, its time in the kernel and the cause of a failure.

structures.py    the kernel's structures and request numbers
formats.py       what a camera offers, and the choice from it
controls.py      exposure, gain, white balance by number: automatic off, set, read back, verified
stream.py        buffers: always the newest frame, everything else counted
device.py        one open device, its modes, controls and stream
errors.py        the system calls, which a fake replaces in tests, and what can go wrong, by remedy
decoding.py      bytes to RGB where they are whole; it imports OpenCV, nothing else here does
stamps.py        what a time stamp means
options.py       the parameters of a URL
video_camera.py  V4l2Camera, the Camera of `v4l2://`
"""
