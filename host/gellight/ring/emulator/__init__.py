"""A simulated board of the light ring: the real firmware image in an emulated RP2040, on virtual time."""
