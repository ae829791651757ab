"""A sensor with a known answer: its colours are linear in the slope, so a network of one Gemm inverts it exactly."""

import itertools
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

from gellight.bundle.bundle import Bundle, LedSetting, write_bundle
from gellight.frames.frames import CameraFrame
from gellight.photometric.directions import LightDirections

GREY_PER_SLOPE = np.array([[90.0, 0.0], [-45.0, 78.0], [-45.0, -78.0]])
"""(3, 2) three lights 120 degrees apart"""
BUNDLE_SHAPE = (24, 32)
VERIFIED = {"depth_mm": 0.02, "normal_deg": 2.0}


def gemm_network(
    weights: np.ndarray,
    bias: np.ndarray,
    *,
    input_name: str = "pixels",
    output_name: str = "gradient",
    rows: int | str = "N",
) -> bytes:
    """ONNX bytes of rows @ weights + bias."""
    graph = helper.make_graph(
        [helper.make_node("Gemm", [input_name, "weights", "bias"], [output_name])],
        "linear",
        [helper.make_tensor_value_info(input_name, TensorProto.FLOAT, [rows, weights.shape[0]])],
        [helper.make_tensor_value_info(output_name, TensorProto.FLOAT, [rows, weights.shape[1]])],
        [
            numpy_helper.from_array(weights.astype(np.float32), "weights"),
            numpy_helper.from_array(bias.astype(np.float32), "bias"),
        ],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)
    onnx.checker.check_model(model)
    return bytes(model.SerializeToString())


def linear_network() -> bytes:
    """The inverse of the sensor, plus an answer to no difference that depends on the position."""
    weights = np.zeros((5, 2))
    weights[:3] = np.linalg.pinv(GREY_PER_SLOPE).T
    weights[3:] = [[1e-4, -2e-4], [3e-4, 1e-4]]
    return gemm_network(weights, np.array([0.02, -0.03]))


def tanh_network(width: int = 64) -> bytes:
    """Random weights in the shape of GelNet: what it costs is real, what it answers means nothing."""
    rng = np.random.default_rng(0)
    sizes = [5, width, width, width, width, 2]
    nodes, tensors, name = [], [], "pixels"
    for i, (fan_in, fan_out) in enumerate(itertools.pairwise(sizes)):
        tensors.append(numpy_helper.from_array(rng.normal(0, 0.2, (fan_in, fan_out)).astype(np.float32), f"w{i}"))
        tensors.append(numpy_helper.from_array(np.zeros(fan_out, np.float32), f"b{i}"))
        last = i == len(sizes) - 2
        nodes.append(helper.make_node("Gemm", [name, f"w{i}", f"b{i}"], ["gradient" if last else f"g{i}"]))
        if not last:
            nodes.append(helper.make_node("Tanh", [f"g{i}"], [f"t{i}"]))
        name = f"t{i}"
    graph = helper.make_graph(
        nodes,
        "tanh",
        [helper.make_tensor_value_info("pixels", TensorProto.FLOAT, ["N", 5])],
        [helper.make_tensor_value_info("gradient", TensorProto.FLOAT, ["N", 2])],
        tensors,
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)
    return bytes(model.SerializeToString())


def reference_image(shape: tuple[int, int]) -> np.ndarray:
    """(H, W, 3) brighter in the middle, with fractions of a grey level."""
    y, x = np.indices(shape) / np.array(shape)[:, None, None]
    glow = 130 - 60 * ((x - 0.5) ** 2 + (y - 0.5) ** 2)
    return np.stack([glow, glow + 5.3, glow - 4.7], axis=2).astype(np.float32)


def photograph(
    gradient_map: np.ndarray, *, noise_grey: float = 0.0, rng: np.random.Generator | None = None
) -> CameraFrame:
    """A camera frame of the gel with these slopes."""
    image = reference_image(gradient_map.shape[:2]) + gradient_map @ GREY_PER_SLOPE.T
    if noise_grey:
        image = image + noise_grey * (rng or np.random.default_rng(0)).normal(size=image.shape)
    return CameraFrame(image=np.clip(np.round(image), 0, 255).astype(np.uint8), time_s=0.0, sequence=0, source="")


def bundle_of(folder: Path, reference: np.ndarray, **more: Any) -> Bundle:
    """Write and load a bundle with this reference image; what `more` leaves out of `write_bundle` is plain."""
    plain = {"sensor": "linear", "reference_frames": 1, "noise_grey": 1.0, "pixel_size_mm": (0.05, 0.05),
             "network": linear_network(), "metrics": {}}  # fmt: skip
    return write_bundle(folder, reference=reference, **{**plain, **more})


def linear_bundle(
    folder: Path,
    shape: tuple[int, int] = (240, 320),
    *,
    pixel_size_mm: tuple[float, float] = (0.05, 0.05),
    network: bytes | None = None,
    overwrite: bool = False,
) -> Bundle:
    """Write and load the bundle of the linear sensor."""
    return bundle_of(
        folder, reference_image(shape), reference_frames=64, pixel_size_mm=pixel_size_mm,
        network=network if network is not None else linear_network(), metrics={"angular_error_deg": {"mean": 0.5}},
        overwrite=overwrite,
    )  # fmt: skip


def verified_bundle(
    folder: Path,
    *,
    sensor: str = "GL-7",
    shape: tuple[int, int] = BUNDLE_SHAPE,
    metrics: dict[str, object] | None = None,
    rgb: tuple[int, int, int] | None = None,
    **controls: float,
) -> Bundle:
    """Write the bundle of a linear sensor that passed its verification, unless `metrics` say otherwise.

    rgb: brightness of its red, green and blue LEDs, four each.
    """
    return bundle_of(
        folder, reference_image(shape), sensor=sensor, reference_frames=8, camera=controls,
        metrics={"verification": VERIFIED} if metrics is None else metrics,
        extra_files={"mark": folder.name.encode()}, led=_leds(rgb) if rgb else (),
    )  # fmt: skip


def _leds(rgb: tuple[int, int, int]) -> tuple[LedSetting, ...]:
    ring = [("R", (rgb[0], 0, 0)), ("G", (0, rgb[1], 0)), ("B", (0, 0, rgb[2]))]
    return tuple(LedSetting.model_validate({"colour": name, "rgb": light}) for name, light in ring for _ in range(4))


def with_lights_of_its_own(bundle: Bundle) -> Bundle:
    """The bundle as one of four single lights, in memory."""
    angles = np.arange(4) * np.pi / 2
    vectors, groups = np.zeros((4, 3, 3)), np.zeros((4, 12, 3), np.uint8)
    groups[np.arange(4), 3 * np.arange(4), 0] = 255
    vectors[:, :, 0] = np.stack([0.7 * np.cos(angles), 0.7 * np.sin(angles), np.full(4, 0.7)], axis=1)
    lights = LightDirections(
        vectors=vectors, untouched=np.full((4, *bundle.image_shape), 100, np.float32), groups=groups,
        noise_grey=1.0, pixel_size_mm=bundle.pixel_size_mm[0],
    )  # fmt: skip
    network = gemm_network(np.zeros((6, 2)), np.zeros(2))
    files = {**bundle.files, "directions.npz": lights.content(), bundle.manifest.network: network}
    return replace(bundle, files=files, source="single lights")
