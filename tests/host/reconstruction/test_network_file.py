"""A network from a stranger: what could loop, read a file or fill the memory is refused before it is loaded."""

import time
from pathlib import Path

import numpy as np
import onnx
import pytest
from onnx import TensorProto, helper, numpy_helper

from gellight.base.errors import BundleError
from gellight.bundle.bundle import load_bundle
from gellight.reconstruction.network_file import MOST_BYTES, OPERATIONS, WIDEST, check_network, weights_of
from gellight.reconstruction.network_session import NetworkSession

PIXELS = helper.make_tensor_value_info("pixels", TensorProto.FLOAT, ["N", 5])
GRADIENT = helper.make_tensor_value_info("gradient", TensorProto.FLOAT, ["N", 2])


def network(nodes: list[onnx.NodeProto], constants: list[onnx.TensorProto] | None = None, **more: object) -> bytes:
    graph = helper.make_graph(nodes, "other", [PIXELS], [GRADIENT], constants or [])
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], **more)
    return bytes(model.SerializeToString())


def constant(name: str, values: np.ndarray) -> onnx.TensorProto:
    return numpy_helper.from_array(values, name)


def endless() -> onnx.NodeProto:
    body = helper.make_graph(
        [helper.make_node("Identity", ["go_on"], ["again"])],
        "body",
        [
            helper.make_tensor_value_info("turn", TensorProto.INT64, []),
            helper.make_tensor_value_info("go_on", TensorProto.BOOL, []),
        ],
        [helper.make_tensor_value_info("again", TensorProto.BOOL, [])],
    )
    return helper.make_node("Loop", ["", "yes"], [], body=body)


def elsewhere() -> onnx.TensorProto:
    """A constant that lies in another file of the computer."""
    tensor = TensorProto(name="weights", data_type=TensorProto.FLOAT, dims=[2, 5])
    tensor.data_location = TensorProto.EXTERNAL
    for key, value in (("location", "../../../../etc/passwd"), ("offset", "0"), ("length", "40")):
        tensor.external_data.add(key=key, value=value)
    return tensor


GEMM = helper.make_node("Gemm", ["pixels", "weights"], ["gradient"], transB=1)
IDENTITY = helper.make_node("Identity", ["pixels"], ["gradient"])
BOMB = constant("shape", np.array([1 << 20, 1 << 20]))
INSIDE = helper.make_graph([helper.make_node("ConstantOfShape", ["shape"], ["gradient"])], "inside", [], [GRADIENT])
OWN = helper.make_function(
    "own", "F", ["x"], ["y"], [helper.make_node("Identity", ["x"], ["y"])], [helper.make_opsetid("", 17)]
)

HOSTILE = {
    "loops": (network([endless()], [constant("yes", np.array(True))]), "the operator 'Loop' is none of"),
    "fills the memory": (
        network([helper.make_node("ConstantOfShape", ["shape"], ["gradient"])], [BOMB]), "operator 'ConstantOfShape'",
    ),
    "fills it in a branch": (
        network([helper.make_node("If", ["yes"], ["gradient"], then_branch=INSIDE, else_branch=INSIDE)], [BOMB]),
        "operator 'ConstantOfShape'",
    ),
    "reads a file": (network([GEMM], [elsewhere()]), "its constants lie in another file"),
    "reads a file in an attribute": (
        network([helper.make_node("Constant", [], ["gradient"], value=elsewhere())]), "lie in another file",
    ),
    "another domain": (
        network([helper.make_node("Gemm", ["pixels", "weights"], ["gradient"], domain="com.microsoft")]),
        "the operator 'Gemm' is none of",
    ),
    "a function": (network([IDENTITY], functions=[OWN]), "functions of its own"),
    "a wide layer": (network([GEMM], [constant("weights", np.zeros((WIDEST + 1, 5), np.float32))]), r"\[4097, 5\]"),
    "too large": (network([GEMM], [constant("weights", np.zeros((1024, 1025), np.float32))]), "it has 4.2 MB"),
    "no network": (b"", "it holds no network"),
    "text": (b"not a network at all", "it is damaged"),
}  # fmt: skip


@pytest.mark.parametrize("name", HOSTILE)
def test_a_network_that_could_do_more_than_compute_is_refused(name: str) -> None:
    content, message = HOSTILE[name]
    begun_s = time.process_time()
    with pytest.raises(BundleError, match=rf"a stranger's: the network cannot be loaded \(.*{message}"):
        NetworkSession(content, source="a stranger's")
    assert time.process_time() - begun_s < 5


def test_graphs_that_lie_in_each_other_end_somewhere() -> None:
    graph = helper.make_graph([IDENTITY], "deepest", [], [GRADIENT])
    for _ in range(12):
        graph = helper.make_graph([helper.make_node("If", ["yes"], ["gradient"], then_branch=graph)], "g", [], [])
    with pytest.raises(BundleError, match="graphs inside of graphs"):
        check_network(network(list(graph.node)), "a stranger's")


def test_the_networks_of_gellight_pass_and_their_weights_are_read() -> None:
    bundle = load_bundle("synthetic")
    check_network(bundle.network, "synthetic")
    model = onnx.load_from_string(bundle.network)
    weights = weights_of(bundle.network)
    for tensor in model.graph.initializer:
        if tensor.data_type == TensorProto.FLOAT:
            np.testing.assert_array_equal(weights[tensor.name], numpy_helper.to_array(tensor))
    assert {"weight_1", "bias_5", "steepest_rad"} <= set(weights)


def test_lengths_that_are_packed_into_one_field_count_too(tmp_path: Path) -> None:
    """Writers may pack the lengths of a tensor."""
    graph = network([GEMM], [constant("weights", np.zeros((2, 5), np.float32))])
    apart, packed = b"\x08\x02\x08\x05\x10\x01", b"\x0a\x02\x02\x05\x10\x01"
    assert apart in graph
    assert weights_of(graph.replace(apart, packed))["weights"].shape == (2, 5)


def test_no_operator_that_is_allowed_makes_more_rows() -> None:
    assert not OPERATIONS & {"Loop", "Scan", "Expand", "Tile", "Concat", "ConstantOfShape", "Range", "Resize", "Pad"}
    assert MOST_BYTES < 1 << 23
