"""Geometry of the sensor, as designed in sections 2.1 and 3.1 of the GelLight paper.

Axes, stated once for all of GelLight: x right (columns), y down (rows), z from the gel to the camera; the origin is
the centre of the gel surface at rest. A surface is z(x, y) = depth, positive into the sensor. Lengths are mm, angles
rad, azimuths are counted anticlockwise as seen in the image, from +x (so y = -r sin(azimuth)).
"""

from dataclasses import dataclass
from math import cos, log, pi, radians, sin

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Box = tuple[slice, slice]
"""rows and columns of a picture"""
WHOLE: Box = (slice(None), slice(None))
ACRYLIC_MM = 3.0
"""thickness of the board that supports the gel (section 3.2.1)"""
DEEPEST_SHARE = 0.6
"""of the gel's thickness: no model of the gel is pressed deeper"""
POSITIVE = (
    "gel_diameter_mm",
    "gel_thickness_mm",
    "camera_height_mm",
    "pixel_size_mm",
    "ring_radius_mm",
    "image_width_px",
    "image_height_px",
)


@dataclass(frozen=True, kw_only=True)
class SensorGeometry:
    """Every length and angle of a sensor; the defaults are the sensor of the paper where the paper gives a figure.

    It gives none for the ring radius, Poisson's ratio, the coating and the image size: those are ours. The beam is that
    of the LED's data sheet, 120 degrees; section 3.1.2 simulates 160.

    The paper gives 0.02352 mm per pixel without the image size; here its camera is 1600 x 1200 pixels streamed at
    640 x 480, so 0.0588 mm per pixel and a view of 37.6 mm x 28.2 mm.
    """

    gel_diameter_mm: float = 50.0
    gel_thickness_mm: float = 5.0
    poisson_ratio: float = 0.49
    coating_smoothing_mm: float = 0.1
    """the reflective coating bridges detail finer than this (standard deviation of a Gaussian)"""
    camera_height_mm: float = 40.0
    """from the gel surface to the camera (h_g)"""
    image_width_px: int = 640
    image_height_px: int = 480
    pixel_size_mm: float = 0.0588
    led_colours: str = "RRRRGGGGBBBB"
    """one letter an LED, anticlockwise from azimuth 0"""
    ring_radius_mm: float = 21.5
    """to the LEDs; a 6.5 mm strip then just fits a housing of 50 mm"""
    mounting_height_mm: float = 20.0
    """of the LEDs above the camera (h_1), so they are camera_height - mounting_height above the gel"""
    incident_angle_rad: float = radians(29.0)
    """tilt of each LED's axis from the gel normal, inwards (phi)"""
    beam_angle_rad: float = radians(120.0)
    """full angle at half power; 120 degrees is the data sheet of the WS2812B, the paper simulates 160"""
    perspective: bool = False
    """the camera is a pinhole at its height (see `view`); else it looks along parallel rays"""
    window: bool = False
    """gel and acrylic bend light and take some (see `refraction`); else it goes straight, as in the paper's model"""
    obliquity: float = 0.0
    """what a ray at the angle a brings to a pinhole's picture goes with cos^obliquity a: 4 where the lens has it"""

    def __post_init__(self) -> None:
        """Refuse geometry that cannot be built."""
        for name in POSITIVE:
            if not getattr(self, name) > 0:
                raise ValueError(f"{name} = {getattr(self, name)} must be greater than 0")
        if not self.obliquity >= 0:
            raise ValueError(f"obliquity = {self.obliquity} must not be negative")
        if not self.coating_smoothing_mm >= 0:
            raise ValueError(f"coating_smoothing_mm = {self.coating_smoothing_mm} must not be negative")
        if not 0 <= self.poisson_ratio < 0.5:
            raise ValueError(
                f"poisson_ratio = {self.poisson_ratio} must lie in [0, 0.5): a fully incompressible "
                "layer that is bonded to its support cannot be pressed over its whole area"
            )
        self._check_ring()

    def _check_ring(self) -> None:
        if not self.camera_height_mm - self.mounting_height_mm > 0:
            raise ValueError(
                f"LEDs at mounting height {self.mounting_height_mm} mm would be in or below the gel, "
                f"which is {self.camera_height_mm} mm from the camera: lower mounting_height_mm"
            )
        if self.window and not self.camera_height_mm - self.mounting_height_mm > self.window_mm:
            raise ValueError(
                f"LEDs {self.camera_height_mm - self.mounting_height_mm:g} mm above the gel surface are inside the "
                f"window of {self.window_mm:g} mm: lower mounting_height_mm or gel_thickness_mm"
            )
        if set(self.led_colours) - set("RGB") or len(self.led_colours) < 3:
            raise ValueError(f"led_colours {self.led_colours!r}: give one of R, G, B for each of at least 3 LEDs")
        if not 0 <= self.incident_angle_rad < pi / 2:
            raise ValueError(f"incident_angle_rad = {self.incident_angle_rad} must lie in [0, pi / 2)")
        if not 0 < self.beam_angle_rad < pi:
            raise ValueError(f"beam_angle_rad = {self.beam_angle_rad} must lie between 0 and pi")

    @property
    def image_shape(self) -> tuple[int, int]:
        """(H, W)"""
        return self.image_height_px, self.image_width_px

    @property
    def window_mm(self) -> float:
        """Thickness of gel and acrylic."""
        return ACRYLIC_MM + self.gel_thickness_mm

    @property
    def deepest_press_mm(self) -> float:
        """The deepest press that is simulated, mm."""
        return DEEPEST_SHARE * self.gel_thickness_mm

    def check_press(self, press_depth_mm: float) -> None:
        """Raise ValueError unless a press is from 0 to `deepest_press_mm` deep."""
        if not 0 <= press_depth_mm <= self.deepest_press_mm:
            raise ValueError(
                f"press depth {press_depth_mm:g} mm: give 0 to {self.deepest_press_mm:g} mm, {DEEPEST_SHARE:.0%} of "
                f"the gel's thickness of {self.gel_thickness_mm:g} mm"
            )

    @property
    def emission_exponent(self) -> float:
        """m of the LED's radiation pattern cos^m, from its beam angle: cos^m(beam_angle / 2) = 1/2."""
        return log(0.5) / log(cos(self.beam_angle_rad / 2))


AS_BUILT = SensorGeometry(perspective=True, window=True)
"""the paper's sensor as a camera sees it; `SensorGeometry()` is the model in which the paper computes it"""


def pixel_grid(geometry: SensorGeometry) -> tuple[Array, Array]:
    """x (1, W) and y (H, 1) in mm of the pixel centres, from the image centre."""
    height, width = geometry.image_shape
    x = (np.arange(width, dtype=np.float64) - (width - 1) / 2) * geometry.pixel_size_mm
    y = (np.arange(height, dtype=np.float64) - (height - 1) / 2) * geometry.pixel_size_mm
    return x[None, :], y[:, None]


def led_azimuths(geometry: SensorGeometry) -> Array:
    """(N,) azimuth of each LED in rad, evenly spaced from 0."""
    count = len(geometry.led_colours)
    return 2 * np.pi * np.arange(count) / count


def led_positions(geometry: SensorGeometry) -> Array:
    """(N, 3) position of each LED in mm."""
    azimuth = led_azimuths(geometry)
    height = geometry.camera_height_mm - geometry.mounting_height_mm
    r = geometry.ring_radius_mm
    return np.stack([r * np.cos(azimuth), -r * np.sin(azimuth), np.full_like(azimuth, height)], axis=1)


def led_axes(geometry: SensorGeometry) -> Array:
    """(N, 3) unit vector along which each LED shines: tilted inwards by the incident angle from the gel normal."""
    azimuth = led_azimuths(geometry)
    tilt = geometry.incident_angle_rad
    inwards = np.stack([-np.cos(azimuth), np.sin(azimuth)], axis=1) * sin(tilt)
    return np.concatenate([inwards, np.full((len(azimuth), 1), -cos(tilt))], axis=1)
