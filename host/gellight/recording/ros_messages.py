"""The messages of ROS 2 that recordings and topics are made of, in CDR (little-endian, XCDR version 1)."""

import struct
from dataclasses import dataclass
from typing import Self

_ENCAPSULATION = b"\x00\x01\x00\x00"
_SEPARATOR = "=" * 80  # MCAP's schema encoding ros2msg: 80 equals signs

IMAGE, COMPRESSED_IMAGE, STRING = "sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage", "std_msgs/msg/String"


def definition(fields: str, **parts: str) -> str:
    """Return the definition of a type and of the `parts` it is made of, named with _ for /; fields: one a line.

    Header and time are added where there is a header.
    """
    if any("std_msgs/Header header" in text for text in (fields, *parts.values())):
        parts |= {
            "std_msgs_Header": "builtin_interfaces/Time stamp; string frame_id",
            "builtin_interfaces_Time": "int32 sec; uint32 nanosec",
        }
    named = [f"{_SEPARATOR}\nMSG: {'/'.join(name.rsplit('_', 1))}\n{text}" for name, text in parts.items()]
    return "\n".join([fields, *named]).replace("; ", "\n") + "\n"


HEADER = "std_msgs/Header header; "
DEFINITIONS = {
    IMAGE: definition(
        HEADER + "uint32 height; uint32 width; string encoding; uint8 is_bigendian; uint32 step; uint8[] data"
    ),
    COMPRESSED_IMAGE: definition(HEADER + "string format; uint8[] data"),
    STRING: definition("string data"),
}
"""of the types of a recording, as ROS 2 writes them into a bag"""


class CdrWriter:
    """Puts values one after the other, each aligned to its size."""

    def __init__(self) -> None:
        """Begin a message."""
        self._content = bytearray(_ENCAPSULATION)

    def put(self, kind: str, *values: float) -> Self:
        """Add numbers of one `struct` type such as I (uint32)."""
        size = struct.calcsize(f"<{kind}")
        for value in values:
            self._content += bytes(-(len(self._content) - 4) % size) + struct.pack(f"<{kind}", value)
        return self

    def string(self, text: str) -> Self:
        """Add a text."""
        content = text.encode() + b"\0"
        self.put("I", len(content))
        self._content += content
        return self

    def blob(self, content: bytes) -> Self:
        """Add a sequence of bytes."""
        self.put("I", len(content))
        self._content += content
        return self

    def header(self, unix_s: float, frame_id: str) -> Self:
        """Add std_msgs/Header."""
        stamp_ns = round(unix_s * 1e9)
        return self.put("i", stamp_ns // 10**9).put("I", stamp_ns % 10**9).string(frame_id)

    def finish(self) -> bytes:
        """Return the message."""
        return bytes(self._content)


class CdrReader:
    """Takes values out of a message; ValueError where it is too short."""

    def __init__(self, content: bytes) -> None:
        """Begin behind the encapsulation, which has to say little-endian."""
        if content[:2] != _ENCAPSULATION[:2]:
            raise ValueError("the message is not CDR in little-endian order")
        self._content, self._at = memoryview(content), 4

    def take(self, kind: str) -> int:
        """Take a whole number of one `struct` type."""
        size = struct.calcsize(f"<{kind}")
        self._at += -(self._at - 4) % size
        return int(struct.unpack(f"<{kind}", self._piece(size))[0])

    def string(self) -> str:
        """Take a text."""
        return bytes(self._piece(self.take("I"))).rstrip(b"\0").decode()

    def blob(self) -> bytes:
        """Take a sequence of bytes."""
        return bytes(self._piece(self.take("I")))

    def header(self) -> None:
        """Pass over std_msgs/Header."""
        self.take("i")
        self.take("I")
        self.string()

    def _piece(self, size: int) -> memoryview:
        piece = self._content[self._at : self._at + size]
        if len(piece) < size:
            raise ValueError("the message is cut off")
        self._at += size
        return piece


@dataclass(frozen=True, kw_only=True)
class RosImage:
    """sensor_msgs/Image without its header."""

    height: int
    width: int
    encoding: str
    """of ROS: rgb8, mono8, yuv422_yuy2, 32FC1 (metres), 16UC1"""
    step: int
    """bytes of a line"""
    data: bytes

    def encode(self, unix_s: float, frame_id: str) -> bytes:
        """Return the message."""
        writer = CdrWriter().header(unix_s, frame_id).put("I", self.height, self.width).string(self.encoding)
        return writer.put("B", 0).put("I", self.step).blob(self.data).finish()

    @classmethod
    def decode(cls, content: bytes) -> Self:
        """Read a message; ValueError where it is damaged."""
        reader = CdrReader(content)
        reader.header()
        height, width, encoding = reader.take("I"), reader.take("I"), reader.string()
        reader.take("B")
        return cls(height=height, width=width, encoding=encoding, step=reader.take("I"), data=reader.blob())


def encode_compressed(data: bytes, unix_s: float, frame_id: str, kind: str) -> bytes:
    """Return sensor_msgs/CompressedImage; kind: jpeg or png."""
    return CdrWriter().header(unix_s, frame_id).string(kind).blob(data).finish()


def decode_compressed(content: bytes) -> bytes:
    """Return the picture of sensor_msgs/CompressedImage; ValueError where it is damaged."""
    reader = CdrReader(content)
    reader.header()
    reader.string()
    return reader.blob()


def encode_string(text: str) -> bytes:
    """Return std_msgs/String."""
    return CdrWriter().string(text).finish()


def decode_string(content: bytes) -> str:
    """Return the text of std_msgs/String; ValueError where it is damaged."""
    return CdrReader(content).string()
