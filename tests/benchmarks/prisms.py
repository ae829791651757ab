"""Does GelNet gain from prisms beside balls: `python -m tests.benchmarks.prisms [RECIPE]`.

Balls of 4 mm and prisms are pressed into the elastic layer, found as `calibrate detect` finds them, and learnt from.
Judges are fresh balls, a smaller ball, TSTEP, PINS and prisms of other angles, by the true surface.
docs/calibration-data.md has the figures.
"""

import sys
import tempfile
from collections.abc import Sequence
from math import radians
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gellight.bundle.bundle import write_bundle
from gellight.frame_path.pipeline import Reconstructor
from gellight.frames.frames import CameraFrame
from gellight.lab.report.pictures import write_png
from gellight.lab.simulator.scene import Press as GelPress
from gellight.lab.simulator.scene import Scene
from gellight.lab.training.labelling import find_circle, find_prism
from gellight.lab.training.presses import Ball, Press
from gellight.lab.training.prisms import PrismPress, with_prisms
from gellight.lab.training.table import PressTable, TableOptions, build_table
from gellight.lab.training.training import TrainingOptions, train
from gellight.reconstruction.integration import angle_deg, normals
from sim_reference import gel
from sim_reference.camera import CameraResponse, digitise
from sim_reference.deformation import Deformation, grid
from sim_reference.geometry import SensorGeometry
from sim_reference.objects import ObjectParameters, object_height, prism
from sim_reference.surface import GRID_EXTENT_MM, GRID_SIZE, Surface

GEOMETRY = SensorGeometry(image_width_px=320, image_height_px=240, pixel_size_mm=0.1176)
RESPONSE = CameraResponse(noise_grey=1.0)
BALL = Ball(radius_mm=4.0, pixel_size_mm=GEOMETRY.pixel_size_mm)
RANDOM = np.random.default_rng(0)
BALLS, SEEDS = 16, 2
LEARNT = {"30": [(30, 1.4, turn) for turn in (10, 55, 100, 145)], "45": [(45, 1.8, turn) for turn in (30, 120)]}
"""angle in degrees, depth in mm, turn of the edge in degrees"""
Seen = tuple[NDArray[np.uint8], Surface]


def height(name: str, **parameters: float) -> NDArray[np.float64]:
    """Heights of an object on the grid of the gel, mm; PRISM takes its angle and the turn of its edge, degrees."""
    at = grid(GRID_SIZE, GRID_EXTENT_MM / GRID_SIZE)
    if name != "PRISM":
        return object_height(name, at[None, :], at[:, None], ObjectParameters(**parameters))  # type: ignore[arg-type]
    turned = ObjectParameters(prism_turn_deg=parameters["turn"])
    return prism(parameters["angle"], at[None, :], at[:, None], turned)


def seen(name: str, depth_mm: float, **parameters: float) -> Seen:
    """Press an object at a random place, and photograph it."""
    deformed: Deformation = gel.press(height(name, **parameters), GRID_EXTENT_MM / GRID_SIZE, depth_mm, GEOMETRY)
    place = RANDOM.uniform(-1, 1, 2) * (9, 6) if name in ("BALL", "PRISM") else (0.5, -0.4)
    grey, surface = Scene(GEOMETRY, RESPONSE, model=lambda *_: deformed).show(GelPress("BALL", 0.5, *map(float, place)))
    return digitise(grey, 1.0, RANDOM), surface


def judges() -> dict[str, list[Seen]]:
    """What nothing is learnt from."""
    return {
        "ball 4 mm": [seen("BALL", depth) for depth in (0.5, 1.0, 1.5)],
        "ball 2.5 mm": [seen("BALL", depth, calibration_ball_radius_mm=2.5) for depth in (0.5, 1.0)],
        "TSTEP": [seen("TSTEP", depth) for depth in (0.4, 0.6)],
        "PINS": [seen("PINS", 0.6)],
        "prism 20": [seen("PRISM", 0.9, angle=20, turn=turn) for turn in (35, 80)],
        "prism 40": [seen("PRISM", 1.6, angle=40, turn=turn) for turn in (75, 170)],
    }


def tables(reference: NDArray[np.float32], folder: Path) -> dict[str, PressTable]:
    """Presses, labelled by their pictures, as tables with and without prisms."""
    balls: list[Press] = []
    for number, depth in enumerate(np.linspace(0.3, 1.8, BALLS).round(2).tolist()):
        image, _ = seen("BALL", depth)
        write_png(folder / f"ball-{number:02}.png", image)
        circle = find_circle(image, reference, ball=BALL)
        at = (circle.center_x_px, circle.center_y_px, circle.contact_radius_px)
        names = ("center_x_px", "center_y_px", "contact_radius_px")
        balls.append(Press(image=folder / f"ball-{number:02}.png", found=True, **dict(zip(names, at, strict=True))))
    prisms = {name: [_prism(folder, reference, *press) for press in presses] for name, presses in LEARNT.items()}

    options = TableOptions()
    alone = build_table(balls, reference, BALL, options)

    def beside(pressed: Sequence[PrismPress]) -> PressTable:
        return with_prisms(alone, pressed, reference, options, follow_light=False)

    return {
        "16 balls": alone,
        "16 balls, 4 of 30": beside(prisms["30"]),
        "16 balls, 4 of 30, 2 of 45": beside([*prisms["30"], *prisms["45"]]),
    }


def _prism(folder: Path, reference: NDArray[np.float32], angle: int, depth: float, turn: int) -> PrismPress:
    image, _ = seen("PRISM", depth, angle=angle, turn=turn)
    path = folder / f"prism-{angle}-{turn}.png"
    write_png(path, image)
    return find_prism(image, reference, angle_rad=radians(angle)).press(path)


def errors(reconstructor: Reconstructor, judged: Sequence[Seen]) -> tuple[float, float, float]:
    """Mean over presses: normals in contact and over the whole map, degrees; depth in contact, um."""
    found = []
    for image, surface in judged:
        felt = reconstructor.reconstruct(CameraFrame(image=image, time_s=0.0, sequence=0))
        off = angle_deg(felt.normal_map, normals(surface.gradient_map.astype(np.float32)))
        depth = np.abs(felt.depth_mm - surface.depth_mm)[surface.contact].mean()
        found.append((off[surface.contact].mean(), off.mean(), 1000 * depth))
    contact, whole, depth_um = np.mean(found, axis=0).tolist()
    return contact, whole, depth_um


def main() -> None:
    """Print the errors of each way to learn, means over seeds, and how far the seeds scatter."""
    recipe = sys.argv[1] if len(sys.argv) > 1 else "thorough"
    flat = Scene(GEOMETRY, RESPONSE).show(None)[0]
    reference = np.mean([digitise(flat, 1.0, RANDOM) for _ in range(10)], axis=0).astype(np.float32)
    with tempfile.TemporaryDirectory() as name:
        judged = judges()
        for way, table in tables(reference, Path(name)).items():
            each = []
            for seed in range(SEEDS):
                network, _ = train(table, TrainingOptions(recipe=recipe, seed=seed))
                bundle = write_bundle(
                    Path(name) / f"{way}-{seed}", sensor="layer", reference=reference, reference_frames=10,
                    noise_grey=1.0, pixel_size_mm=(BALL.pixel_size_mm,) * 2, network=network, metrics={},
                    presses=table.arrays(),
                )  # fmt: skip
                reconstructor = Reconstructor(bundle, masked=False)
                each.append([errors(reconstructor, presses) for presses in judged.values()])
            mean, scatter = np.mean(each, axis=0), np.std(each, axis=0)
            print(f"{recipe}, {way}: normals in contact, whole map, deg; depth in contact, um")
            for object_name, (a, b, c), (da, _, dc) in zip(judged, mean.tolist(), scatter.tolist(), strict=True):
                print(f"  {object_name:12}{a:6.2f} +- {da:.2f}  {b:6.2f}  {c:6.1f} +- {dc:.1f}", flush=True)


if __name__ == "__main__":
    main()
