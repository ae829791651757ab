"""The exported file answers what was trained, or there is no file."""

from pathlib import Path

import numpy as np
import onnx
import onnxruntime
import pytest
import torch
from onnx import numpy_helper

import gelnet.export
from gelnet.export import BOUND, ExportError, export, to_onnx
from gelnet.network import GelNet


@pytest.fixture
def rows() -> np.ndarray:
    random = np.random.default_rng(0)
    return random.uniform([-60, -60, -60, 0, 0], [60, 60, 60, 639, 479], (3000, 5)).astype(np.float32)


@pytest.fixture
def network(rows: np.ndarray) -> GelNet:
    torch.manual_seed(0)
    made = GelNet(16)
    made.fit_range(torch.from_numpy(rows), torch.full((len(rows), 2), 1.5))
    return made.eval()


def test_the_file_keeps_the_contract_with_the_host(network: GelNet, rows: np.ndarray, tmp_path: Path) -> None:
    path = tmp_path / "network.onnx"
    assert export(network, path, rows=rows, summary={"seed": "7"}) <= BOUND
    session = onnxruntime.InferenceSession(path, providers=["CPUExecutionProvider"])
    (given,), (answered,) = session.get_inputs(), session.get_outputs()
    assert (given.name, given.shape, given.type) == ("pixels", ["N", 5], "tensor(float)")
    assert (answered.name, answered.shape, answered.type) == ("gradient", ["N", 2], "tensor(float)")
    for count in (0, 1, 3000):
        assert session.run(None, {"pixels": rows[:count]})[0].shape == (count, 2)
    properties = session.get_modelmeta().custom_metadata_map
    assert properties["schema"] == "gelnet/1"
    assert properties["width"] == "16"
    assert properties["seed"] == "7"
    assert "d(depth)/dx" in properties["outputs"]


def test_it_answers_what_torch_answers(network: GelNet, rows: np.ndarray, tmp_path: Path) -> None:
    path = tmp_path / "network.onnx"
    export(network, path, rows=rows)
    session = onnxruntime.InferenceSession(path, providers=["CPUExecutionProvider"])
    with torch.no_grad():
        trained = network(torch.from_numpy(rows)).numpy()
    np.testing.assert_allclose(session.run(None, {"pixels": rows})[0], trained, rtol=1e-4, atol=1e-5)


def test_the_same_network_gives_the_same_bytes(network: GelNet, rows: np.ndarray, tmp_path: Path) -> None:
    for name in ("a", "b"):
        export(network, tmp_path / name, rows=rows, summary={"z": "1", "a": "2"})
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()


def tampered(layer: int, change: float):
    def write(network: GelNet, summary: dict[str, str]) -> onnx.ModelProto:
        model = to_onnx(network, summary)
        weight = numpy_helper.to_array(model.graph.initializer[2 * layer]).copy()
        weight.flat[0] += change
        model.graph.initializer[2 * layer].CopyFrom(numpy_helper.from_array(weight, f"weight_{layer + 1}"))
        return model

    return write


@pytest.mark.parametrize(("layer", "change"), [(0, 0.01), (2, 0.01), (4, -0.01), (4, np.nan)])
def test_a_file_that_differs_is_refused_and_removed(
    layer: int,
    change: float,
    network: GelNet,
    rows: np.ndarray,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(gelnet.export, "to_onnx", tampered(layer, change))
    with pytest.raises(ExportError, match=r"differs from the trained network by .* rad"):
        export(network, tmp_path / "network.onnx", rows=rows)
    assert list(tmp_path.iterdir()) == []


def test_a_file_that_cannot_run_is_removed(
    network: GelNet, rows: np.ndarray, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(gelnet.export, "to_onnx", lambda network, summary: onnx.ModelProto())
    with pytest.raises(ExportError, match="cannot be run"):
        export(network, tmp_path / "network.onnx", rows=rows)
    assert list(tmp_path.iterdir()) == []
