"""How the slopes change with the channels, in the ONNX file: the chain rule backwards through the layers of GelNet.

    y = W x + b       dL/dx = dL/dy W
    y = tanh(x)       dL/dx = dL/dy (1 - y^2)
    y = tan(c x)      dL/dx = dL/dy c (1 + y^2)

for L = d(depth)/dx and L = d(depth)/dy together, as arrays (N, 2, units) from the last layer to the first.
"""

import numpy as np

from gelnet.onnx_file import Graph, value
from gelnet.parameters import LAYERS


def add_jacobian(graph: Graph, channels: int) -> None:
    """Give the graph that `export.to_onnx` makes an output "jacobian" (N, 2 C) for its C channels.

    It holds d(slope x)/d(channels), then d(slope y)/d(channels), and is computed where the input "with_jacobian" is
    true. Who does not give that input gets an empty one, which costs nothing.
    """
    columns = 2 * channels
    nothing = Graph(
        name="forwards",
        outputs=[value("none", np.float32, [0, columns])],
        constants={"none": np.zeros((0, columns), np.float32)},
    )
    backwards = _backwards(graph, channels)
    graph.add("If", ["with_jacobian"], "jacobian", then_branch=backwards, else_branch=nothing)
    graph.inputs.append(value("with_jacobian", np.bool_, []))
    graph.constants["with_jacobian"] = np.array(False)
    graph.outputs.append(value("jacobian", np.float32, ["N", columns]))


def _backwards(graph: Graph, channels: int) -> Graph:
    """The branch that computes it; it reads weights and layers of the graph around it by their names."""
    weights = graph.constants
    branch = Graph(name="backwards")
    branch.constants = {
        "one": np.ones(1, np.float32),
        "each_slope": np.array([1]),
        "each_unit": np.array([2]),
        "weight_out": weights[f"weight_{LAYERS}"] * weights["steepest_rad"],
        "weight_in": np.ascontiguousarray(weights["weight_1"][:, :channels]),
    }

    def node(operation: str, *inputs: str, **attributes: int) -> str:
        return branch.add(operation, inputs, f"backwards_{len(branch.nodes)}", **attributes)

    def through_tanh(layer: int) -> str:
        return node("Sub", "one", node("Mul", f"tanh_{layer}", f"tanh_{layer}"))

    through_tan = node("Add", "one", node("Mul", "gradient", "gradient"))
    last = node("Unsqueeze", node("Mul", through_tan, through_tanh(LAYERS)), "each_unit")
    last = node("Mul", last, "weight_out")
    for layer in range(LAYERS - 1, 0, -1):
        last = node("Mul", last, node("Unsqueeze", through_tanh(layer), "each_slope"))
        last = node("MatMul", last, f"weight_{layer}" if layer > 1 else "weight_in")
    branch.outputs.append(value(node("Flatten", last, axis=1), np.float32, ["N", 2 * channels]))
    return branch
