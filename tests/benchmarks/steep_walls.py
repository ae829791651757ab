"""How deep flat ends between steep walls are felt: `python -m tests.benchmarks.steep_walls`.

A simulated sensor, seen and lit as a pinhole camera behind gel and acrylic sees and lights it, learns from 24 presses
of a ball of 4 mm radius, 0.25 to 1 mm deep, whose circles are right; no slope is steeper than 0.67. Then square ends
with walls of a known angle are pressed. Printed is how much too deep the middle of the end is felt, in um.
"""

import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

from gellight.frame_path.pipeline import Reconstructor
from gellight.lab.report.pictures import write_png
from gellight.lab.training.presses import Ball, Press
from gellight.lab.training.training import Learning, TrainingOptions, fit, read_reference
from gellight.lab.training.validation import frame_of
from sim_reference import gel
from sim_reference.camera import CameraResponse, digitise, exposure_for, linear_grey
from sim_reference.deformation import NO_OBJECT, Deformation, grid
from sim_reference.geometry import SensorGeometry
from sim_reference.imaging import ring_irradiance, ring_light
from sim_reference.surface import GRID_EXTENT_MM, GRID_SIZE, Surface, sample, untouched

GEOMETRY = SensorGeometry(
    image_width_px=320, image_height_px=240, pixel_size_mm=0.1176, perspective=True, window=True
)  # fmt: skip
BALL = Ball(radius_mm=4.0, pixel_size_mm=GEOMETRY.pixel_size_mm)
SPACING_MM = GRID_EXTENT_MM / GRID_SIZE
X, Y = grid(GRID_SIZE, SPACING_MM)[None, :], grid(GRID_SIZE, SPACING_MM)[:, None]
DEPTHS_MM, WALLS_DEG, HALF_WIDTHS_MM = (0.25, 0.5, 1.0), (40, 60, 80), (0.5, 3.0)
LIGHT = ring_light(GEOMETRY)
RESPONSE = replace(
    CameraResponse(),
    exposure=exposure_for(ring_irradiance(untouched(GEOMETRY), GEOMETRY, LIGHT), CameraResponse(), 200.0),
)


def picture(surface: Surface, random: np.random.Generator) -> np.ndarray:
    """Return the (H, W, 3) picture with a noise of one grey level."""
    grey = linear_grey(ring_irradiance(surface, GEOMETRY, LIGHT), RESPONSE)
    return digitise(grey.astype(np.float32), 1.0, random)


def ball_press(folder: Path, number: int, random: np.random.Generator) -> Press:
    """Press the ball somewhere, and label it."""
    below = np.maximum(BALL.radius_mm**2 - X**2 - Y**2, 0)
    height = np.where(below > 0, np.sqrt(below) - BALL.radius_mm, NO_OBJECT)
    pressed = gel.press(height, SPACING_MM, random.uniform(0.25, 1.0), GEOMETRY)
    x, y = random.uniform([-8, -5.5], [8, 5.5])
    path = folder / f"{number}.png"
    write_png(path, picture(sample(pressed, GEOMETRY, x, y), random))
    size = GEOMETRY.pixel_size_mm
    radius_px = float(np.sqrt(pressed.contact.sum() / np.pi)) * SPACING_MM / size
    return Press(image=path, center_x_px=x / size + 159.5, center_y_px=y / size + 119.5, contact_radius_px=radius_px)


def flat_end(half_width_mm: float, wall_deg: float, depth_mm: float) -> Deformation:
    """Press a square end whose walls lean from the plane by an angle."""
    beyond = np.maximum(np.maximum(np.abs(X), np.abs(Y)) - half_width_mm, 0)
    return gel.press(np.maximum(-beyond * np.tan(np.radians(wall_deg)), -3.0), SPACING_MM, depth_mm, GEOMETRY)


def main() -> None:
    """Calibrate, press, print."""
    random = np.random.default_rng(3)
    with tempfile.TemporaryDirectory(prefix="gellight-walls-") as place:
        folder = Path(place)
        write_png(folder / "untouched.png", picture(untouched(GEOMETRY), random))
        presses = [ball_press(folder, number, random) for number in range(24)]
        how = Learning(options=TrainingOptions(recipe="thorough"))
        reference = read_reference(folder / "untouched.png")
        path = Reconstructor(fit(presses, reference, BALL, folder / "bundle", sensor="walls", how=how))
        frame = frame_of(presses[0])
    print("half width, wall      " + "".join(f"{depth:8} mm" for depth in DEPTHS_MM))
    for half_width in HALF_WIDTHS_MM:
        for wall in WALLS_DEG:
            off = []
            for depth in DEPTHS_MM:
                surface = sample(flat_end(half_width, wall, depth), GEOMETRY, 0.0, 0.0)
                felt = path.reconstruct(replace(frame, image=picture(surface, random))).depth_mm
                middle = (slice(120 - 3, 120 + 3), slice(160 - 3, 160 + 3))
                off.append(float((felt - surface.depth_mm)[middle].mean()))
            print(f"{half_width} mm, {wall} degrees   " + "".join(f"{1e3 * one:8.0f} um" for one in off), flush=True)


if __name__ == "__main__":
    main()
