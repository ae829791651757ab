"""The benchmark of section 2.1.2 as it is measured: each object pressed into the gel and seen on a square of pixels."""

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from sim_reference import gel
from sim_reference.deformation import Deformation, GelModel
from sim_reference.geometry import SensorGeometry, pixel_grid
from sim_reference.imaging import normals
from sim_reference.objects import OBJECT_NAMES, ObjectParameters
from sim_reference.surface import GRID_SIZE, press_object, sample

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Sampling:
    """How deep an object is pressed, and on which pixels it is evaluated; the defaults are the shipped benchmark's."""

    size_px: int = 256
    extent_mm: float = 40.0
    """side of the square of `size_px` x `size_px` pixels"""
    region_diameter_mm: float = 34.0
    """of the disc that is evaluated: the object's 35 mm without its rim"""
    press_depth_mm: float = 0.9
    press_grid: int = GRID_SIZE
    """points a side of the grid on which the contact is solved"""

    def __post_init__(self) -> None:
        """Refuse what cannot be sampled."""
        if self.size_px < 16 or not 0 < self.region_diameter_mm <= self.extent_mm:
            raise ValueError(
                f"{self.size_px} px and a region of {self.region_diameter_mm} mm in {self.extent_mm} mm: give at "
                "least 16 px and a region that fits into the square"
            )

    @property
    def spacing_mm(self) -> float:
        """Side of a pixel."""
        return self.extent_mm / self.size_px

    def on(self, geometry: SensorGeometry) -> SensorGeometry:
        """Return `geometry` with a camera that sees exactly this square."""
        return replace(
            geometry, image_width_px=self.size_px, image_height_px=self.size_px, pixel_size_mm=self.spacing_mm
        )


@dataclass(frozen=True, eq=False)
class PressedObject:
    """A gel surface of which the pixels of `region` are evaluated."""

    name: str
    depth_mm: Array
    """(H, W)"""
    gradient_map: Array
    """(H, W, 2)"""
    region: NDArray[np.bool_]
    """(H, W), P of them true"""
    spacing_mm: float

    @cached_property
    def normals(self) -> Array:
        """(P, 3) unit normals in the region: the truth that is to be reconstructed."""
        return normals(self.gradient_map[self.region])

    @property
    def index(self) -> int:
        """Number of the object, so that each has noise of its own; what is not in the list has 0."""
        return OBJECT_NAMES.index(self.name) if self.name in OBJECT_NAMES else 0

    def steepest_rad(self, share: float = 0.003) -> float:
        """Return the slope angle that only `share` of the region exceeds."""
        return float(np.quantile(np.arccos(np.clip(self.normals[:, 2], -1, 1)), 1 - share))


def region(sampling: Sampling, geometry: SensorGeometry) -> tuple[NDArray[np.bool_], Array, Array]:
    """Return the mask (H, W) of the evaluated disc and x, y (P,) in mm of its pixels."""
    x, y = np.broadcast_arrays(*pixel_grid(sampling.on(geometry)))
    inside = np.hypot(x, y) < sampling.region_diameter_mm / 2
    return inside, x[inside], y[inside]


def press_benchmark(
    name: str,
    sampling: Sampling,
    geometry: SensorGeometry,
    parameters: ObjectParameters | None = None,
    model: GelModel = gel.press,
) -> PressedObject:
    """Press object `name` into the gel and sample it on the pixels; raises as `surface.press_object`."""
    deformation = deformed(name, sampling, geometry, parameters or ObjectParameters(), model)
    surface = sample(deformation, sampling.on(geometry), 0.0, 0.0)
    inside, _, _ = region(sampling, geometry)
    return PressedObject(name, surface.depth_mm, surface.gradient_map, inside, sampling.spacing_mm)


def deformed(
    name: str, sampling: Sampling, geometry: SensorGeometry, parameters: ObjectParameters, model: GelModel = gel.press
) -> Deformation:
    """Press object `name` into the gel; the last few presses are kept, for studies repeat them."""
    pad = SensorGeometry(
        gel_diameter_mm=geometry.gel_diameter_mm,
        gel_thickness_mm=geometry.gel_thickness_mm,
        poisson_ratio=geometry.poisson_ratio,
        coating_smoothing_mm=geometry.coating_smoothing_mm,
    )
    return _deformed(name, sampling.press_depth_mm, sampling.press_grid, pad, parameters, model)


@lru_cache(maxsize=12)
def _deformed(
    name: str, depth_mm: float, size: int, pad: SensorGeometry, parameters: ObjectParameters, model: GelModel
) -> Deformation:
    return press_object(name, depth_mm, pad, parameters=parameters, size=size, model=model)


def plane(sampling: Sampling, geometry: SensorGeometry) -> PressedObject:
    """Return the gel at rest: on it the error has a closed form."""
    inside, _, _ = region(sampling, geometry)
    return PressedObject("", np.zeros(inside.shape), np.zeros((*inside.shape, 2)), inside, sampling.spacing_mm)
