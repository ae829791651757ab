"""How the slopes change with the channels, in the ONNX file: the chain rule backwards through the layers of GelNet.

    y = W x + b       dL/dx = dL/dy W
    y = tanh(x)       dL/dx = dL/dy (1 - y^2)
    y = tan(c x)      dL/dx = dL/dy c (1 + y^2)

for L = d(depth)/dx and L = d(depth)/dy together, as arrays (N, 2, units) from the last layer to the first.
"""

from typing import Any

import numpy as np
from onnx import GraphProto, NodeProto, TensorProto, ValueInfoProto
from onnx.helper import make_graph, make_node, make_tensor_value_info
from onnx.numpy_helper import from_array, to_array

from gelnet.parameters import LAYERS


def add_jacobian(graph: GraphProto, channels: int) -> None:
    """Give the graph that `export.to_onnx` makes an output "jacobian" (N, 2 C) for its C channels.

    It holds d(slope x)/d(channels), then d(slope y)/d(channels), and is computed where the input "with_jacobian" is
    true. Who does not give that input gets an empty one, which costs nothing.
    """
    columns = 2 * channels
    nothing = make_graph(
        [], "forwards", [], [_floats("none", 0, columns)], [from_array(np.zeros((0, columns), np.float32), "none")]
    )
    backwards = _backwards(graph, channels)
    graph.node.append(make_node("If", ["with_jacobian"], ["jacobian"], then_branch=backwards, else_branch=nothing))
    graph.input.append(make_tensor_value_info("with_jacobian", TensorProto.BOOL, []))
    graph.initializer.append(from_array(np.array(False), "with_jacobian"))
    graph.output.append(_floats("jacobian", "N", columns))


def _backwards(graph: GraphProto, channels: int) -> GraphProto:
    """The branch that computes it; it reads weights and layers of the graph around it by their names."""
    weights = {tensor.name: to_array(tensor) for tensor in graph.initializer}
    constants = {
        "one": np.ones(1, np.float32),
        "each_slope": np.array([1]),
        "each_unit": np.array([2]),
        "weight_out": weights[f"weight_{LAYERS}"] * weights["steepest_rad"],
        "weight_in": np.ascontiguousarray(weights["weight_1"][:, :channels]),
    }
    nodes: list[NodeProto] = []

    def node(operation: str, *inputs: str, **attributes: Any) -> str:
        nodes.append(make_node(operation, inputs, [name := f"backwards_{len(nodes)}"], **attributes))
        return name

    def through_tanh(layer: int) -> str:
        return node("Sub", "one", node("Mul", f"tanh_{layer}", f"tanh_{layer}"))

    through_tan = node("Add", "one", node("Mul", "gradient", "gradient"))
    value = node("Unsqueeze", node("Mul", through_tan, through_tanh(LAYERS)), "each_unit")
    value = node("Mul", value, "weight_out")
    for layer in range(LAYERS - 1, 0, -1):
        value = node("Mul", value, node("Unsqueeze", through_tanh(layer), "each_slope"))
        value = node("MatMul", value, f"weight_{layer}" if layer > 1 else "weight_in")
    answer = node("Flatten", value, axis=1)
    tensors = [from_array(constant, name) for name, constant in constants.items()]
    return make_graph(nodes, "backwards", [], [_floats(answer, "N", 2 * channels)], tensors)


def _floats(name: str, rows: int | str, columns: int) -> ValueInfoProto:
    return make_tensor_value_info(name, TensorProto.FLOAT, [rows, columns])
