"""Flat parts with a rough surface that is known, and what a sensor feels when it is pressed beside itself.

The relief is self-affine, as those of cast and ground surfaces are: the spectral density of the heights falls with the
wave number to the power -2 - 2 H, H = 0.8 (Persson et al., J. Phys.: Condens. Matter 17, 2005, section 2), between
wavelengths of 3 and 0.5 mm.
"""

import itertools
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path

import numpy as np
from scipy.interpolate import RectBivariateSpline
from scipy.spatial.transform import Rotation

from gellight.bundle.bundle import load_bundle
from gellight.frame_path.pipeline import Reconstructor
from gellight.frames.frames import CameraFrame, CaptureStamp
from gellight.frames.image_files import read_image
from gellight.frames.pixel_grid import over_gel
from gellight.lab.simulator.scene import Scene, under_light
from gellight.recording.recording_file import RecordingWriter
from gellight_scan.contact_view import ContactView
from sim_reference import gel
from sim_reference.camera import CameraResponse, digitise, linear_grey
from sim_reference.deformation import NO_OBJECT, grid
from sim_reference.geometry import AS_BUILT
from sim_reference.imaging import led_irradiance
from sim_reference.surface import Surface, sample

HURST = 0.8
LONGEST_MM, SHORTEST_MM = 3.0, 0.5
SPACING_MM = 0.1
GRID = 512
PATCH_MM = 19.0
"""radius of what meets the gel at once: all of the view but its corners"""
GEOMETRY = AS_BUILT
PIXEL_MM = (GEOMETRY.pixel_size_mm, GEOMETRY.pixel_size_mm)


@dataclass(frozen=True)
class Plate:
    """A flat part with a relief of `rms_mm`; x right, y down, z out of it, mm from its middle."""

    rms_mm: float
    seed: int
    size_mm: tuple[float, float] = (110.0, 70.0)

    @cached_property
    def spline(self) -> RectBivariateSpline:
        across, down = (round(size / SPACING_MM) for size in self.size_mm)
        k = np.hypot(np.fft.rfftfreq(across, SPACING_MM)[None, :], np.fft.fftfreq(down, SPACING_MM)[:, None])
        inside = (k >= 1 / LONGEST_MM) & (k <= 1 / SHORTEST_MM)
        noise = np.fft.rfft2(np.random.default_rng(self.seed).standard_normal((down, across)))
        height = np.fft.irfft2(np.where(inside, np.maximum(k, 1e-9) ** (-1 - HURST), 0) * noise, s=(down, across))
        return RectBivariateSpline(
            grid(down, SPACING_MM), grid(across, SPACING_MM), height * self.rms_mm / height.std()
        )

    def seen(self, pose: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Return the height at points of a sensor that sees the part carried by `pose` (4, 4)."""
        z, back = np.zeros(np.broadcast(x, y).shape), np.linalg.inv(pose)
        for _ in range(3):
            there = np.stack(np.broadcast_arrays(x, y, z), axis=-1) @ back[:3, :3].T + back[:3, 3]
            z = z + self.spline.ev(there[..., 1], there[..., 0]) - there[..., 2]
        return z


def places(columns: int, rows: int, steps_mm: tuple[float, float], seed: int, count: int = 10) -> list[np.ndarray]:
    """Return the poses (4, 4) of a part under `count` presses, row by row there and back, as a hand does it.

    Each is off by up to 2 mm along both axes; turned by 3 degrees and tilted by 0.15 (standard deviations).
    """
    random, poses = np.random.default_rng(seed), []
    for row in range(rows):
        for column in range(columns) if row % 2 == 0 else reversed(range(columns)):
            pose = np.eye(4)
            pose[:3, :3] = Rotation.from_rotvec(np.radians(random.normal(size=3) * [0.15, 0.15, 3.0])).as_matrix()
            middle = (np.array([column, row]) - np.array([columns - 1, rows - 1]) / 2) * steps_mm
            pose[:3, 3] = -pose[:3, :3] @ [*(middle + random.uniform(-2, 2, 2)), 0.0]
            poses.append(pose)
    return poses[:count]


def press(plate: Plate, pose: np.ndarray, deep_mm: float) -> Surface:
    """Press the part into the gel: its highest point by `deep_mm` beyond first touch."""
    at = grid(GRID, SPACING_MM)
    height = plate.seen(pose, at[None, :], at[:, None])
    on = np.hypot(at[None, :], at[:, None]) < PATCH_MM
    top = height[on].max()
    pressed = gel.press(np.where(on, height - top, NO_OBJECT), SPACING_MM, deep_mm, GEOMETRY, tolerance=1e-3)
    return sample(pressed, GEOMETRY, 0.0, 0.0)


@lru_cache(maxsize=1)
def _scene() -> Scene:
    return Scene(GEOMETRY, CameraResponse())


@lru_cache(maxsize=1)
def _reconstructor() -> Reconstructor:
    return Reconstructor(load_bundle("synthetic"))


def picture(surface: Surface, seed: int) -> np.ndarray:
    """Take a picture of the gel, with noise of one grey level."""
    scene, single = _scene(), surface.single_precision()
    lit = np.stack([led_irradiance(single, GEOMETRY, led) for led in range(len(scene.light))]).astype(np.float32)
    grey = linear_grey(under_light(lit, scene.light), scene.response).astype(np.float32)
    return digitise(grey, 1.0, np.random.default_rng(seed))


def felt(surface: Surface, seed: int) -> ContactView:
    """Return the press as it is reconstructed from its picture."""
    image = picture(surface, seed)
    frame = _reconstructor().reconstruct(CameraFrame(image=image, time_s=0.0, sequence=seed))
    height_mm = load_bundle("synthetic").manifest.camera_height_mm
    return ContactView(over_gel(frame.depth_mm, height_mm), PIXEL_MM, "synthetic")


def untouched() -> np.ndarray:
    return digitise(_scene().show(None)[0], 1.0, np.random.default_rng(0))


def record(path: Path, pictures: Iterable[np.ndarray]) -> None:
    """Write a recording of presses: each picture is held for four frames, then the gel is let go."""
    used = load_bundle("synthetic")
    numbers = itertools.count()
    with RecordingWriter(path, "sim") as writer:
        for image in pictures:
            for shown in (untouched(), *[image] * 4, untouched()):
                number = next(numbers)
                frame = CameraFrame(image=shown, time_s=number / 10, sequence=number)
                writer.add(frame, CaptureStamp(zeroed=used, unix_s=1e9 + frame.time_s))


def record_rolled(path: Path, sequence: Path) -> None:
    """Write a recording of the pictures in the folder of a sequence, the untouched gel before them."""
    used = load_bundle("synthetic")
    with RecordingWriter(path, "sim") as writer:
        for number, image in enumerate([untouched(), *map(read_image, sorted(sequence.glob("*.png")))]):
            frame = CameraFrame(image=image, time_s=number / 10, sequence=number)
            writer.add(frame, CaptureStamp(zeroed=used, unix_s=1e9 + frame.time_s))
