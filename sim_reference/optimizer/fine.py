"""Section 2.3.2: the mounting height of the LEDs by uniformity (NSD) and colour (SAT) of the picture of a plane."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from sim_reference.camera import CameraResponse, linear_grey
from sim_reference.geometry import SensorGeometry, led_positions, pixel_grid
from sim_reference.imaging import ring_irradiance, ring_light
from sim_reference.metrics import normalised_deviation, saturation
from sim_reference.optimizer.near_field import Ring, ring_light_vectors
from sim_reference.refraction import VACUUM, Medium
from sim_reference.surface import untouched

Array = NDArray[np.float64]
HEIGHTS_MM = tuple(float(height) for height in range(0, 37, 4))
IDEAL_CAMERA = CameraResponse(crosstalk=((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)), noise_grey=0.0)
"""linear, its colours apart: equations 6 and 7 on the light itself"""
PLANE_PX = 161


@dataclass(frozen=True, kw_only=True)
class View:
    """What equations 6 and 7 are taken over, and through which camera. Each changes SAT more than the LEDs do."""

    diameter_mm: float = 35.0
    width_mm: float = 0.0
    """if given, a rectangle of width and height instead of the disc"""
    height_mm: float = 0.0
    camera: CameraResponse = IDEAL_CAMERA
    ambient: float = 0.0
    """light between the gel and the walls, grey and even, as a share of the mean"""
    medium: Medium = VACUUM
    falloff: bool = True
    """light falls with the square of the distance; equation 3 as it is printed lacks that"""

    @property
    def extent_mm(self) -> float:
        """Side of the square that holds the view."""
        return max(self.width_mm, self.height_mm) if self.width_mm else self.diameter_mm


@dataclass(frozen=True)
class Illumination:
    """How a plane is lit with the LEDs at one height."""

    mounting_height_mm: float
    nsd: float
    saturation: float
    mean: float
    """of the three channels, per LED intensity and mm^2 (without falloff per intensity): comparable between heights"""
    variation: float
    """standard deviation of the mean of the channels over its mean"""
    span: float
    """largest less smallest of the mean of the channels, over its mean"""
    within_sigmas: tuple[float, float, float]
    """share of the pixels within 1, 2, 3 standard deviations of the mean"""


def at_height(geometry: SensorGeometry, mounting_height_mm: float) -> SensorGeometry:
    """Return the sensor with its ring at another height; raises ValueError inside the gel."""
    return replace(geometry, mounting_height_mm=mounting_height_mm)


def plane_picture(geometry: SensorGeometry, view: View) -> tuple[Array, NDArray[np.bool_]]:
    """Return the picture (H, W, 3) of the plane before exposure, and the mask (H, W) of what is evaluated."""
    pixel = view.extent_mm / PLANE_PX
    square = replace(geometry, image_width_px=PLANE_PX, image_height_px=PLANE_PX, pixel_size_mm=pixel)
    x, y = np.broadcast_arrays(*pixel_grid(square))
    inside = np.hypot(x, y) <= view.diameter_mm / 2
    if view.width_mm:
        inside = (np.abs(x) <= view.width_mm / 2) & (np.abs(y) <= view.height_mm / 2)
    light = _plane_light(square, view)
    light += view.ambient * light[inside].mean()
    brightest = light[inside].max()  # gamma acts on the share of white
    return linear_grey(light / brightest, view.camera) * brightest, inside


def _plane_light(square: SensorGeometry, view: View) -> Array:
    """Return the light (H, W, 3) on the plane, in the unit of `imaging.led_irradiance`."""
    colours = ring_light(square)
    if view.medium.refractive_index == 1 and view.falloff:
        return ring_irradiance(untouched(square), square, colours)
    x, y = np.broadcast_arrays(*pixel_grid(square))
    ring: Ring = ring_light_vectors(square, x.ravel(), y.ravel(), view.medium)
    light = ring.vectors[..., 2]
    if not view.falloff:
        light = light * _squared_distances(square, x.ravel(), y.ravel())
    return np.asarray((light.T @ colours).reshape(*square.image_shape, 3))


def _squared_distances(square: SensorGeometry, x: Array, y: Array) -> Array:
    """Return (d / h)^2 of each LED to points of the gel, (K, P), h its height: what undoes the inverse square."""
    return np.array([1 + ((led_x - x) ** 2 + (led_y - y) ** 2) / h**2 for led_x, led_y, h in led_positions(square)])


def illumination(geometry: SensorGeometry, view: View) -> Illumination:
    """Equations 6 and 7 for the sensor `geometry`."""
    picture, inside = plane_picture(geometry, view)
    pixels = picture[inside]
    mean_of_channels = pixels.mean(axis=1)
    mean, deviation = float(mean_of_channels.mean()), float(mean_of_channels.std())
    off = np.abs(mean_of_channels - mean)
    one, two, three = (float((off <= sigmas * deviation).mean()) for sigmas in (1, 2, 3))
    distance = geometry.camera_height_mm - geometry.mounting_height_mm
    return Illumination(
        geometry.mounting_height_mm,
        normalised_deviation(pixels),
        saturation(pixels),
        mean / distance**2 if view.falloff else mean,
        deviation / mean,
        float(np.ptp(mean_of_channels)) / mean,
        (one, two, three),
    )


def height_of_saturation(heights_mm: Array, saturations: Array, wanted: float = 0.5) -> float:
    """Return the height at which SAT first reaches `wanted`, linearly between the heights.

    NaN if it never does, or is beyond it at the first height already.
    """
    above = np.flatnonzero(saturations >= wanted)
    if not len(above) or saturations[0] > wanted:
        return float("nan")
    if above[0] == 0:
        return float(heights_mm[0])
    right = int(above[0])
    share = (wanted - saturations[right - 1]) / (saturations[right] - saturations[right - 1])
    return float(heights_mm[right - 1] + share * (heights_mm[right] - heights_mm[right - 1]))
