"""Write ONNX files, as far as GelNet needs the format: its messages in the encoding of Protocol Buffers.

The numbers of fields and types are those of the ONNX specification (onnx.proto, IR version 8). The library `onnx` would
be 33 MB for it; the tests judge every file by that library's checker.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

_KINDS = {np.dtype(np.float32): 1, np.dtype(np.int64): 7, np.dtype(np.bool_): 9}
_INTEGER, _SUBGRAPH = 2, 5
"""types of attributes"""


@dataclass(kw_only=True, eq=False)
class Graph:
    """A graph under construction: nodes in the order of computation, and the constants that they read by name."""

    name: str
    inputs: list[bytes] = field(default_factory=list)
    outputs: list[bytes] = field(default_factory=list)
    nodes: list[bytes] = field(default_factory=list)
    constants: dict[str, NDArray[Any]] = field(default_factory=dict)

    def add(self, operation: str, inputs: Sequence[str], output: str, **attributes: "int | Graph") -> str:
        """Append a node, and return the name of its output; attributes are numbers, 0 or more, or branches."""
        names = [_field(1, name) for name in inputs] + [_field(2, output), _field(4, operation)]
        parts = [_field(5, _attribute(name, value)) for name, value in sorted(attributes.items())]
        self.nodes.append(b"".join(names + parts))
        return output

    def encoded(self) -> bytes:
        """Return the message GraphProto."""
        tensors = [_field(5, _tensor(name, value)) for name, value in self.constants.items()]
        nodes = [_field(1, node) for node in self.nodes]
        ends = [_field(11, one) for one in self.inputs] + [_field(12, one) for one in self.outputs]
        return b"".join([*nodes, _field(2, self.name), *tensors, *ends])


def value(name: str, kind: type[np.generic], shape: Sequence[int | str]) -> bytes:
    """Return the message ValueInfoProto of an input or output; a length may be a word, as N for any."""
    sizes = b"".join(_field(1, _field(2 if isinstance(size, str) else 1, size)) for size in shape)
    return _field(1, name) + _field(2, _field(1, _field(1, _KINDS[np.dtype(kind)]) + _field(2, sizes)))


def model(graph: Graph, *, operator_set: int, ir_version: int, properties: Mapping[str, str]) -> bytes:
    """Return a whole file, the same for the same graph."""
    metadata = [_field(14, _field(1, name) + _field(2, text)) for name, text in properties.items()]
    head = [_field(1, ir_version), _field(2, "gelnet"), _field(7, graph.encoded())]
    return b"".join([*head, _field(8, _field(1, "") + _field(2, operator_set)), *metadata])


def _attribute(name: str, held: int | Graph) -> bytes:
    if isinstance(held, Graph):
        return _field(1, name) + _field(6, held.encoded()) + _field(20, _SUBGRAPH)
    return _field(1, name) + _field(3, held) + _field(20, _INTEGER)


def _tensor(name: str, held: NDArray[Any]) -> bytes:
    content = np.ascontiguousarray(held).astype(held.dtype.newbyteorder("<")).tobytes()
    sizes = b"".join(_field(1, size) for size in held.shape)
    return sizes + _field(2, _KINDS[held.dtype]) + _field(8, name) + _field(9, content)


def _field(number: int, content: int | str | bytes) -> bytes:
    """Encode one field: a number, 0 or more, or what has a length."""
    if isinstance(content, int):
        return _varint(number << 3) + _varint(content)
    data = content.encode() if isinstance(content, str) else content
    return _varint(number << 3 | 2) + _varint(len(data)) + data


def _varint(number: int) -> bytes:
    """Seven bits a byte, the lowest first; all but the last byte have their highest bit set."""
    groups = [number & 0x7F]
    while number := number >> 7:
        groups.append(number & 0x7F)
    return bytes([*(group | 0x80 for group in groups[:-1]), groups[-1]])
