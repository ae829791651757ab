"""A simulated board of the light ring: the real firmware image in an emulated RP2040, on virtual time.

chip.py       the chip with its LED pin; registers.py, clocks.py, ticks.py and bootrom.py add what the emulator lacks
flash_bus.py  how the processor reaches its flash; flash_chip.py is that flash
usb_host.py   the other end of its USB cable; usb_rules.py says how buffers may be handed over
waveform.py   from the level of the LED pin to light
"""
