"""Records and packets: how a message of the light ring becomes bytes, and back."""

import binascii
import functools
import struct
from dataclasses import MISSING, fields
from typing import Annotated, NamedTuple, Self, get_type_hints

from gellight.base.errors import BoardError
from gellight.base.leds import MOST_LEDS

LED_COUNT = 12
"""of the paper's ring, and of a board that was not configured otherwise"""
COLOUR_BYTES = 3 * MOST_LEDS  # a byte a colour
PACKET_BYTES = 128
"""of a decoded packet, its CRC included"""


class Scalar(NamedTuple):
    """How a field lies in a packet: its `struct` code and its C type; `length` > 0 makes it an array of bytes."""

    code: str
    c_type: str
    length: int = 0
    trailing: bool = False
    """the last field of a request, which may be shorter"""


u8 = Annotated[int, Scalar("B", "uint8_t")]
u16 = Annotated[int, Scalar("H", "uint16_t")]
u32 = Annotated[int, Scalar("I", "uint32_t")]
u64 = Annotated[int, Scalar("Q", "uint64_t")]
i16 = Annotated[int, Scalar("h", "int16_t")]
i32 = Annotated[int, Scalar("i", "int32_t")]
Colours = Annotated[bytes, Scalar(f"{COLOUR_BYTES}s", "uint8_t", COLOUR_BYTES, trailing=True)]
Bytes8 = Annotated[bytes, Scalar("8s", "uint8_t", 8)]  # an identity
Bytes16 = Annotated[bytes, Scalar("16s", "uint8_t", 16)]  # a name


Layout = tuple[tuple[str, Scalar, str], ...]
"""name, scalar and meaning of each field"""


class Record:
    """A packed little-endian structure; subclasses are frozen dataclasses of annotated fields."""

    @classmethod
    @functools.cache
    def _layout(cls) -> Layout:
        hints, rows = get_type_hints(cls, include_extras=True), []
        for field in fields(cls):  # type: ignore[arg-type]
            scalar, *meaning = hints[field.name].__metadata__
            rows.append((field.name, scalar, "".join(meaning)))
        return tuple(rows)

    @classmethod
    @functools.cache
    def codec(cls) -> struct.Struct:
        """Return the layout of the record."""
        return struct.Struct("<" + "".join(scalar.code for _, scalar, _ in layout(cls)))

    def pack(self) -> bytes:
        """Return the bytes of the record; a value that does not fit is a ValueError."""
        rows = layout(type(self))
        values = [getattr(self, name) for name, _, _ in rows]
        shorter = rows[-1][1].length - len(values[-1]) if rows and rows[-1][1].trailing else 0
        try:
            packed = self.codec().pack(*values)
        except struct.error as error:
            raise ValueError(f"{self} does not fit its packet: {error}") from error
        if shorter < 0:
            raise ValueError(f"{self} does not fit its packet: {-shorter} bytes too many")
        return packed[: len(packed) - shorter]

    @classmethod
    def unpack(cls, payload: bytes) -> Self:
        """Read the record; BoardError where fields are missing.

        A newer minor version of the protocol may have added fields at the end, which are ignored. Fields that an older
        one does not have yet take their default; every field that a minor version adds has one.
        """
        rows = layout(cls)
        sent = len(rows)
        while struct.calcsize("<" + "".join(scalar.code for _, scalar, _ in rows[:sent])) > len(payload):
            sent -= 1
        if sent < len(rows) and not cls._ends_there(payload, sent):
            raise BoardError(
                f"{cls.__name__} has {cls.codec().size} bytes, the board sent {len(payload)}: "
                "flash the firmware that belongs to this host with `gellight firmware flash`"
            )
        return cls(*struct.unpack_from("<" + "".join(scalar.code for _, scalar, _ in rows[:sent]), payload))

    @classmethod
    def _ends_there(cls, payload: bytes, sent: int) -> bool:
        """Whether the payload is the first fields, and all others have a default."""
        size = struct.calcsize("<" + "".join(scalar.code for _, scalar, _ in layout(cls)[:sent]))
        rest = fields(cls)[sent:]  # type: ignore[arg-type]
        return size == len(payload) and all(field.default is not MISSING for field in rest)


def layout(record: type[Record]) -> Layout:
    """Return name, scalar and meaning of each field in the order of the wire."""
    return record._layout()


class Packet(NamedTuple):
    """A decoded packet."""

    type: int
    sequence: int
    payload: bytes


def encode(packet: Packet) -> bytes:
    """Return the bytes for the wire, the zero at the end included."""
    body = bytes([packet.type, packet.sequence]) + packet.payload
    if len(body) + 2 > PACKET_BYTES:
        raise ValueError(f"a packet has at most {PACKET_BYTES} bytes, this one {len(body) + 2}")
    return cobs_encode(body + crc16(body).to_bytes(2, "little")) + b"\0"


def decode(stuffed: bytes) -> Packet:
    """Return the packet of the bytes between two zeros; ValueError if they are damaged."""
    body = cobs_decode(stuffed)
    if not 4 <= len(body) <= PACKET_BYTES:
        raise ValueError(f"a packet has 4 to {PACKET_BYTES} bytes, not {len(body)}")
    if crc16(body[:-2]) != int.from_bytes(body[-2:], "little"):
        raise ValueError("the checksum of the packet is wrong")
    return Packet(body[0], body[1], body[2:-2])


def crc16(body: bytes) -> int:
    """CRC-16/CCITT-FALSE: polynomial 0x1021, initial value 0xFFFF, not reflected."""
    return binascii.crc_hqx(body, 0xFFFF)


def cobs_encode(body: bytes) -> bytes:
    """Replace the zeros: each group begins with the distance to the next zero (Cheshire and Baker, 1999)."""
    out = bytearray()
    for group in body.split(b"\0"):
        while len(group) >= 254:
            out += b"\xff" + group[:254]
            group = group[254:]
        out += bytes([len(group) + 1]) + group
    return bytes(out)


def cobs_decode(stuffed: bytes) -> bytes:
    """Restore the zeros; ValueError if the distances do not add up."""
    out, at = bytearray(), 0
    while at < len(stuffed):
        code = stuffed[at]
        group = stuffed[at + 1 : at + code]
        if code == 0 or len(group) != code - 1 or 0 in group:
            raise ValueError(f"framing broken at byte {at} of {len(stuffed)}")
        out += group
        at += code
        if code < 255 and at < len(stuffed):
            out.append(0)
    return bytes(out)
