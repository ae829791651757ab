"""What an ONNX file holds, read before ONNX Runtime loads it: its weights, and that it only computes slopes.

A bundle may come from a stranger. Its network may name the operators of `OPERATIONS` alone: none of them loops, reads a
file or makes its output larger than rows times a width that its weights have. ModelProto, GraphProto, NodeProto,
AttributeProto and TensorProto are those of onnx.proto, version 3.
"""

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import BundleError

Floats = NDArray[np.float32]

_ARITHMETIC = ("Gemm", "MatMul", "Add", "Sub", "Mul", "Div", "Neg", "Abs", "Pow", "Sqrt", "Exp", "Min", "Max", "Clip")
_BENDS = ("Sin", "Cos", "Tan", "Atan", "Tanh", "Sigmoid", "Relu", "LeakyRelu", "Elu", "Softplus")
_FORM = ("Cast", "Constant", "Identity", "Flatten", "Squeeze", "Unsqueeze", "If")
OPERATIONS = frozenset([*_ARITHMETIC, *_BENDS, *_FORM])
MOST_BYTES = 4 * 1024 * 1024
"""of the file; GelNet's has 0.02 MB"""
WIDEST = 4096
"""outputs of a layer"""
_DEEPEST = 4
"""graphs inside of graphs; GelNet's has one in the other"""
_LISTS = (10, 11, 22, 23)
"""attributes of tensors, graphs and sparse tensors"""
_FLOAT, _NUMBER, _MESSAGE = 1, 0, 2  # onnx.proto: TensorProto.FLOAT; protobuf's wire types VARINT and LEN
_SIZES = {1: 8, 5: 4}
"""bytes of the other kinds of field"""

Fields = list[tuple[int, Any]]


def check_network(content: bytes, source: str) -> None:
    """Raise BundleError for a file that is damaged or could do more than compute; source: the name of the bundle."""
    try:
        wrong = _what_is_wrong(content)
    except (IndexError, KeyError, ValueError, TypeError) as error:
        wrong = f"it is damaged ({type(error).__name__})"
    if wrong:
        raise BundleError(
            f"{source}: the network cannot be loaded ({wrong}): train the network again with this GelLight and write a "
            "new bundle"
        )


def _what_is_wrong(content: bytes) -> str:
    if len(content) > MOST_BYTES:
        return f"it has {len(content) / 1e6:.1f} MB, allowed are {MOST_BYTES / 1e6:.1f}"
    model = _fields(content)
    if any(number == 25 for number, _ in model):
        return "it defines functions of its own"
    graphs = [value for number, value in model if number == 7]
    if not graphs:
        return "it holds no network"
    return next(filter(None, (_wrong_in_graph(graph, _DEEPEST) for graph in graphs)), "")


def _wrong_in_graph(graph: bytes, deeper: int) -> str:
    if deeper == 0:
        return "it has graphs inside of graphs inside of graphs"
    for number, value in _fields(graph):
        wrong = _wrong_in_node(value, deeper) if number == 1 else _wrong_in_tensor(value) if number == 5 else ""
        if wrong or number == 15:
            return wrong or "it has sparse constants"
    return ""


def _wrong_in_node(node: bytes, deeper: int) -> str:
    fields = _fields(node)
    domain, operation = (b"".join(value for number, value in fields if number == wanted) for wanted in (7, 4))
    name = operation.decode(errors="replace")
    if domain or name not in OPERATIONS:
        return f"the operator {name!r} is none of {', '.join(sorted(OPERATIONS))}"
    for number, value in (part for field, attribute in fields if field == 5 for part in _fields(attribute)):
        if number in _LISTS:
            return f"the operator {name!r} has a list of tensors or graphs"
        wrong = _wrong_in_tensor(value) if number == 5 else _wrong_in_graph(value, deeper - 1) if number == 6 else ""
        if wrong:
            return wrong
    return ""


def _wrong_in_tensor(tensor: bytes) -> str:
    fields = _fields(tensor)
    if any(number in (13, 14) for number, _ in fields):
        return "its constants lie in another file"
    shape = _shape(fields)
    return f"a constant has the shape {shape}: at most {WIDEST} each way" if max(shape, default=0) > WIDEST else ""


def weights_of(content: bytes) -> dict[str, Floats]:
    """Return the float32 constants of an ONNX file that was checked, by name."""
    found = {}
    for graph in (value for number, value in _fields(content) if number == 7):
        for tensor in (value for number, value in _fields(graph) if number == 5):
            fields = _fields(tensor)
            known, shape = dict(fields), _shape(fields)
            held = known.get(9, b"")
            if known.get(2) == _FLOAT and len(held) == 4 * math.prod(shape):
                found[known[8].decode()] = np.frombuffer(held, "<f4").reshape(shape)
    return found


def _shape(fields: Fields) -> list[int]:
    """Return the lengths of a tensor, one field each or packed into one."""
    lengths = [value for number, value in fields if number == 1]
    return [size for value in lengths for size in ([value] if isinstance(value, int) else _varints(value))]


def _fields(message: bytes) -> Fields:
    """Return number and value of the fields of a message of Protocol Buffers: whole numbers and bytes, no others."""
    return list(_each_field(message))


def _each_field(message: bytes) -> Iterator[tuple[int, Any]]:
    at = 0
    while at < len(message):
        key, at = _varint(message, at)
        kind = key & 7
        if kind == _NUMBER:
            value, at = _varint(message, at)
            yield key >> 3, value
            continue
        size, at = _varint(message, at) if kind == _MESSAGE else (_SIZES[kind], at)
        if at + size > len(message):
            raise ValueError("a field ends behind its message")
        if kind == _MESSAGE:
            yield key >> 3, message[at : at + size]
        at += size


def _varints(packed: bytes) -> Iterator[int]:
    at = 0
    while at < len(packed):
        value, at = _varint(packed, at)
        yield value


def _varint(message: bytes, at: int) -> tuple[int, int]:
    """Read a number of seven bits a byte, the lowest first; return it and the place behind it."""
    value = shift = 0
    while message[at] >= 128:
        if shift > 63:
            raise ValueError("a number has more than 64 bits")
        value |= (message[at] & 127) << shift
        at, shift = at + 1, shift + 7
    return value | message[at] << shift, at + 1
