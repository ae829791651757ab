"""The network that also answers how its slopes change with the colours, made from the file of the bundle.

The chain rule backwards, layer by layer, as further nodes of the same ONNX graph:

    y = W x + b       dL/dx = dL/dy W
    y = tanh(x)       dL/dx = dL/dy (1 - y^2)
    y = tan(x)        dL/dx = dL/dy (1 + y^2)
    y = c x           dL/dx = dL/dy c

for L = d(depth)/dx and L = d(depth)/dy. Any number of layers of any width, as long as they follow one after another.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gellight.reconstruction.onnx_messages import (
    add_constant,
    add_node,
    add_output,
    attributes,
    initializers,
    read_model,
)

_COLOURS = 3
"""The first inputs of a row are the difference in three channels."""


class NotAChainError(ValueError):
    """The network holds something that the chain rule is not written for here."""


def with_jacobian(network: bytes) -> bytes:
    """Return the ONNX network with a second output "jacobian" (N, 6), or (1, 6) where it is the same for all rows.

    It holds d(slope x)/d(colours), then d(slope y)/d(colours), per grey level. Raises NotAChainError where
    the network is not one chain of Gemm, Tanh, Tan and Mul by a constant, from "pixels" to "gradient".
    """
    try:
        model = read_model(network)
    except ValueError as error:
        raise NotAChainError(str(error)) from error
    constants = initializers(model)
    chain = _chain(model)
    one = add_constant(model, "jacobian/one", np.ones((1, 1), np.float32))
    parts = [_Backwards(model, constants, f"jacobian/{name}", one).run(chain, axis) for axis, name in enumerate("xy")]
    add_node(model, "Concat", parts, "jacobian", axis=1)
    add_output(model, "jacobian", 2 * _COLOURS)
    return bytes(model.SerializeToString(deterministic=True))


def _chain(model: Any) -> list[Any]:
    """Nodes from the output back to the input."""
    makes = {node.output[0]: node for node in model.graph.node}
    value = "gradient"
    chain: list[Any] = []
    while value != "pixels":
        if value not in makes or len(chain) > len(makes):
            raise NotAChainError(f"nothing leads from the input to {value!r}")
        node = makes[value]
        chain.append(node)
        value = _carried(node, makes)
    return chain


def _carried(node: Any, makes: dict[str, Any]) -> str:
    """The input of a node that is not a constant."""
    inputs = [str(name) for name in node.input if name in makes or name == "pixels"]
    if len(inputs) != 1:
        raise NotAChainError(f"{node.op_type} {node.output[0]!r} joins {len(inputs)} values")
    return inputs[0]


class _Backwards:
    """One slope's derivative on its way from the output to the colours."""

    def __init__(self, model: Any, constants: dict[str, NDArray[np.float32]], prefix: str, one: str) -> None:
        """Begin with 1, the derivative of the slope in itself."""
        self._model, self._constants, self._prefix, self._one = model, constants, prefix, one
        self._value = one
        self._made = 0

    def run(self, chain: list[Any], column: int) -> str:
        """Return the name of the (N, 3) derivative of one column of the output."""
        self._column: int | None = column
        for position, node in enumerate(chain):
            if node.op_type == "Gemm":
                self._through_layer(node, last=position == len(chain) - 1)
            elif node.op_type in ("Tanh", "Tan"):
                self._through_function(node)
            elif node.op_type == "Mul":
                self._multiply(self._scalar(node))
            else:
                raise NotAChainError(f"{node.op_type} {node.output[0]!r}")
        if chain[-1].op_type != "Gemm":
            raise NotAChainError(f"the first node is {chain[-1].op_type}")
        return self._value

    def _through_layer(self, node: Any, *, last: bool) -> None:
        given = attributes(node)
        weights = self._constants.get(node.input[1])
        if given.get("transA", 0) or weights is None or {given.get("alpha", 1), given.get("beta", 1)} != {1}:
            raise NotAChainError(f"Gemm {node.output[0]!r} is not W x + b")
        weights = weights if given.get("transB", 0) else weights.T  # (out, in)
        if self._column is not None:
            weights, self._column = weights[self._column : self._column + 1], None
        self._add("MatMul", self._value, self._constant(weights[:, :_COLOURS] if last else weights))

    def _through_function(self, node: Any) -> None:
        answer = self._only_column(str(node.output[0]))
        square = self._node("Mul", answer, answer)
        self._multiply(self._node("Sub" if node.op_type == "Tanh" else "Add", self._one, square))

    def _only_column(self, value: str) -> str:
        """Before the last layer there is one column a slope; of hidden layers all columns count."""
        if self._column is None:
            return value
        return self._node("Gather", value, self._constant(np.array([self._column], np.int64)), axis=1)

    def _scalar(self, node: Any) -> str:
        name = next((str(name) for name in node.input if name in self._constants), "")
        if not name or self._constants[name].size != 1:
            raise NotAChainError(f"Mul {node.output[0]!r} is not by one number")
        return name

    def _multiply(self, factor: str) -> None:
        self._add("Mul", self._value, factor)

    def _add(self, operation: str, *inputs: str) -> None:
        self._value = self._node(operation, *inputs)

    def _node(self, operation: str, *inputs: str, **integers: int) -> str:
        self._made += 1
        return add_node(self._model, operation, list(inputs), f"{self._prefix}/{self._made}", **integers)

    def _constant(self, value: NDArray[Any]) -> str:
        self._made += 1
        return add_constant(self._model, f"{self._prefix}/{self._made}", value)
