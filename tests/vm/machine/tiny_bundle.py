"""A bundle for the simulated sensor seen with few pixels: the shipped network, told where the pixels lie now."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import onnx
from onnx import numpy_helper

from gellight.bundle.bundle import Bundle, load_bundle, write_bundle
from gellight.lab.simulator.shutter import Shutter
from gellight.lab.simulator.simulated_camera import open_simulated

TIMING = {"readout_us": Shutter().readout_us, "delay_us": Shutter().readout_us + Shutter().transfer_us}
"""the virtual camera sends a picture when all of it was read and transferred, not while its first rows are read"""


def tiny_bundle(folder: Path, geometry: Mapping[str, float | int | str]) -> Bundle:
    """Write the bundle of a sensor with `geometry`, whose pixels each cover several of the shipped bundle's."""
    shipped = load_bundle("synthetic")
    with open_simulated("sim://?board=0&programme=0&noise=0", geometry) as camera:
        reference = camera.read().image.astype(np.float32)
    return write_bundle(
        folder,
        sensor="virtual",
        reference=reference,
        reference_frames=1,
        noise_grey=1.0,
        pixel_size_mm=(float(geometry["pixel_size_mm"]),) * 2,
        network=rescaled(shipped.network, shipped.image_shape[1] / reference.shape[1]),
        metrics={},
        led=shipped.manifest.led,
        camera={"exposure_us": 8000.0, "gain": 0.0, "white_balance_k": 4600.0, **TIMING},
    )


def rescaled(network: bytes | Path, factor: float) -> bytes:
    """Return a network that takes positions in pixels `factor` times as large."""
    model = onnx.load_model_from_string(network if isinstance(network, bytes) else network.read_bytes())
    tensors = {tensor.name: tensor for tensor in model.graph.initializer}
    weight, bias = (numpy_helper.to_array(tensors[name]).astype(float) for name in ("weight_1", "bias_1"))
    bias = bias + (factor - 1) / 2 * weight[:, 3:].sum(axis=1)  # from centre to centre of the pixels
    weight[:, 3:] *= factor
    for name, values in (("weight_1", weight), ("bias_1", bias)):
        tensors[name].CopyFrom(numpy_helper.from_array(values.astype(np.float32), name))
    return model.SerializeToString()
