"""Where the LEDs are: positions and axes of a light ring around the optical axis.

Axes as everywhere: x right, y down, z from the gel to the camera, origin in the middle of the untouched gel. LED i sits
at azimuth 360 degrees * i / N, counted anticlockwise in the picture from +x.
"""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from math import cos, log, radians, sin
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import ConfigDict

from gellight.base.errors import ConfigError
from gellight.photometric.window import window_of

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class RingGeometry:
    """What of a sensor's geometry decides the direction of the light; the defaults are the sensor of the paper."""

    __pydantic_config__: ClassVar[ConfigDict] = ConfigDict(extra="forbid", allow_inf_nan=False)
    """for the file that holds it: no unknown key, no NaN"""
    led_colours: str = "RRRRGGGGBBBB"
    """one letter an LED"""
    ring_radius_mm: float = 21.5
    camera_height_mm: float = 40.0
    """from the gel to the camera"""
    mounting_height_mm: float = 20.0
    """of the LEDs, from the camera towards the gel"""
    incident_angle_rad: float = radians(29.0)
    """tilt of each LED's axis from the gel normal, inwards"""
    beam_angle_rad: float = radians(120.0)
    """full angle of an LED at half power"""
    centre_x_mm: float = 0.0
    """of the ring, from the middle of the picture"""
    centre_y_mm: float = 0.0
    window_mm: float = 0.0
    """of gel and acrylic, through which the light comes and which bend it; 0: it goes straight"""

    def __post_init__(self) -> None:
        """Refuse a ring that cannot light the gel."""
        if self.height_mm <= 0 or self.ring_radius_mm <= 0:
            raise ConfigError(
                f"LEDs {self.height_mm:g} mm above the gel on a radius of {self.ring_radius_mm:g} mm: both must be "
                "above 0; correct camera_height_mm, mounting_height_mm and ring_radius_mm in [geometry]"
            )
        if not 0 <= self.window_mm < self.height_mm:
            raise ConfigError(
                f"LEDs {self.height_mm:g} mm above the gel are inside a window of {self.window_mm:g} mm: correct "
                "camera_height_mm and mounting_height_mm in [geometry]"
            )
        if set(self.led_colours) != set("RGB"):
            raise ConfigError(
                f"led_colours = {self.led_colours!r}: give a letter for each LED, R, G or B, each at least once"
            )

    @classmethod
    def from_overrides(cls, overrides: Mapping[str, Any]) -> Self:
        """Return the paper's ring with the values of `overrides`, of which those that concern no light are left out."""
        known, window_mm = {field.name for field in fields(cls)}, window_of(overrides)
        return cls(**{name: value for name, value in overrides.items() if name in known}, window_mm=window_mm)

    @property
    def height_mm(self) -> float:
        """Of the LEDs above the gel."""
        return self.camera_height_mm - self.mounting_height_mm

    @property
    def channels(self) -> tuple[int, ...]:
        """Colour channel of each LED: 0, 1 or 2."""
        return tuple("RGB".index(colour) for colour in self.led_colours)

    @property
    def colours(self) -> NDArray[np.uint8]:
        """(N, 3) RGB of each LED full on."""
        return np.asarray(255 * np.eye(3, dtype=np.uint8)[list(self.channels)], np.uint8)

    @property
    def emission_exponent(self) -> float:
        """m of the radiation pattern cos^m, from cos^m(beam angle / 2) = 1/2."""
        return log(0.5) / log(cos(self.beam_angle_rad / 2))

    def azimuths_rad(self) -> Array:
        """(N,) azimuth of each LED."""
        return np.asarray(2 * np.pi * np.arange(len(self.led_colours)) / len(self.led_colours))

    def positions_mm(self) -> Array:
        """(N, 3) position of each LED."""
        azimuth, radius = self.azimuths_rad(), self.ring_radius_mm
        x, y = self.centre_x_mm + radius * np.cos(azimuth), self.centre_y_mm - radius * np.sin(azimuth)
        return np.stack([x, y, np.full_like(azimuth, self.height_mm)], axis=1)

    def axes(self) -> Array:
        """(N, 3) unit vector along which each LED shines."""
        azimuth, tilt = self.azimuths_rad(), self.incident_angle_rad
        sideways = sin(tilt)
        return np.stack(
            [-sideways * np.cos(azimuth), sideways * np.sin(azimuth), np.full_like(azimuth, -cos(tilt))], axis=1
        )
