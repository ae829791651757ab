"""The calibration bundle of the simulated sensor: `python -m tests.helpers.simulated_bundle --out DIR` makes it anew.

Its network is that of `gelnet.synthetic`, which takes minutes; it is measured on the simulated camera.
"""

import argparse
import json
import tempfile
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from gellight.bundle.bundle import Bundle, LedSetting, write_bundle
from gellight.frame_path.pipeline import Reconstructor
from gellight.frames.frames import CameraFrame
from gellight.lab.optics.lights.adding import take_lights
from gellight.lab.simulator.printed_dots import known_force
from gellight.lab.simulator.scene import Press, Scene
from gellight.lab.training.child import Progress, run_module, silent
from gellight.opening import open_camera
from gellight.photometric.light_model import LightModel
from gellight.photometric.lights_file import lights_file
from gellight.photometric.ring_geometry import RingGeometry
from gellight.reconstruction.errors import surface_errors
from sim_reference.camera import CameraResponse, digitise
from sim_reference.geometry import AS_BUILT, SensorGeometry
from sim_reference.view import seen_height_mm

TEST_SEED = 3
NOISE_GREY = 1.0
PIXEL_SIZE_MM = AS_BUILT.pixel_size_mm
DEPTH_MM = 1.0
"""of the presses that are measured"""
LIGHT_FRAMES = 64
"""averaged under each LED"""
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


def evaluate_simulated(bundle: Bundle, *, presses: int = 20, depth_mm: float = DEPTH_MM) -> SimulatedError:
    """Press the 4 mm ball at random places of the simulated sensor and measure the errors of the host."""
    scene = Scene(AS_BUILT, CameraResponse(noise_grey=NOISE_GREY))
    reconstructor = Reconstructor(bundle)
    random = np.random.default_rng(TEST_SEED)
    figures = []
    for press in ball_presses(scene.geometry, presses, random, depth_mm):
        grey, surface = scene.show(press)
        frame = CameraFrame(image=digitise(grey, NOISE_GREY, random), time_s=0.0, sequence=0, source="sim://")
        error = surface_errors(reconstructor.reconstruct(frame), surface)
        figures.append((error.normal_deg, error.contact_normal_deg, error.contact_depth_mm))
    whole, inside, depth = np.mean(figures, axis=0).tolist()
    return SimulatedError(
        press_depth_mm=depth_mm,
        presses=presses,
        whole_map_normal_mae_deg=whole,
        contact_normal_mae_deg=inside,
        contact_depth_mae_mm=depth,
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


def make_synthetic(
    out: Path,
    *,
    lights: LightModel,
    width: int,
    recipe: str = "fine",
    seed: int = 0,
    trainer: str = "numpy",
    overwrite: bool = False,
    progress: Progress = silent,
) -> Bundle:
    """Train GelNet on simulated presses in a child process, write the bundle and measure it on test presses.

    lights: of the simulated sensor. Raises TrainingError or BundleError; then `out` is as it was.
    """
    with tempfile.TemporaryDirectory(prefix="gellight-synthetic-") as folder:
        place = Path(folder)
        arguments = ["--out", folder, "--width", str(width), "--recipe", recipe, "--seed", str(seed)]
        run_module("gelnet.synthetic", [*arguments, "--trainer", trainer], progress)
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
        camera_height_mm=seen_height_mm(AS_BUILT),
        light_by_depth=True,
        network=(place / "network.onnx").read_bytes(),
        network_name="synthetic.onnx",
        led=_leds(provenance["geometry"]["led_colours"], provenance["light"]),
        extra_files={
            "provenance.json": (place / "provenance.json").read_bytes(),
            **lights_file(lights),
            **known_force(AS_BUILT),
        },
        metrics=metrics,
        overwrite=overwrite,
    )


def _leds(colours: str, light: list[list[float]]) -> tuple[LedSetting, ...]:
    return tuple(
        LedSetting.model_validate({"colour": colour, "rgb": [round(255 * share) for share in shares]})
        for colour, shares in zip(colours, light, strict=True)
    )


def lights_of_simulated_sensor() -> LightModel:
    """Return the light of each LED of the simulated sensor as designed."""
    ring = RingGeometry()
    with open_camera("sim://?programme=0") as camera:
        return take_lights(camera, ring, ring.colours, (PIXEL_SIZE_MM, PIXEL_SIZE_MM), LIGHT_FRAMES)


def main() -> None:
    """Make the bundle, and print what was measured on presses that it was not trained on."""
    parser = argparse.ArgumentParser("python -m tests.helpers.simulated_bundle")
    parser.add_argument("--out", type=Path, required=True, help="folder or .gelcal file that is written")
    parser.add_argument("--width", type=int, default=32, help="units in each hidden layer")
    parser.add_argument("--recipe", default="fine", help="fine: as of the shipped bundle; fast; thorough; paper")
    parser.add_argument("--seed", type=int, default=0, help="the same seed gives the same network")
    parser.add_argument("--trainer", choices=("numpy", "torch"), default="numpy")
    parser.add_argument("--overwrite", action="store_true", help="replace what is there")
    written = make_synthetic(**vars(parser.parse_args()), lights=lights_of_simulated_sensor())
    print(json.dumps(written.metrics["test"], indent=2))


if __name__ == "__main__":
    main()
