"""Make scan.webp, the picture of the README's section on scanning: a name plate, larger than the view, in ten presses.

    .venv/bin/python docs/pictures/scan.py

The plate is pressed into the simulated gel, photographed with noise, and scanned as `gellight scan` does; where it was
pressed is not given away.
"""

import tempfile
from pathlib import Path

import cv2
import numpy as np

import gellight
from gellight.frames.frames import CameraFrame
from gellight.frames.pixel_grid import over_gel
from gellight.lab.report.pictures import Picture
from gellight.lab.simulator.scene import Scene, under_light
from gellight_scan.contact_view import ContactView
from gellight_scan.fusion import Fused
from gellight_scan.scan import Scan, map_picture
from sim_reference import gel
from sim_reference.camera import CameraResponse, digitise, linear_grey
from sim_reference.deformation import NO_OBJECT, grid
from sim_reference.geometry import AS_BUILT
from sim_reference.imaging import led_irradiance
from sim_reference.surface import sample

SIZE_MM, STEP_MM = (86.0, 36.0), 0.1
TEXT, RAISED_MM, ROUGH_MM = "GelLight", 0.2, 0.015
PATCH_MM, GRID, DEEP_MM = 20.0, 512, 0.5
PLACES = [(x, y) for y in (-6.0, 6.0) for x in (-28.0, -14.0, 0.0, 14.0, 28.0)]
WIDTH_PX = 1100
GEOMETRY = AS_BUILT


def plate() -> np.ndarray:
    """Return the heights of the plate, mm: raised letters and the roughness of a cast surface."""
    across, down = (round(size / STEP_MM) for size in SIZE_MM)
    letters = np.zeros((down, across), np.uint8)
    cv2.putText(letters, TEXT, (40, 240), cv2.FONT_HERSHEY_DUPLEX, 5.4, 255, 22, cv2.LINE_AA)
    rough = np.random.default_rng(0).standard_normal((down, across))
    rough = cv2.GaussianBlur(rough, None, 4) - cv2.GaussianBlur(rough, None, 10)
    raised = cv2.GaussianBlur(letters.astype(np.float64), None, 2.5) / 255
    return np.asarray(RAISED_MM * raised + ROUGH_MM * rough / rough.std())


def pressed(heights: np.ndarray, x_mm: float, y_mm: float, turn_rad: float) -> np.ndarray:
    """Return the heights around a place, turned, on the grid of the gel; NO_OBJECT beside the plate and the gel."""
    at = grid(GRID, STEP_MM)
    x, y = np.meshgrid(at, at)
    c, s = np.cos(turn_rad), np.sin(turn_rad)
    columns, rows = (
        (place / STEP_MM + (size - 1) / 2).astype(np.float32)
        for place, size in ((c * x + s * y + x_mm, heights.shape[1]), (c * y - s * x + y_mm, heights.shape[0]))
    )
    seen = cv2.remap(heights, columns, rows, cv2.INTER_LINEAR, borderValue=NO_OBJECT)
    seen[(np.hypot(x, y) > PATCH_MM) | (seen < -1)] = NO_OBJECT
    return np.where(seen > NO_OBJECT, seen - seen.max(), NO_OBJECT)


def photograph(scene: Scene, heights: np.ndarray, random: np.random.Generator) -> Picture:
    """Press heights into the gel and take a picture of it."""
    surface = sample(gel.press(heights, STEP_MM, DEEP_MM, GEOMETRY, tolerance=1e-3), GEOMETRY, 0.0, 0.0)
    lit = np.stack([led_irradiance(surface.single_precision(), GEOMETRY, led) for led in range(len(scene.light))])
    grey = linear_grey(under_light(lit.astype(np.float32), scene.light), scene.response)
    return digitise(grey.astype(np.float32), 1.0, random)


def scanned(folder: Path) -> Fused:
    """Press the plate ten times and return the map."""
    bundle, random = gellight.load_bundle("synthetic"), np.random.default_rng(1)
    reconstructor, scene, scan = gellight.Reconstructor(bundle), Scene(GEOMETRY, CameraResponse()), Scan(folder)
    heights = plate()
    for number, (x, y) in enumerate(PLACES):
        place = pressed(heights, x + random.uniform(-1, 1), y + random.uniform(-1, 1), random.normal() * 0.03)
        image = photograph(scene, place, random)
        frame = reconstructor.reconstruct(CameraFrame(image=image, time_s=0.0, sequence=number))
        print(
            scan.add(
                ContactView(
                    over_gel(frame.depth_mm, bundle.manifest.camera_height_mm), bundle.pixel_size_mm, bundle.identity
                )
            ).in_words()
        )
    assert scan.fused is not None
    return scan.fused


def main() -> None:
    """Write the picture beside this file."""
    with tempfile.TemporaryDirectory() as folder:
        fused = scanned(Path(folder))
    large = map_picture(fused)[..., ::-1]
    height = round(large.shape[0] * WIDTH_PX / large.shape[1])
    picture = cv2.resize(large, (WIDTH_PX, height), interpolation=cv2.INTER_AREA)
    path = Path(__file__).with_suffix(".webp")
    if not cv2.imwrite(str(path), picture, [cv2.IMWRITE_WEBP_QUALITY, 75]):
        raise SystemExit(f"{path} was not written")
    reached = fused.height_map.reached.sum() / fused.seen.sum()
    print(f"{path}: reached {reached:.0%}, presses differ by {fused.seam_mm * 1e3:.1f} um")


if __name__ == "__main__":
    main()
