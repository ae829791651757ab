"""The network that also answers how its slopes change with the colours, made from the file of the bundle.

The chain rule backwards, layer by layer, as further nodes of the same ONNX graph:

    y = W x + b       dL/dx = dL/dy W
    y = tanh(x)       dL/dx = dL/dy (1 - y^2)
    y = tan(x)        dL/dx = dL/dy (1 + y^2)
    y = c x           dL/dx = dL/dy c, which is multiplied into the weights of the layer before

for L = d(depth)/dx and L = d(depth)/dy. Any number of layers of any width, as long as they follow one after another.
"""

from typing import Any

import numpy as np
from google.protobuf.message import DecodeError
from numpy.typing import NDArray
from onnx import ModelProto, NodeProto, TensorProto
from onnx.helper import get_attribute_value, make_node, make_tensor_value_info
from onnx.numpy_helper import from_array, to_array

_COLOURS = 3
"""The first inputs of a row are the difference in three channels."""


class NotAChainError(ValueError):
    """The network holds something that the chain rule is not written for here."""


def read_model(content: bytes) -> ModelProto:
    """Return the graph of an ONNX file; ValueError where the bytes are none."""
    model = ModelProto()
    try:
        model.ParseFromString(content)
    except DecodeError as error:
        raise ValueError(f"these {len(content)} bytes are no ONNX file ({error})") from error
    return model


def constants_of(model: ModelProto) -> dict[str, NDArray[np.float32]]:
    """Return the float32 constants of a graph by name, without those that lie in other files."""
    return {
        tensor.name: to_array(tensor)
        for tensor in model.graph.initializer
        if tensor.data_type == TensorProto.FLOAT and tensor.data_location == TensorProto.DEFAULT
    }


def with_jacobian(network: bytes) -> bytes:
    """Return the ONNX network with a second output "jacobian" (N, 6), or (1, 6) where it is the same for all rows.

    It holds d(slope x)/d(colours), then d(slope y)/d(colours), per grey level. Raises NotAChainError where
    the network is not one chain of Gemm, Tanh, Tan and Mul by a constant, from "pixels" to "gradient".
    """
    try:
        model = read_model(network)
        constants = constants_of(model)
    except ValueError as error:
        raise NotAChainError(str(error)) from error
    chain = _chain(model)
    parts = [_Backwards(model, constants, f"jacobian/{name}").run(chain, axis) for axis, name in enumerate("xy")]
    model.graph.node.append(make_node("Concat", parts, ["jacobian"], axis=1))
    model.graph.output.append(make_tensor_value_info("jacobian", TensorProto.FLOAT, ["N", 2 * _COLOURS]))
    return bytes(model.SerializeToString(deterministic=True))


def _chain(model: ModelProto) -> list[NodeProto]:
    """Nodes from the output back to the input."""
    makes = {node.output[0]: node for node in model.graph.node}
    value = "gradient"
    chain: list[NodeProto] = []
    while value != "pixels":
        if value not in makes or len(chain) > len(makes):
            raise NotAChainError(f"nothing leads from the input to {value!r}")
        node = makes[value]
        chain.append(node)
        value = _carried(node, makes)
    return chain


def _carried(node: NodeProto, makes: dict[str, NodeProto]) -> str:
    """The input of a node that is not a constant."""
    inputs = [str(name) for name in node.input if name in makes or name == "pixels"]
    if len(inputs) != 1:
        raise NotAChainError(f"{node.op_type} {node.output[0]!r} joins {len(inputs)} values")
    return inputs[0]


class _Backwards:
    """One slope's derivative on its way from the output to the colours."""

    def __init__(self, model: ModelProto, constants: dict[str, NDArray[np.float32]], prefix: str) -> None:
        """Begin with 1, the derivative of the slope in itself."""
        self._model, self._constants, self._prefix = model, constants, prefix
        self._made = 0
        self._factor = np.float32(1)
        self._value = self._one = self._constant(np.ones((1, 1), np.float32))

    def run(self, chain: list[NodeProto], column: int) -> str:
        """Return the name of the (N, 3) derivative of one column of the output."""
        self._column: int | None = column
        for position, node in enumerate(chain):
            if node.op_type == "Gemm":
                self._through_layer(node, last=position == len(chain) - 1)
            elif node.op_type in ("Tanh", "Tan"):
                self._through_function(node)
            elif node.op_type == "Mul":
                self._factor *= self._scalar(node)
            else:
                raise NotAChainError(f"{node.op_type} {node.output[0]!r}")
        if chain[-1].op_type != "Gemm":
            raise NotAChainError(f"the first node is {chain[-1].op_type}")
        return self._value

    def _through_layer(self, node: NodeProto, *, last: bool) -> None:
        given = {attribute.name: get_attribute_value(attribute) for attribute in node.attribute}
        weights = self._constants.get(node.input[1])
        if given.get("transA", 0) or weights is None or {given.get("alpha", 1), given.get("beta", 1)} != {1}:
            raise NotAChainError(f"Gemm {node.output[0]!r} is not W x + b")
        weights = weights if given.get("transB", 0) else weights.T  # (out, in)
        if self._column is not None:  # before the last layer the columns are the two slopes
            weights = weights[self._column : self._column + 1]
            if self._value != self._one:
                self._add("Gather", self._value, self._constant(np.array([self._column], np.int64)), axis=1)
            self._column = None
        # A node that multiplies a column by one number takes as long as a whole layer's product.
        weights, self._factor = weights * self._factor, np.float32(1)
        self._add("MatMul", self._value, self._constant(weights[:, :_COLOURS] if last else weights))

    def _through_function(self, node: NodeProto) -> None:
        answer = str(node.output[0])
        square = self._node("Mul", answer, answer)
        slope = self._node("Sub" if node.op_type == "Tanh" else "Add", self._one, square)
        if self._value == self._one:
            self._value = slope
        else:
            self._add("Mul", self._value, slope)

    def _scalar(self, node: NodeProto) -> np.float32:
        found = [self._constants[name] for name in node.input if name in self._constants]
        if not found or found[0].size != 1:
            raise NotAChainError(f"Mul {node.output[0]!r} is not by one number")
        return np.float32(found[0].item())

    def _add(self, operation: str, *inputs: str, **attributes: Any) -> None:
        self._value = self._node(operation, *inputs, **attributes)

    def _node(self, operation: str, *inputs: str, **attributes: Any) -> str:
        self._model.graph.node.append(make_node(operation, inputs, [name := self._name()], **attributes))
        return name

    def _constant(self, value: NDArray[Any]) -> str:
        self._model.graph.initializer.append(from_array(value, name := self._name()))
        return name

    def _name(self) -> str:
        self._made += 1
        return f"{self._prefix}/{self._made}"
