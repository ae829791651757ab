"""Parts to make of a design: the flexible strip of the LEDs, flat, and the table of the LEDs.

The strip lies on a cone whose side rises by the incident angle from the horizontal, so LEDs that stand upright on it
shine inwards at that angle. Unrolled, a cone of radius r is a sector of radius r / cos(angle) and of
360 degrees cos(angle). The boards show the side of the LEDs, as seen from the gel. There the LEDs are numbered
clockwise; in the camera's image their azimuths run anticlockwise.
"""

from dataclasses import dataclass
from math import cos, pi, sin

from gellight.base.errors import InputError
from gellight_design.simulating.geometry_file import STRIP_WIDTH_MM, check
from sim_reference.geometry import SensorGeometry, led_axes, led_positions

LED_SIDE_MM = 5.0
"""of a WS2812B in its 5050 package"""
LED_GAP_MM = 0.5
Point = tuple[float, float]


@dataclass(frozen=True)
class Strip:
    """The flexible circuit, flat: a sector of a ring with the LEDs on its middle line."""

    inner_radius_mm: float
    middle_radius_mm: float
    outer_radius_mm: float
    sector_rad: float
    count: int
    rise_mm: float
    """height of the cone between the edges of the strip"""

    @property
    def pitch_rad(self) -> float:
        """Angle between LEDs on the flat strip."""
        return self.sector_rad / self.count

    def led_centre(self, led: int) -> Point:
        """Return the centre of an LED in mm from the apex, x right and y up, seen from the LED side."""
        return self.middle_radius_mm * cos(self._turn(led)), self.middle_radius_mm * sin(self._turn(led))

    def _turn(self, led: int) -> float:
        return self.sector_rad - (led + 0.5) * self.pitch_rad


def fits(count: int, geometry: SensorGeometry) -> bool:
    """Return whether `count` LEDs fit side by side on the ring."""
    return 2 * pi * geometry.ring_radius_mm / count >= LED_SIDE_MM + LED_GAP_MM


def strip(geometry: SensorGeometry) -> Strip:
    """Return the flat strip of a sensor.

    Raises ConfigError if it does not fit into the housing, InputError if it is too short for all LEDs.
    """
    check(geometry)
    flat = cos(geometry.incident_angle_rad)
    middle = geometry.ring_radius_mm / flat
    count = len(geometry.led_colours)
    if not fits(count, geometry):
        apart = 2 * pi * geometry.ring_radius_mm / count
        raise InputError(
            f"{count} LEDs on a ring of {geometry.ring_radius_mm} mm are {apart:.2f} mm apart, "
            f"an LED takes {LED_SIDE_MM + LED_GAP_MM} mm: use fewer or a wider ring"
        )
    half, rise_mm = STRIP_WIDTH_MM / 2, STRIP_WIDTH_MM * sin(geometry.incident_angle_rad)
    return Strip(middle - half, middle, middle + half, 2 * pi * flat, count, rise_mm)


def led_table(geometry: SensorGeometry) -> str:
    """Return the LEDs as CSV: number along the strip, colour, azimuth, position in mm, axis."""
    rows = ["led,colour,azimuth_deg,x_mm,y_mm,z_mm,axis_x,axis_y,axis_z"]
    count = len(geometry.led_colours)
    for led, (at, axis) in enumerate(zip(led_positions(geometry), led_axes(geometry), strict=True)):
        numbers = [360 * led / count, *at.tolist(), *axis.tolist()]
        rows.append(",".join([str(led), geometry.led_colours[led], *(f"{value:.5f}" for value in numbers)]))
    return "\n".join(rows) + "\n"
