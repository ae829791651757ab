"""The calibration bundle of the simulated sensor: made by `gelnet.synthetic`, measured on the simulated camera."""

import json
import tempfile
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gellight.bundle.bundle import Bundle, LedSetting, write_bundle
from gellight.frames.frames import CameraFrame
from gellight.reconstruction.integration import angle_deg, normals
from gellight.reconstruction.pipeline import Reconstructor
from gellight.simulator.scene import Press, Scene
from gellight.training.child import Progress, run_module, silent
from sim_reference.camera import CameraResponse, digitise, linear_grey
from sim_reference.geometry import SensorGeometry
from sim_reference.imaging import ring_irradiance
from sim_reference.surface import Surface

TEST_SEED = 3
VALIDATION_SEED = 4


@dataclass(frozen=True, kw_only=True)
class SimulatedError:
    """What was felt of simulated presses, against the truth; means over presses."""

    presses: int
    whole_map_normal_mae_deg: float
    contact_normal_mae_deg: float
    contact_depth_mae_mm: float
    pixel_floor_deg: float
    """least error in contact of any unbiased estimator that sees one pixel (Cramér and Rao)"""


def evaluate_simulated(
    bundle: Bundle,
    *,
    presses: int = 20,
    depth_mm: float = 1.0,
    object_name: str = "BALL",
    noise_grey: float = 1.0,
    seed: int = TEST_SEED,
    reconstructor: Reconstructor | None = None,
) -> SimulatedError:
    """Press an object at random places of the simulated sensor and measure what the host feels."""
    geometry = SensorGeometry()
    scene = Scene(geometry, CameraResponse(noise_grey=noise_grey))
    reconstructor = reconstructor or Reconstructor(bundle)
    random = np.random.default_rng(seed)
    figures = []
    for place in _places(geometry, presses, random):
        grey, surface = scene.show(Press(object_name, depth_mm, *place))
        image = digitise(grey, noise_grey, random)
        frame = CameraFrame(image=image, time_s=0.0, sequence=0, source="sim://")
        felt = reconstructor.reconstruct(frame)
        angle = angle_deg(felt.normal_map, normals(surface.gradient_map))
        contact = surface.contact
        floor = pixel_floor_deg(scene, surface)[contact].mean()
        depth = np.abs(felt.depth_mm - surface.depth_mm)[contact].mean()
        figures.append((angle.mean(), angle[contact].mean(), depth, floor))
    whole, inside, depth_mae, floor = np.mean(figures, axis=0).tolist()
    return SimulatedError(
        presses=presses,
        whole_map_normal_mae_deg=whole,
        contact_normal_mae_deg=inside,
        contact_depth_mae_mm=depth_mae,
        pixel_floor_deg=floor,
    )


def _places(geometry: SensorGeometry, count: int, random: np.random.Generator) -> Iterator[tuple[float, float]]:
    """Places all over the view, so far from its edge that a contact of 3 mm is whole."""
    height, width = geometry.image_shape
    half = np.array([width, height]) * geometry.pixel_size_mm / 2 - 3.0
    for _ in range(count):
        x, y = random.uniform(-half, half)
        yield float(x), float(y)


def pixel_floor_deg(scene: Scene, surface: Surface) -> NDArray[np.float64]:
    """Return the (H, W) least mean normal error of an unbiased estimator that sees one pixel's colour, deg.

    The Cramér-Rao bound: with the Jacobian J (3, 2) of the grey levels with respect to the slopes, and grey levels of
    independent normal noise of variance s^2 = noise^2 + 1/12 (rounding), the covariance of the slopes is at least
    s^2 (J^T J)^-1. The normal turns by an angle whose square is e^T M e for an error e of the slopes, with
    M = ((1 + g^2) I - g g^T) / (1 + g^2)^2; the mean of that angle over normal errors of this covariance is computed
    from the two eigenvalues of their product.
    """
    jacobian = _jacobian(scene, surface)
    variance = scene.response.noise_grey**2 + 1 / 12
    information = np.einsum("hwci,hwcj->hwij", jacobian, jacobian) / variance
    information += 1e-12 * np.eye(2)
    g = surface.gradient_map
    squared = 1 + (g**2).sum(axis=2)[..., None, None]
    metric = (squared * np.eye(2) - g[..., :, None] * g[..., None, :]) / squared**2
    product = metric @ np.linalg.inv(information)
    half_trace = np.trace(product, axis1=2, axis2=3) / 2
    root = np.sqrt(np.maximum(half_trace**2 - np.linalg.det(product), 0))
    return np.degrees(_mean_length(half_trace + root, np.maximum(half_trace - root, 0)))


def _mean_length(large: NDArray[np.float64], small: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the mean length of a two-dimensional normal vector with these variances along its axes."""
    angle = (np.arange(64) + 0.5) * (np.pi / 64)
    # E|v| of a normal vector = sqrt(pi / 2) x the mean over directions of the length of its ellipse.
    lengths = np.zeros_like(large)
    for a in angle:
        lengths += np.sqrt(large * np.cos(a) ** 2 + small * np.sin(a) ** 2)
    mean: NDArray[np.float64] = np.sqrt(np.pi / 2) * lengths / len(angle)
    return mean


def _jacobian(scene: Scene, surface: Surface, step: float = 1e-4) -> NDArray[np.float64]:
    """(H, W, 3, 2) change of the grey levels with each slope, by central differences at unchanged depth."""
    columns = []
    for axis in range(2):
        greys = []
        for sign in (step, -step):
            slopes = surface.gradient_map.copy()
            slopes[..., axis] += sign
            tilted = Surface(surface.depth_mm, slopes, surface.contact)
            irradiance = ring_irradiance(tilted, scene.geometry, scene.light)
            greys.append(linear_grey(irradiance, scene.response))
        columns.append((greys[0] - greys[1]) / (2 * step))
    return np.stack(columns, axis=3)


def make_synthetic(
    out: Path, *, width: int, seed: int = 0, threads: int = 1, overwrite: bool = False, progress: Progress = silent
) -> Bundle:
    """Train GelNet on simulated presses in a child process, write the bundle and measure it on test presses.

    Raises TrainingError or BundleError; then `out` is as it was.
    """
    with tempfile.TemporaryDirectory(prefix="gellight-synthetic-") as folder:
        place = Path(folder)
        arguments = ["--out", folder, "--width", str(width), "--seed", str(seed), "--threads", str(threads)]
        run_module("gelnet.synthetic", arguments, progress)
        provenance = json.loads((place / "provenance.json").read_text())
        parts: dict[str, Any] = {
            "sensor": "simulated",
            "reference": np.load(place / "reference.npy"),
            "reference_frames": provenance["reference_frames"],
            "noise_grey": provenance["camera"]["noise_grey"],
            "pixel_size_mm": (provenance["geometry"]["pixel_size_mm"],) * 2,
            "network": (place / "network.onnx").read_bytes(),
            "network_name": "synthetic.onnx",
            "led": _leds(provenance["geometry"]["led_colours"], provenance["light"]),
            "extra_files": {"provenance.json": (place / "provenance.json").read_bytes()},
        }
        training = json.loads((place / "training.json").read_text())
        # Measured through the bundle as it will be loaded, then written once with what was measured.
        draft = write_bundle(place / "draft", metrics={}, **parts)
        metrics = {"training": training, "test": asdict(evaluate_simulated(draft))}
        return write_bundle(out, metrics=metrics, overwrite=overwrite, **parts)


def _leds(colours: str, light: list[list[float]]) -> tuple[LedSetting, ...]:
    return tuple(
        LedSetting.model_validate({"colour": colour, "rgb": [round(255 * share) for share in shares]})
        for colour, shares in zip(colours, light, strict=True)
    )
