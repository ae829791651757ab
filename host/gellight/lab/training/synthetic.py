"""The calibration bundle of the simulated sensor: made by `gelnet.synthetic`, measured on the simulated camera."""

import json
import tempfile
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gellight.bundle.bundle import Bundle, LedSetting, write_bundle
from gellight.frame_path.pipeline import Reconstructor
from gellight.frames.frames import CameraFrame
from gellight.lab.simulator.known_force import known_force
from gellight.lab.simulator.scene import Press, Scene
from gellight.lab.training.child import Progress, run_module, silent
from gellight.lab.training.trainer import TrainerName, checked_trainer
from gellight.photometric.light_model import LightModel
from gellight.photometric.lights_file import lights_file
from gellight.reconstruction.errors import surface_errors
from sim_reference.camera import CameraResponse, digitise, linear_grey
from sim_reference.geometry import SensorGeometry
from sim_reference.imaging import ring_irradiance
from sim_reference.surface import Surface

Array = NDArray[np.float64]
TEST_SEED = 3
NOISE_GREY = 1.0
PIXEL_SIZE_MM = SensorGeometry().pixel_size_mm
DEPTH_MM = 1.0
"""of the presses that are measured"""
MARGIN_MM = 3.0
"""of the centre of a ball from the edge of the view: its contact is then whole"""


@dataclass(frozen=True, kw_only=True)
class SimulatedError:
    """The errors on simulated presses of a ball; means over presses."""

    press_depth_mm: float
    presses: int
    whole_map_normal_mae_deg: float
    contact_normal_mae_deg: float
    contact_depth_mae_mm: float
    pixel_bound_deg: float
    """in contact: `pixel_bound_deg`, what an efficient estimator would reach that sees one pixel"""


def evaluate_simulated(bundle: Bundle, *, presses: int = 20, depth_mm: float = DEPTH_MM) -> SimulatedError:
    """Press the 4 mm ball at random places of the simulated sensor and measure the errors of the host."""
    scene = Scene(SensorGeometry(), CameraResponse(noise_grey=NOISE_GREY))
    reconstructor = Reconstructor(bundle)
    random = np.random.default_rng(TEST_SEED)
    figures = []
    for press in ball_presses(scene.geometry, presses, random, depth_mm):
        grey, surface = scene.show(press)
        frame = CameraFrame(image=digitise(grey, NOISE_GREY, random), time_s=0.0, sequence=0, source="sim://")
        error = surface_errors(reconstructor.reconstruct(frame), surface)
        bound = pixel_bound_deg(scene, surface)[surface.contact].mean()
        figures.append((error.normal_deg, error.contact_normal_deg, error.contact_depth_mm, bound))
    whole, inside, depth, bound = np.mean(figures, axis=0).tolist()
    return SimulatedError(
        press_depth_mm=depth_mm,
        presses=presses,
        whole_map_normal_mae_deg=whole,
        contact_normal_mae_deg=inside,
        contact_depth_mae_mm=depth,
        pixel_bound_deg=bound,
    )


def ball_presses(
    geometry: SensorGeometry, count: int, random: np.random.Generator, depth_mm: float = DEPTH_MM
) -> Iterator[Press]:
    """Yield presses of the ball all over the view, the contact whole."""
    height, width = geometry.image_shape
    half = np.array([width, height]) * geometry.pixel_size_mm / 2 - MARGIN_MM
    for _ in range(count):
        x, y = random.uniform(-half, half).tolist()
        yield Press("BALL", depth_mm, x, y)


def pixel_bound_deg(scene: Scene, surface: Surface) -> Array:
    """Return the (H, W) mean normal error, deg, of an efficient estimator that sees the colour of one pixel alone.

    Efficient means: unbiased, with the least covariance that any unbiased estimator can have, by Cramér and Rao. With
    the Jacobian J (3, 2) of the grey levels with respect to the slopes, and grey levels of independent Gaussian noise
    of variance s^2 = noise^2 + 1/12 (rounding), that covariance is s^2 (J^T J)^-1. The errors of the slopes are taken
    to be Gaussian. The normal turns by an angle whose square is e^T M e for a small error e of the slopes, with
    M = ((1 + g^2) I - g g^T) / (1 + g^2)^2; the mean angle follows from the two eigenvalues of the product of M and the
    covariance.

    The bound is on the covariance, not on the mean angle, and it holds for unbiased estimators of one pixel. Smoothing
    uses neighbours and has a bias, so its error may be below this figure.
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


def _mean_length(large: Array, small: Array) -> Array:
    """Return the mean length of a two-dimensional normal vector with these variances along its axes."""
    # E|v| of a normal vector = sqrt(pi / 2) x the mean over directions of the length of its ellipse.
    angles = (np.arange(64) + 0.5) * (np.pi / 64)
    lengths = sum(np.sqrt(large * np.cos(angle) ** 2 + small * np.sin(angle) ** 2) for angle in angles)
    return np.asarray(np.sqrt(np.pi / 2) * lengths / len(angles))


def _jacobian(scene: Scene, surface: Surface, step: float = 1e-4) -> Array:
    """(H, W, 3, 2) change of the grey levels with each slope, by central differences at unchanged depth."""

    def grey(change: Array) -> Array:
        tilted = Surface(surface.depth_mm, surface.gradient_map + change, surface.contact)
        return linear_grey(ring_irradiance(tilted, scene.geometry, scene.light), scene.response)

    return np.stack([(grey(change) - grey(-change)) / (2 * step) for change in step * np.eye(2)], axis=3)


def make_synthetic(
    out: Path,
    *,
    lights: LightModel,
    width: int,
    recipe: str = "fine",
    seed: int = 0,
    threads: int = 1,
    trainer: TrainerName = "numpy",
    overwrite: bool = False,
    progress: Progress = silent,
) -> Bundle:
    """Train GelNet on simulated presses in a child process, write the bundle and measure it on test presses.

    lights: of the simulated sensor. Raises TrainingError or BundleError; then `out` is as it was.
    """
    with tempfile.TemporaryDirectory(prefix="gellight-synthetic-") as folder:
        place = Path(folder)
        arguments = ["--out", folder, "--width", str(width), "--recipe", recipe, "--seed", str(seed)]
        run_module("gelnet.synthetic", arguments, progress, trainer=checked_trainer(trainer), threads=threads)
        training = json.loads((place / "training.json").read_text())
        draft = _written(place, place / "draft", lights, {"training": training})
        # Measured through the bundle as it will be loaded, then written once with what was measured.
        measured = {"training": training, "test": asdict(evaluate_simulated(draft))}
        return _written(place, out, lights, measured, overwrite)


def _written(place: Path, out: Path, lights: LightModel, metrics: dict[str, object], overwrite: bool = False) -> Bundle:
    """Write the files of the child as a bundle."""
    provenance = json.loads((place / "provenance.json").read_text())
    return write_bundle(
        out,
        sensor="simulated",
        reference=np.load(place / "reference.npy"),
        reference_frames=provenance["reference_frames"],
        noise_grey=provenance["camera"]["noise_grey"],
        pixel_size_mm=(provenance["geometry"]["pixel_size_mm"],) * 2,
        gel_thickness_mm=provenance["geometry"]["gel_thickness_mm"],
        light_by_depth=True,
        network=(place / "network.onnx").read_bytes(),
        network_name="synthetic.onnx",
        led=_leds(provenance["geometry"]["led_colours"], provenance["light"]),
        extra_files={
            "provenance.json": (place / "provenance.json").read_bytes(),
            **lights_file(lights),
            **known_force(SensorGeometry()),
        },
        metrics=metrics,
        overwrite=overwrite,
    )


def _leds(colours: str, light: list[list[float]]) -> tuple[LedSetting, ...]:
    return tuple(
        LedSetting.model_validate({"colour": colour, "rgb": [round(255 * share) for share in shares]})
        for colour, shares in zip(colours, light, strict=True)
    )
