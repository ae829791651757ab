"""The enumerations of the protocol; a byte on the wire each, unless said otherwise."""

from enum import IntEnum, IntFlag


class Status(IntEnum):
    """How a request ended; `value` of the reply is what was refused."""

    OK = 0
    UNKNOWN_COMMAND = 1
    BAD_LENGTH = 2
    OUT_OF_RANGE = 3
    OVER_CURRENT = 4
    BUSY = 5
    NOT_RUNNING = 6
    WRONG_MODE = 7
    CHECKSUM = 8
    BAD_MAGIC = 9
    FLASH_FAILED = 10
    SAVED_TOO_OFTEN = 11


class SyncMode(IntEnum):
    """What moves the sequence on: the board's clock, or the trigger pin."""

    FREE = 0
    EXT = 1


class Edge(IntEnum):
    """Which edge of the trigger pin counts."""

    RISING = 0
    FALLING = 1


class ColourOrder(IntEnum):
    """In which order an LED takes its colours. RGBW: SK6812 RGBW, green first, whose white stays dark."""

    GRB = 0
    RGB = 1
    RGBW = 2


class OutputAt(IntEnum):
    """When in a light the trigger output pulses: once it is latched, or in the middle of its dwell."""

    START = 0
    MIDDLE = 1


class State(IntEnum):
    """What the light ring is doing."""

    STILL = 0
    RUNNING = 1


class Dark(IntEnum):
    """Why the LEDs are dark."""

    NOT_DARK = 0
    BOOT = 1
    COMMAND = 2
    SEQUENCE_ENDED = 3
    HOST_SILENT = 4
    PORT_CLOSED = 5
    SUSPENDED = 6
    TRIGGER_MISSED = 7
    FAULT = 8


class ResetReason(IntEnum):
    """Why the board started."""

    POWER = 0
    COMMAND = 1
    WATCHDOG = 2
    FAULT = 3


class BoardKind(IntEnum):
    """What the firmware runs on."""

    HOST = 0
    RP2040 = 1
    RP2350 = 2


class Capability(IntFlag):
    """What a board can do besides lighting its LEDs."""

    TRIGGER = 1
    FLASH = 2
    BOOTLOADER = 4
    TEMPERATURE = 16


class Check(IntFlag):
    """The parts of the self-test."""

    IMAGE = 1
    STORE = 2
    LIGHT_PATH = 4
    STACK = 8


ENUMS: tuple[type[IntEnum] | type[IntFlag], ...] = (
    Status, SyncMode, Edge, ColourOrder, OutputAt, State, Dark, ResetReason, BoardKind, Capability,
    Check)  # fmt: skip
"""in the order of the schema"""
