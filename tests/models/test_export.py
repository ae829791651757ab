"""The exported file answers what was trained, or there is no file."""

from pathlib import Path

import numpy as np
import onnx
import onnxruntime
import pytest
from onnx import numpy_helper

import gelnet.export
from gelnet.export import BOUND, ExportError, export, to_onnx
from gelnet.parameters import Parameters
from gelnet.recipes import RECIPES
from gelnet.trainers import make_trainer
from gelnet.training import Trainer
from tests.helpers.trainers import TRAINERS


@pytest.fixture
def rows() -> np.ndarray:
    random = np.random.default_rng(0)
    return random.uniform([-60, -60, -60, 0, 0], [60, 60, 60, 639, 479], (3000, 5)).astype(np.float32)


@pytest.fixture(params=TRAINERS)
def network(request: pytest.FixtureRequest, rows: np.ndarray) -> Trainer:
    made = make_trainer(request.param, seed=0)
    made.begin(rows, np.full((len(rows), 2), 1.5, np.float32), width=16, recipe=RECIPES["fast"])
    return made


def written(network: Trainer, path: Path, rows: np.ndarray, **summary: str) -> float:
    return export(network.parameters(), path, rows=rows, answer=network.answer, summary=summary)


def test_the_file_keeps_the_contract_with_the_host(network: Trainer, rows: np.ndarray, tmp_path: Path) -> None:
    path = tmp_path / "network.onnx"
    assert written(network, path, rows, seed="7") <= BOUND
    session = onnxruntime.InferenceSession(path, providers=["CPUExecutionProvider"])
    (given,), (answered, derived) = session.get_inputs(), session.get_outputs()
    assert [option.name for option in session.get_overridable_initializers()] == ["with_jacobian"]
    assert (given.name, given.shape, given.type) == ("pixels", ["N", 5], "tensor(float)")
    assert (answered.name, answered.shape, answered.type) == ("gradient", ["N", 2], "tensor(float)")
    assert (derived.name, derived.shape, derived.type) == ("jacobian", ["N", 6], "tensor(float)")
    for count in (0, 1, 3000):
        assert [a.shape for a in session.run(None, {"pixels": rows[:count]})] == [(count, 2), (0, 6)]
        asked = session.run(None, {"pixels": rows[:count], "with_jacobian": np.array(True)})
        assert [a.shape for a in asked] == [(count, 2), (count, 6)]
    properties = session.get_modelmeta().custom_metadata_map
    assert properties["schema"] == "gelnet/1"
    assert properties["width"] == "16"
    assert properties["seed"] == "7"
    assert "d(depth)/dx" in properties["outputs"]


@pytest.mark.parametrize("channels", [1, 3, 12])
def test_its_jacobian_is_the_limit_of_differences_of_the_trainer(channels: int, tmp_path: Path) -> None:
    random = np.random.default_rng(0)
    rows = random.uniform([*[-60] * channels, 0, 0], [*[60] * channels, 639, 479], (500, channels + 2))
    rows = rows.astype(np.float32)
    network = make_trainer("numpy", seed=0)
    network.begin(rows, np.full((len(rows), 2), 1.5, np.float32), width=16, recipe=RECIPES["fast"])
    written(network, tmp_path / "network.onnx", rows)
    session = onnxruntime.InferenceSession(tmp_path / "network.onnx", providers=["CPUExecutionProvider"])
    found = session.run(["jacobian"], {"pixels": rows, "with_jacobian": np.array(True)})[0]
    step = np.eye(channels, channels + 2, dtype=np.float32) / 4
    differences = [2 * (network.answer(rows + s) - network.answer(rows - s)) for s in step]
    right = np.stack(differences, axis=2).reshape(len(rows), -1)
    assert np.abs(right).max() > 3e-4
    np.testing.assert_allclose(found, right, atol=3e-3 * np.abs(right).max())


def test_the_same_network_gives_the_same_bytes(network: Trainer, rows: np.ndarray, tmp_path: Path) -> None:
    for name in ("a", "b"):
        written(network, tmp_path / name, rows, z="1", a="2")
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()


def test_the_library_of_the_format_accepts_the_file(network: Trainer) -> None:
    content = to_onnx(network.parameters(), {"seed": "7"})
    model = onnx.load_from_string(content)
    onnx.checker.check_model(model, full_check=True)
    assert model.SerializeToString(deterministic=True) == content, "no field that the library does not know"


def tampered(layer: int, change: float):
    def write(network: Parameters, summary: dict[str, str]) -> bytes:
        model = onnx.load_from_string(to_onnx(network, summary))
        weight = numpy_helper.to_array(model.graph.initializer[2 * layer]).copy()
        weight.flat[0] += change
        model.graph.initializer[2 * layer].CopyFrom(numpy_helper.from_array(weight, f"weight_{layer + 1}"))
        return bytes(model.SerializeToString())

    return write


@pytest.mark.parametrize(("layer", "change"), [(0, 0.01), (2, 0.01), (4, -0.01), (4, np.nan)])
def test_a_file_that_differs_is_refused_and_removed(
    layer: int,
    change: float,
    network: Trainer,
    rows: np.ndarray,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(gelnet.export, "to_onnx", tampered(layer, change))
    with pytest.raises(ExportError, match=r"differs from the trained network by .* rad"):
        written(network, tmp_path / "network.onnx", rows)
    assert list(tmp_path.iterdir()) == []


def test_a_file_that_cannot_run_is_removed(
    network: Trainer, rows: np.ndarray, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(gelnet.export, "to_onnx", lambda network, summary: b"")
    with pytest.raises(ExportError, match="cannot be run"):
        written(network, tmp_path / "network.onnx", rows)
    assert list(tmp_path.iterdir()) == []
