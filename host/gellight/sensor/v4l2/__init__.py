"""Capture from V4L2 cameras by ioctl, mmap and poll: no permissively licensed library gives the newest frame together
with its sequence number, its time in the kernel and the cause of a failure.
"""
