"""To ONNX: a small file that is the same every time, and proven equal to what was trained."""

from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import onnxruntime
from numpy.typing import NDArray

from gelnet.jacobian import add_jacobian
from gelnet.onnx_file import Graph, model, value
from gelnet.parameters import PLACE, Floats, Parameters, channel_names

Answer = Callable[[Floats], Floats]
"""(N, 2) gradients of (N, C + 2) pixels, as the trainer computes them"""
SCHEMA = "gelnet/1"
BOUND = 2e-4
"""Largest difference of the slope angle between ONNX Runtime and the trainer, rad (0.011 degrees)."""
_OPSET, _IR_VERSION = 17, 8
_ROWS_PER_RUN = 65536


class ExportError(RuntimeError):
    """The exported network does not answer what was trained; nothing is left of the file."""


def export(
    network: Parameters,
    path: Path,
    *,
    rows: Floats,
    answer: Answer,
    summary: Mapping[str, str] | None = None,
) -> float:
    """Write the network to an ONNX file and return its largest difference from what was trained, rad.

    rows: (N, C + 2) pixels as the network will see them, compared together with random ones. answer: what the trainer
    answers to them. summary: text for the metadata of the file. Raises ExportError, and removes the file, when the
    angles differ by more than `BOUND`.
    """
    path.write_bytes(to_onnx(network, summary or {}))
    try:
        difference = largest_difference(answer, path, rows)
    except Exception as error:
        path.unlink(missing_ok=True)
        raise ExportError(f"{path.name} cannot be run by ONNX Runtime ({error})") from error
    if not difference <= BOUND:
        path.unlink(missing_ok=True)
        raise ExportError(
            f"{path.name} differs from the trained network by {difference:.3g} rad, allowed are {BOUND:g}: train again"
        )
    return difference


def to_onnx(network: Parameters, summary: Mapping[str, str]) -> bytes:
    """Write down the trained network, with the normalisation folded into the first layer.

    W (p - c) / s + b = (W / s) p + (b - W c / s): five numbers a pixel fewer to move, the same answer. The file also
    answers how the slopes change with the channels, see `jacobian.add_jacobian`.
    """
    graph = Graph(
        name="GelNet",
        inputs=[value("pixels", np.float32, ["N", len(network.centre)])],
        outputs=[value("gradient", np.float32, ["N", 2])],
    )
    last = "pixels"
    for i, (weight, bias) in enumerate(_folded(network), start=1):
        graph.constants |= {f"weight_{i}": np.asarray(weight, np.float32), f"bias_{i}": np.asarray(bias, np.float32)}
        graph.add("Gemm", [last, f"weight_{i}", f"bias_{i}"], f"layer_{i}", transB=1)
        last = graph.add("Tanh", [f"layer_{i}"], f"tanh_{i}")
    graph.constants["steepest_rad"] = np.array([network.steepest_rad], np.float32)
    graph.add("Tan", [graph.add("Mul", [last, "steepest_rad"], "angle")], "gradient")
    add_jacobian(graph, len(network.centre) - len(PLACE))
    return model(graph, operator_set=_OPSET, ir_version=_IR_VERSION, properties=_properties(network) | dict(summary))


def _properties(network: Parameters) -> dict[str, str]:
    channels = len(network.centre) - len(PLACE)
    return {
        "schema": SCHEMA,
        "inputs": f"{' '.join(channel_names(channels))} (image minus reference, grey levels), x y (px: column, row)",
        "outputs": "d(depth)/dx d(depth)/dy (dimensionless; depth positive into the sensor); where the input "
        "with_jacobian is true, their derivatives by the channels, of d(depth)/dx first",
        "width": str(network.width),
    }


def _folded(network: Parameters) -> list[tuple[NDArray[np.float64], NDArray[np.float64]]]:
    """Return weight and bias of each layer, the normalisation inside the first."""
    layers = [(layer.weight.astype(np.float64), layer.bias.astype(np.float64)) for layer in network.layers]
    weight, bias = layers[0]
    weight = weight / network.scale.astype(np.float64)
    return [(weight, bias - weight @ network.centre.astype(np.float64)), *layers[1:]]


def largest_difference(answer: Answer, path: Path, rows: Floats) -> float:
    """Return the largest difference of slope angles between the file and the trainer, rad, on rows and random pixels.

    Angles, because a slope near the vertical is a large number of which the last digits mean nothing.
    """
    options = onnxruntime.SessionOptions()
    options.log_severity_level = 3  # else it warns of every optional input
    session = onnxruntime.InferenceSession(path.read_bytes(), options, providers=["CPUExecutionProvider"])
    worst = 0.0
    everything = np.concatenate([rows, _random_pixels(rows)])
    for start in range(0, len(everything), _ROWS_PER_RUN):
        block = everything[start : start + _ROWS_PER_RUN]
        trained = answer(block)
        exported = session.run(["gradient"], {"pixels": block})[0]
        if not np.isfinite(exported).all():
            return float("inf")
        worst = max(worst, float(np.abs(np.arctan(exported) - np.arctan(trained)).max()))
    return worst


def _random_pixels(rows: Floats, count: int = 4096) -> Floats:
    """Pixels all over the image with any change a camera can show."""
    random = np.random.default_rng(0)
    change = random.uniform(-255, 255, (count, rows.shape[1] - len(PLACE)))
    place = random.uniform(0, rows[:, -len(PLACE) :].max(axis=0), (count, len(PLACE)))
    return np.concatenate([change, place], axis=1).astype(np.float32)
