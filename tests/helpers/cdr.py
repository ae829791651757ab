"""Messages of ROS 2 decoded by the definition that came with them; nightly tests compare it with `rosbags`."""

import re
import struct
from types import SimpleNamespace
from typing import Any

import numpy as np

KINDS = {
    "bool": "?", "byte": "B", "uint8": "B", "int32": "i", "uint32": "I", "float32": "f", "float64": "d",
}  # fmt: skip
FIELD = re.compile(r"^([\w/]+?)(\[\d*\])? +(\w+)", re.MULTILINE)


def decoded(content: bytes, definition: str) -> Any:
    """Return the message; what is not read to its last byte, but for padding to 4, is refused."""
    first, *others = re.split(r"^=+\nMSG: ", definition, flags=re.MULTILINE)
    types = {"": first} | {text.partition("\n")[0]: text.partition("\n")[2] for text in others}
    assert content[:4] == b"\x00\x01\x00\x00", "little-endian, XCDR version 1"
    reader = _Reader(content[4:], types)
    message = reader.structure("")
    assert reader.place <= len(reader.content) < reader.place + 4
    return message


class _Reader:
    def __init__(self, content: bytes, types: dict[str, str]) -> None:
        self.content, self.types, self.place = content, types, 0

    def structure(self, name: str) -> SimpleNamespace:
        fields = FIELD.findall(self.types[name])
        return SimpleNamespace(**{field: self.field(kind, sequence) for kind, sequence, field in fields})

    def field(self, kind: str, sequence: str) -> Any:
        if not sequence:
            return self.one(kind)
        count = int(sequence[1:-1] or self.one("uint32"))
        if kind not in KINDS:
            return [self.one(kind) for _ in range(count)]
        size = struct.calcsize(KINDS[kind])
        if count:
            self.place += -self.place % size
        self.place += count * size
        return np.frombuffer(self.content, f"<{KINDS[kind]}", count, self.place - count * size)

    def one(self, kind: str) -> Any:
        if kind == "string":
            length = self.one("uint32")
            self.place += length
            assert self.content[self.place - 1] == 0
            return self.content[self.place - length : self.place - 1].decode()
        if kind not in KINDS:
            return self.structure(kind)
        size = struct.calcsize(KINDS[kind])
        self.place += -self.place % size + size
        return struct.unpack_from(f"<{KINDS[kind]}", self.content, self.place - size)[0]
