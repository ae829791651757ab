"""Capture from V4L2 cameras: our own few calls on ioctl, mmap and poll, because the newest frame, its sequence number,
its time in the kernel and the cause of a failure matter here, and no permissively licensed library tells all four.

structures.py    the kernel's structures and request numbers
kernel.py        the five system calls, replaceable by a fake for tests
formats.py       what a camera offers, and the choice from it
controls.py      exposure, gain, white balance by number: automatic off, set, read back, verified
stream.py        buffers: always the newest frame, everything else counted
device.py        one open device: ties the above together, and says who or what stands in the way
decoding.py      bytes to RGB
jpeg.py          whether a JPEG is whole; these two import OpenCV, nothing else here does
video_camera.py  V4l2Camera, the Camera of `v4l2://`
"""
