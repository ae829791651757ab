"""A ball pressed into the elastic layer of the reference: its depth, its picture by the linear sensor, its force."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import cv2
import numpy as np
from scipy.ndimage import map_coordinates

from gellight.frames.measures import DARK, HEAVIER, Confidence, Force
from gellight.reconstruction.force import Layer
from gellight.reconstruction.force_file import FILE_NAME, ForceRecord
from sim_reference import gel
from sim_reference.deformation import grid
from sim_reference.geometry import SensorGeometry
from tests.helpers.linear_sensor import photograph

SHAPE, PIXEL_MM = (240, 320), 0.05
LAYER = Layer(thickness_mm=2.0, poisson_ratio=0.48)
MODULUS_MPA = 0.15
_SIZE, _SPACING_MM = 256, 0.1


@dataclass(frozen=True, eq=False)
class Weighed:
    depth_mm: np.ndarray
    """(H, W)"""
    pressure_mpa: np.ndarray
    """(H, W)"""
    force_n: float

    def picture(self, noise_grey: float = 0.0, seed: int = 0) -> np.ndarray:
        """(H, W, 3) as the linear sensor sees it."""
        slopes = np.stack(np.gradient(self.depth_mm, PIXEL_MM)[::-1], axis=-1)
        return photograph(slopes, noise_grey=noise_grey, rng=np.random.default_rng(seed)).image


@lru_cache(maxsize=32)
def weighed(
    press_mm: float, radius_mm: float = 3.0, x_mm: float = 0.0, pixel_mm: tuple[float, float] = (PIXEL_MM, PIXEL_MM)
) -> Weighed:
    """Press a ball so deep, `x_mm` right of the middle; depth 0 leaves the gel untouched."""
    at = grid(_SIZE, _SPACING_MM)
    beside = at[None, :] ** 2 + at[:, None] ** 2
    ball = np.where(beside < radius_mm**2, np.sqrt(np.maximum(radius_mm**2 - beside, 0)) - radius_mm, -1e3)
    geometry = SensorGeometry(
        gel_thickness_mm=LAYER.thickness_mm, poisson_ratio=LAYER.poisson_ratio, coating_smoothing_mm=0.0
    )
    pressed = gel.press(ball, _SPACING_MM, press_mm, geometry)
    pressure_mpa = pressed.pressure * MODULUS_MPA / 2 / (1 + LAYER.poisson_ratio)
    height, width = SHAPE
    x = ((np.arange(width) - (width - 1) / 2) * pixel_mm[0] - x_mm - at[0]) / _SPACING_MM
    y = ((np.arange(height) - (height - 1) / 2) * pixel_mm[1] - at[0]) / _SPACING_MM
    places = np.meshgrid(y, x, indexing="ij")
    depth, pressure = (map_coordinates(one, places, order=3) for one in (pressed.depth_mm, pressure_mpa))
    return Weighed(depth.astype(np.float32), pressure, float(pressure_mpa.sum()) * _SPACING_MM**2)


class HeavyFrames:
    """Measures that say the same force, too heavy a one, of every depth map, and doubt half of each picture."""

    from_network = True

    def force(self, depth_mm: np.ndarray) -> Force:
        return Force(normal_n=1.25, error_n=0.1, flags=(HEAVIER,), pressure_of=lambda: depth_mm / 8)

    def confidence(self, image: np.ndarray, gradient_map: np.ndarray) -> Confidence:
        dark = np.arange(image.shape[1]) * 2 < image.shape[1]
        flags = np.broadcast_to(np.where(dark, DARK, 0), image.shape[:2]).astype(np.uint8)
        return Confidence(value=np.where(flags, 0.25, 1).astype(np.float32), quality_flags=flags)


def write_weighings(folder: Path, presses: Sequence[Weighed]) -> Path:
    """Write a picture of each press and the CSV file beside them."""
    lines = ["image,force_n"]
    for number, press in enumerate(presses):
        cv2.imwrite(str(folder / f"weight{number}.png"), press.picture(0.5, number)[..., ::-1])
        lines.append(f"weight{number}.png,{press.force_n}")
    (folder / "forces.csv").write_text("\n".join(lines) + "\n")
    return folder / "forces.csv"


def force_files() -> Mapping[str, bytes]:
    """`force.json` with the layer and the modulus above, for `extend_bundle`."""
    record = ForceRecord(
        gel_thickness_mm=LAYER.thickness_mm,
        poisson_ratio=LAYER.poisson_ratio,
        youngs_modulus_mpa=MODULUS_MPA,
        error_share=0.05,
        error_floor_n=0.01,
        lightest_n=0.1,
        heaviest_n=5.0,
        readings=6,
        source="forces.csv",
        created="2026-01-01T00:00:00Z",
    )
    return {FILE_NAME: record.model_dump_json().encode()}
