"""How large a ring of LEDs may be: a board drives no more, and a bundle tells of no more."""

MOST_LEDS = 24
