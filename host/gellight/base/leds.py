"""How large a ring of LEDs may be: a board drives no more, and a bundle tells of no more."""

MOST_LEDS = 24  # chosen: twice the paper's ring, and still within DWELL_MIN_US of ring/protocol.py on the wire
