"""The part of ONNX files that the host reads and extends, described to the protobuf library.

ONNX Runtime brings that library along; the `onnx` package would add 31 MB. Fields that are not named here pass through
unchanged. The numbers are those of the ONNX specification (onnx.proto).
"""

from functools import cache
from typing import Any

import numpy as np
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from google.protobuf.message import DecodeError
from numpy.typing import NDArray

_MESSAGES: dict[str, dict[str, tuple[int, str]]] = {
    "ModelProto": {"graph": (7, "GraphProto")},
    "GraphProto": {
        "node": (1, "*NodeProto"),
        "initializer": (5, "*TensorProto"),
        "input": (11, "*ValueInfoProto"),
        "output": (12, "*ValueInfoProto"),
    },
    "NodeProto": {"input": (1, "*string"), "output": (2, "*string"), "op_type": (4, "string"),
                  "attribute": (5, "*AttributeProto")},
    "AttributeProto": {"name": (1, "string"), "f": (2, "float"), "i": (3, "int64"), "type": (20, "int32")},
    "TensorProto": {"dims": (1, "*int64"), "data_type": (2, "int32"), "float_data": (4, "*float"),
                    "name": (8, "string"), "raw_data": (9, "bytes")},
    "ValueInfoProto": {"name": (1, "string"), "type": (2, "TypeProto")},
    "TypeProto": {"tensor_type": (1, "TensorTypeProto")},
    "TensorTypeProto": {"elem_type": (1, "int32"), "shape": (2, "ShapeProto")},
    "ShapeProto": {"dim": (1, "*DimensionProto")},
    "DimensionProto": {"dim_value": (1, "int64"), "dim_param": (2, "string")},
}  # fmt: skip
"""message: field: number and type; * marks a repeated field"""
_PACKAGE = "gellight.onnx"
_FLOAT, _INT64 = 1, 7
"""of TensorProto.data_type"""
_ATTRIBUTE_FLOAT, _ATTRIBUTE_INT = 1, 2


@cache
def _classes() -> dict[str, Any]:
    file = descriptor_pb2.FileDescriptorProto(name="gellight/onnx.proto", package=_PACKAGE, syntax="proto2")
    for message, fields in _MESSAGES.items():
        described = file.message_type.add(name=message)
        for name, (number, kind) in fields.items():
            label = "LABEL_REPEATED" if kind.startswith("*") else "LABEL_OPTIONAL"
            field = described.field.add(name=name, number=number, label=label)
            kind = kind.removeprefix("*")
            if kind in _MESSAGES:
                field.type, field.type_name = field.TYPE_MESSAGE, f".{_PACKAGE}.{kind}"
            else:
                field.type = getattr(field, f"TYPE_{kind.upper()}")
    pool = descriptor_pool.DescriptorPool()
    pool.Add(file)
    return {name: message_factory.GetMessageClass(pool.FindMessageTypeByName(f"{_PACKAGE}.{name}"))
            for name in _MESSAGES}  # fmt: skip


def read_model(content: bytes) -> Any:
    """Return the ModelProto of an ONNX file; ValueError where the bytes are none."""
    model = _classes()["ModelProto"]()
    try:
        model.ParseFromString(content)
    except DecodeError as error:
        raise ValueError(f"these {len(content)} bytes are no ONNX file ({error})") from error
    return model


def initializers(model: Any) -> dict[str, NDArray[np.float32]]:
    """Return the float32 constants of a model by name."""
    found = {}
    for tensor in model.graph.initializer:
        if tensor.data_type == _FLOAT:
            values = np.frombuffer(tensor.raw_data, "<f4") if tensor.raw_data else np.array(tensor.float_data, "<f4")
            found[tensor.name] = values.reshape(tuple(tensor.dims)).astype(np.float32)
    return found


def attributes(node: Any) -> dict[str, float]:
    """Return the numbers that a node carries."""
    return {a.name: a.f if a.type == _ATTRIBUTE_FLOAT else a.i for a in node.attribute}


def add_constant(model: Any, name: str, value: NDArray[Any]) -> str:
    """Add a float32 or int64 constant; return its name."""
    kind, stored = (_INT64, "<i8") if value.dtype.kind == "i" else (_FLOAT, "<f4")
    model.graph.initializer.add(
        name=name, dims=value.shape, data_type=kind, raw_data=np.ascontiguousarray(value, stored).tobytes()
    )
    return name


def add_node(model: Any, operation: str, inputs: list[str], output: str, **integers: int) -> str:
    """Add a node with one output; return the output's name."""
    node = model.graph.node.add(input=inputs, output=[output], op_type=operation)
    for name, value in integers.items():
        node.attribute.add(name=name, i=value, type=_ATTRIBUTE_INT)
    return output


def add_output(model: Any, name: str, columns: int) -> None:
    """Declare a float32 output (N, columns) of the graph."""
    output = model.graph.output.add(name=name)
    output.type.tensor_type.elem_type = _FLOAT
    output.type.tensor_type.shape.dim.add(dim_param="N")
    output.type.tensor_type.shape.dim.add(dim_value=columns)
