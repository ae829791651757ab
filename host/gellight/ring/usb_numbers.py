"""The numbers by which the board is known on USB, and of the requests to it (USB 2.0, 9.4; CDC PSTN 1.2, 6.3)."""

VENDOR, PRODUCT = 0x1209, 0x0001
NAME = "GelLight"
"""how the product string of every board begins, also of one that its maker gave a number of his own"""
OUT_ENDPOINT, IN_ENDPOINT, DATA_INTERFACE = 0x02, 0x82, 1
GET_STATUS, CLEAR_FEATURE, SET_ADDRESS, GET_DESCRIPTOR = 0, 1, 5, 6
GET_CONFIGURATION, SET_CONFIGURATION, GET_INTERFACE = 8, 9, 10
DEVICE, CONFIGURATION, STRING, ENDPOINT = 1, 2, 3, 5
"""kinds of descriptors"""
BULK = 2
"""kind of an endpoint"""
SET_LINE_CODING, GET_LINE_CODING, SET_CONTROL_LINE_STATE, SEND_BREAK = 0x20, 0x21, 0x22, 0x23
DTR, DTR_AND_RTS = 1, 3
"""control line states: what a host raises as it opens the port"""


def is_board(vendor: int | None, product: int | None, name: str | None) -> bool:
    """Whether a device with these numbers and this product string is a board of ours."""
    return (vendor, product) == (VENDOR, PRODUCT) or (name or "").startswith(NAME)
