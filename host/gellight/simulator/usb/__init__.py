"""A virtual sensor: one USB device, camera and light ring, that a Linux kernel takes for real over USB/IP."""
