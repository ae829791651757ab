"""Parts of the C library: the network against ONNX Runtime, memory that is used again."""

from pathlib import Path

import numpy as np
import pytest

from gellight.bundle.bundle import load_bundle
from gellight.reconstruction.native import network
from gellight.reconstruction.native.library import Library, fitting, library_file
from gellight.reconstruction.native.work import ArrayPool
from gellight.reconstruction.network_session import NetworkSession
from tests.helpers.linear_sensor import linear_bundle


def test_memory_is_used_again_only_when_nobody_has_it() -> None:
    arrays = ArrayPool((5, 7))
    first = arrays.take()
    first[:] = 1
    part = first[2:, ::2].T
    del first
    second = arrays.take()
    second[:] = 2
    assert (part == 1).all()
    address = second.ctypes.data
    del second
    assert arrays.take().ctypes.data == address


def test_few_are_kept() -> None:
    arrays = ArrayPool((3,), np.bool_)
    held = [arrays.take() for _ in range(10)]
    assert len({array.ctypes.data for array in held}) == 10
    del held
    assert len(arrays._free) == 3


SYNTHETIC = load_bundle("synthetic")
SHAPE = SYNTHETIC.image_shape


def session(content: bytes) -> NetworkSession:
    return NetworkSession(content, source="test")


@pytest.mark.parametrize("name", fitting())
@pytest.mark.parametrize("count", [1, 31, 1000])
def test_it_answers_as_onnx_runtime_does(name: str, count: int) -> None:
    judge = session(SYNTHETIC.network)
    found = network.fastest(Library(library_file(name)), SYNTHETIC.network, judge, SHAPE)
    assert isinstance(found, network.NativeNetwork)
    rows = np.random.default_rng(3).normal([0, 0, 0, 320, 240], [30, 30, 30, 100, 90], (count, 5)).astype(np.float32)
    (slopes, jacobian), (right, true) = found.slopes_and_jacobian(rows), judge.slopes_and_jacobian(rows)
    np.testing.assert_allclose(found.slopes(rows), right, atol=1e-5)
    np.testing.assert_allclose(slopes, right, atol=1e-5)
    np.testing.assert_allclose(jacobian, true, atol=1e-6)


def test_another_network_and_other_answers_are_left_to_onnx_runtime(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    if not fitting():
        pytest.skip("no library runs on this machine")
    library = Library(library_file(fitting()[0]))
    other = session(linear_bundle(tmp_path / "b", (32, 32)).network)
    assert network.fastest(library, linear_bundle(tmp_path / "c", (32, 32)).network, other, (32, 32)) is other
    judge, pack = session(SYNTHETIC.network), network.pack
    monkeypatch.setattr(network, "pack", lambda weights: pack({**weights, "bias_1": weights["bias_1"] + 0.1}))
    assert network.fastest(library, SYNTHETIC.network, judge, SHAPE) is judge
    assert "its answers differ" in caplog.text
