"""Everything that speaks to the board of the light ring.

protocol.py      the messages; the C header is generated from here
enumerations.py  their named values
wire.py          packets: framing, checksum, records to bytes and back
usb_numbers.py   how the board is known on USB
transport.py     bytes to a board by URL: serial://, sim://
board_link.py    requests, replies and events, with retries
light_ring.py    LightRing: typed commands, and what keeps it lit
light_groups.py  which LEDs shine together
boards.py        the boards that makers use, and their pins
firmware/        from the C sources to the board
"""
