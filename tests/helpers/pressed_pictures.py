"""Pictures of ball presses on the simulated sensor, as a user makes them, and the command that learns from them."""

from pathlib import Path
from typing import Any

import cv2
import numpy as np

from gellight.lab.simulator.scene import Press, Scene
from sim_reference.camera import CameraResponse, digitise
from sim_reference.geometry import SensorGeometry
from tests.helpers.command_line import invoke

GEOMETRY = SensorGeometry(image_width_px=160, image_height_px=120, pixel_size_mm=0.2352)
BALL = ["--ball-radius-mm", "4", "--pixel-size-mm", "0.2352"]


def photograph(scene: Scene, press: Press | None, seed: int, path: Path) -> np.ndarray:
    """Take a picture of a press, and return where the ball touches."""
    grey, surface = scene.show(press)
    image = digitise(grey, 1.0, np.random.default_rng(seed))
    cv2.imwrite(str(path), image[..., ::-1])
    return surface.contact


def press_into(folder: Path) -> Path:
    """Write pictures of ball presses, a csv of the circles of ten and one of four others, and the untouched gel."""
    scene = Scene(GEOMETRY, CameraResponse())
    lines = ["image,center_x_px,center_y_px,contact_radius_px"]
    random = np.random.default_rng(0)
    for number in range(14):
        x, y = random.uniform([-12, -9], [12, 9])
        contact = photograph(scene, Press("BALL", 1.5, x, y), number, folder / f"{number:02}.png")
        centre = x / 0.2352 + 79.5, y / 0.2352 + 59.5
        lines.append(f"{number:02}.png,{centre[0]:.2f},{centre[1]:.2f},{np.sqrt(contact.sum() / np.pi):.2f}")
    (folder / "presses.csv").write_text("\n".join(lines[:11]) + "\n")
    (folder / "others.csv").write_text("\n".join([lines[0], *lines[11:]]) + "\n")
    (folder / "untouched").mkdir()
    for number in range(8):
        photograph(scene, None, 100 + number, folder / f"untouched/{number}.png")
    return folder


def run(*arguments: str | Path) -> Any:
    return invoke("calibrate", *arguments)


def sources(folder: Path) -> list[str | Path]:
    return ["--presses", folder / "presses.csv", "--reference", folder / "untouched", *BALL]
