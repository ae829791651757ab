"""A virtual sensor: one USB device, camera and light ring, that a Linux kernel takes for real over USB/IP.

device.py            the device with its camera and board, plugged in by a socket, or offered by a server
descriptors.py       how the device describes itself
serial_port.py       its serial port (CDC-ACM)
video.py             its camera (UVC): controls.py, encoding.py
faults.py            what it does wrong on purpose
cable.py             URBs to and from the kernel, and their wire format
"""
