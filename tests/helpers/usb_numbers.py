"""The numbers of requests to a board on USB (USB 2.0, 9.4; CDC PSTN 1.2, 6.3)."""

GET_STATUS, CLEAR_FEATURE, SET_ADDRESS, GET_DESCRIPTOR = 0, 1, 5, 6
GET_CONFIGURATION, SET_CONFIGURATION, GET_INTERFACE = 8, 9, 10
DEVICE, CONFIGURATION, STRING, ENDPOINT = 1, 2, 3, 5
"""kinds of descriptors"""
BULK = 2
"""kind of an endpoint"""
SET_LINE_CODING, GET_LINE_CODING, SET_CONTROL_LINE_STATE, SEND_BREAK = 0x20, 0x21, 0x22, 0x23
DTR, DTR_AND_RTS = 1, 3
"""control line states: what a host raises as it opens the port"""
