"""The calibration ball (section 2.3.2, equation 8 and figure 3c): which radius records which slopes."""

from dataclasses import dataclass
from math import degrees, radians

import numpy as np
from numpy.typing import NDArray

from sim_reference.geometry import SensorGeometry
from sim_reference.metrics import maximum_elevation
from sim_reference.refraction import Medium, trace, window_of

Array = NDArray[np.float64]
WANTED_ELEVATION_RAD = radians(60)
"""a good reconstruction needs a calibration that records 60 degrees or more (section 2.3.2)"""
ROUNDING_RAD = radians(1e-9)


@dataclass(frozen=True)
class BallChoice:
    """A ball and a press, and why."""

    radius_mm: float
    press_depth_mm: float
    elevation_rad: float
    shadow_free_rad: float
    """steeper slopes in the middle of the gel turn away from an LED: a right angle less the light's angle there"""


def elevation_table(radii_mm: Array, press_depths_mm: Array) -> Array:
    """Equation 8 for each radius and press depth: (radii, depths) rad, NaN where the press is deeper than the ball."""
    return np.array(
        [[maximum_elevation(r, d) if d <= r else np.nan for d in press_depths_mm.tolist()] for r in radii_mm.tolist()]
    )


def choose_ball(radii_mm: Array, geometry: SensorGeometry, *, press_depth_mm: float = 2.0) -> BallChoice:
    """Return the largest of `radii_mm` that records 60 degrees: the larger the ball, the sharper its edge in the image.

    Raises ValueError for a press deeper than 60 % of the gel, or if no ball is small enough.
    """
    geometry.check_press(press_depth_mm)
    if press_depth_mm == 0:
        raise ValueError("press depth 0 mm: a ball that is not pressed records nothing, press deeper")
    fitting = [r for r in radii_mm.tolist() if r >= press_depth_mm and _records(r, press_depth_mm)]
    if not fitting:
        raise ValueError(
            f"no ball of {', '.join(f'{r:g}' for r in radii_mm)} mm radius records "
            f"{degrees(WANTED_ELEVATION_RAD):g} degrees at a press of {press_depth_mm} mm: "
            f"give one between {press_depth_mm:g} and {2 * press_depth_mm:g} mm"
        )
    radius = max(fitting)
    elevation = maximum_elevation(radius, press_depth_mm)
    return BallChoice(radius, press_depth_mm, elevation, shadow_free_slope(geometry))


def shadow_free_slope(geometry: SensorGeometry) -> float:
    """Return the slope, rad, from which the middle of the gel turns away from an LED behind the window."""
    return np.pi / 2 - arrival_angle(geometry, window_of(geometry))


def arrival_angle(geometry: SensorGeometry, medium: Medium) -> float:
    """Return the angle from the normal, rad, at which an LED's light arrives in the middle of the gel.

    The tilt of the LEDs is another thing: near the ring the light arrives as places decide, and a window bends it.
    Raises ValueError for LEDs inside the window.
    """
    height_mm = geometry.camera_height_mm - geometry.mounting_height_mm
    return float(trace(np.array([geometry.ring_radius_mm]), height_mm, medium).arriving_rad[0])


def _records(radius_mm: float, press_depth_mm: float) -> bool:
    return maximum_elevation(radius_mm, press_depth_mm) >= WANTED_ELEVATION_RAD - ROUNDING_RAD
