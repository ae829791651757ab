"""A virtual sensor: one USB device, camera and light ring, that a Linux kernel takes for real over USB/IP.

device.py            the device with its camera and board, plugged in by a socket; answers the standard requests
descriptors.py       how the device describes itself
serial_port.py       its serial port (CDC-ACM)
video.py             its camera (UVC): controls.py, encoding.py
faults.py            what it does wrong on purpose
cable.py, usbip.py   URBs to and from the kernel, and their wire format
usbip_server.py      offers it to a kernel
"""
