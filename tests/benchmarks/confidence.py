"""Are errors where `frame.confidence` doubts, and do its weights help: `python -m tests.benchmarks.confidence`.

A network learns from presses of a 4 mm ball alone, as that of a real sensor does. Then steeper objects are pressed:
those of the finite-element gel, and TSTEP and PINS into the layer. docs/calibration-data.md has the figures.
"""

import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from scipy import fft

from gellight.bundle.bundle import Bundle, write_bundle
from gellight.frames.frames import CameraFrame, TactileFrame
from gellight.frames.measures import CLIPPED, DARK, STEEP
from gellight.lab.simulator.scene import Press, Scene
from gellight.lab.training.table import PressTable
from gellight.lab.training.training import TrainingOptions, train
from gellight.reconstruction.integration import angle_deg, normals
from gellight.reconstruction.measures import BundleMeasures
from gellight.reconstruction.pipeline import Reconstructor
from sim_reference.camera import CameraResponse, digitise
from sim_reference.deformation import Deformation
from sim_reference.geometry import SensorGeometry
from sim_reference.surface import Surface
from tests.helpers.fem_presses import SPACING_MM, depth_mm

NOISE_GREY = 1.0
RANDOM = np.random.default_rng(0)
GEOMETRY = SensorGeometry()
PIXELS = (GEOMETRY.pixel_size_mm, GEOMETRY.pixel_size_mm)
FEM = ("prism_0.5", "prism_0.9", "pins_0.4", "pins_0.7", "tstep_0.5", "punch_0.8")
LAYER = (Press("TSTEP", 0.6), Press("PINS", 0.6), Press("PINS", 0.75))


def taught_by_balls(folder: Path) -> Bundle:
    """The bundle of a network that has seen nothing but a ball."""
    scene = Scene(GEOMETRY, CameraResponse(noise_grey=NOISE_GREY))
    reference = np.mean([digitise(scene.show(None)[0], NOISE_GREY, RANDOM) for _ in range(30)], axis=0)
    rows, numbers = [], []
    for number, depth in enumerate(np.linspace(0.2, 1.4, 16).round(2).tolist()):
        x, y = RANDOM.uniform(-10, 10), RANDOM.uniform(-7, 7)
        grey, surface = scene.show(Press("BALL", depth, x, y))
        difference = digitise(grey, NOISE_GREY, RANDOM) - reference
        flat = np.abs(surface.gradient_map).max(axis=2) < 1e-3
        for places, count in ((np.argwhere(surface.contact), 4000), (np.argwhere(flat), 3000)):
            row, column = places[RANDOM.choice(len(places), min(count, len(places)), replace=False)].T
            position = np.stack([column, row], axis=1)
            rows.append(np.hstack([difference[row, column], position, surface.gradient_map[row, column]]))
            numbers.append(np.full(len(row), number, np.int32))
    size = (GEOMETRY.image_width_px, GEOMETRY.image_height_px)
    table = PressTable(rows=np.vstack(rows).astype(np.float32), image=np.concatenate(numbers), image_size=size)
    network, _ = train(table, TrainingOptions())
    return write_bundle(
        folder, sensor="balls", reference=reference, reference_frames=30, noise_grey=NOISE_GREY, pixel_size_mm=PIXELS,
        network=network, metrics={}, presses=table.arrays(),
    )  # fmt: skip


def pressed() -> Iterator[tuple[str, CameraFrame, Surface]]:
    """Yield pictures of presses, and the surface under them."""
    layer = Scene(GEOMETRY, CameraResponse(noise_grey=NOISE_GREY))
    for name in FEM:
        kept = Deformation(depth_mm(name).astype(float), np.maximum(depth_mm(name), 0), SPACING_MM)
        scene = Scene(GEOMETRY, CameraResponse(noise_grey=NOISE_GREY), model=lambda *_, kept=kept: kept)
        yield f"{name}, fem", *_taken(scene, Press("BALL", 0.5))
    for press in LAYER:
        yield f"{press.object_name} {press.depth_mm}, layer", *_taken(layer, press)


def _taken(scene: Scene, press: Press) -> tuple[CameraFrame, Surface]:
    grey, surface = scene.show(press)
    return CameraFrame(image=digitise(grey, NOISE_GREY, RANDOM), time_s=0.0, sequence=0), surface


def weighted(gradient_map: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """(H, W) depth of (H, W, 2) slopes by weighted least squares: conjugate gradients, preconditioned by cosines."""
    height, width = weights.shape
    across, down = np.sqrt(weights[:, 1:] * weights[:, :-1]), np.sqrt(weights[1:] * weights[:-1])
    step_x = (gradient_map[:, 1:, 0] + gradient_map[:, :-1, 0]) / 2 * PIXELS[0]
    step_y = (gradient_map[1:, :, 1] + gradient_map[:-1, :, 1]) / 2 * PIXELS[1]

    def gathered(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        total = np.zeros((height, width))
        total[:, 1:] += x
        total[:, :-1] -= x
        total[1:] += y
        total[:-1] -= y
        return total

    angles = [np.pi * np.arange(size) / size for size in (height, width)]
    values = 4 - 2 * np.cos(angles[0])[:, None] - 2 * np.cos(angles[1])[None, :]
    values[0, 0] = np.inf
    depth, left = np.zeros((height, width)), gathered(across * step_x, down * step_y)
    first = np.linalg.norm(left)
    nearer = fft.idctn(fft.dctn(left, norm="ortho") / values, norm="ortho")
    along, product = nearer, float((left * nearer).sum())
    while np.linalg.norm(left) > 1e-4 * first:
        turned = gathered(across * np.diff(along, axis=1), down * np.diff(along, axis=0))
        step = product / float((along * turned).sum())
        depth, left = depth + step * along, left - step * turned
        nearer = fft.idctn(fft.dctn(left, norm="ortho") / values, norm="ortho")
        before, product = product, float((left * nearer).sum())
        along = nearer + product / before * along
    return depth


def depth_error_um(depth: np.ndarray, surface: Surface) -> float:
    """Mean absolute error in contact, the median of what is not pressed taken off."""
    rest = np.hypot(*np.moveaxis(surface.gradient_map, 2, 0)) < 0.02
    off = depth - surface.depth_mm
    return float(np.abs(off - np.median(off[rest]))[surface.contact].mean()) * 1e3


def main() -> None:
    """Print the errors of the normals by doubt, and of the depth with and without weights."""
    with tempfile.TemporaryDirectory() as folder:
        bundle = taught_by_balls(Path(folder) / "bundle")
        print(f"steepest slope learnt: {BundleMeasures(bundle)._steepest:.2f}")
        reconstructor = Reconstructor(bundle)
        seen = [(name, reconstructor.reconstruct(frame), surface) for name, frame, surface in pressed()]
        by_doubt(seen)
        for name, frame, surface in seen:
            gradient, confidence = frame.gradient_map.astype(float), frame.confidence
            assert confidence is not None
            even, by_weight = (weighted(gradient, w) for w in (np.ones_like(frame.depth_mm), confidence.value**2))
            depths = (even, by_weight, weighted(surface.gradient_map.astype(float), np.ones_like(frame.depth_mm)))
            found = ", ".join(f"{depth_error_um(depth, surface):6.1f}" for depth in depths)
            doubted = float((confidence.quality_flags[surface.contact] > 0).mean())
            print(f"{name:18} {doubted:5.1%} of the contact doubted; um: even, by weight, of true slopes {found}")


def by_doubt(seen: list[tuple[str, TactileFrame, Surface]]) -> None:
    """Print the mean error of the normals where the true surface is steeper than 0.2, by doubt."""
    errors, doubts = [], []
    for _, frame, surface in seen:
        assert frame.confidence is not None
        steep = np.hypot(*np.moveaxis(surface.gradient_map, 2, 0)) > 0.2
        true = normals(surface.gradient_map.astype(np.float32))
        errors.append(angle_deg(frame.normal_map[steep], true[steep]))
        doubts.append(frame.confidence.quality_flags[steep])
    error, doubt = np.concatenate(errors), np.concatenate(doubts)
    for name, chosen in (("none", doubt == 0), ("steep", doubt == STEEP), ("dark", doubt == DARK),
                         ("steep and dark", doubt == STEEP | DARK), ("clipped", doubt & CLIPPED > 0)):  # fmt: skip
        if chosen.any():
            print(f"doubt {name:15} {chosen.sum():7} pixels, normals {error[chosen].mean():5.2f} degrees off")


if __name__ == "__main__":
    main()
