"""Parts to make of a design: the flexible strip of the LEDs, a drawing of the ring, the table of the LEDs.

The strip lies on a cone whose generator rises by the incident angle from the horizontal, so that LEDs that stand
upright on it shine inwards at that angle. Unrolled, a cone of radius r is a sector of radius r / cos(angle) and of
360 degrees cos(angle).
"""

import io
from dataclasses import dataclass
from math import cos, degrees, pi, sin

from gellight.errors import InputError
from gellight.optimize.geometry import STRIP_WIDTH_MM, check
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

    def led_corners(self, led: int) -> list[Point]:
        """Return the corners of the package of an LED, in mm from the apex."""
        turn = (led + 0.5) * self.pitch_rad
        half = LED_SIDE_MM / 2
        local = [(half, half), (half, -half), (-half, -half), (-half, half)]
        return [
            (
                (self.middle_radius_mm + out) * cos(turn) - along * sin(turn),
                (self.middle_radius_mm + out) * sin(turn) + along * cos(turn),
            )
            for out, along in local
        ]


def strip(geometry: SensorGeometry, width_mm: float = STRIP_WIDTH_MM) -> Strip:
    """Return the flat strip of a sensor.

    Raises ConfigError if it does not fit into the housing, InputError if it is narrower than an LED or too short for
    all of them.
    """
    check(geometry, width_mm)
    if width_mm < LED_SIDE_MM:
        raise InputError(f"a strip of {width_mm} mm is narrower than an LED of {LED_SIDE_MM} mm: make it wider")
    flat = cos(geometry.incident_angle_rad)
    middle = geometry.ring_radius_mm / flat
    count = len(geometry.led_colours)
    pitch = 2 * pi * geometry.ring_radius_mm / count
    if pitch < LED_SIDE_MM + LED_GAP_MM:
        raise InputError(
            f"{count} LEDs on a ring of {geometry.ring_radius_mm} mm are {pitch:.2f} mm apart, an LED takes "
            f"{LED_SIDE_MM + LED_GAP_MM} mm: use fewer or a wider ring"
        )
    return Strip(
        middle - width_mm / 2,
        middle,
        middle + width_mm / 2,
        2 * pi * flat,
        count,
        width_mm * sin(geometry.incident_angle_rad),
    )


def strip_dxf(flat: Strip) -> bytes:
    """Return the strip as DXF R2010 in mm: layers OUTLINE and LED; raises InputError if the file is not sound."""
    from ezdxf import units
    from ezdxf.filemanagement import new

    drawing = new("R2010", setup=True)
    drawing.units = units.MM
    for layer in ("OUTLINE", "LED"):
        drawing.layers.add(layer)
    space, last = drawing.modelspace(), degrees(flat.sector_rad)
    for radius in (flat.inner_radius_mm, flat.outer_radius_mm):
        space.add_arc((0, 0), radius, 0, last, dxfattribs={"layer": "OUTLINE"})
    for turn in (0.0, flat.sector_rad):
        ends = [(radius * cos(turn), radius * sin(turn)) for radius in (flat.inner_radius_mm, flat.outer_radius_mm)]
        space.add_line(ends[0], ends[1], dxfattribs={"layer": "OUTLINE"})
    for led in range(flat.count):
        space.add_lwpolyline(flat.led_corners(led), close=True, dxfattribs={"layer": "LED"})
    problems = drawing.audit().errors
    if problems:
        raise InputError(f"the drawing of the strip is not sound: {problems[0].message}")
    text = io.StringIO()
    drawing.write(text)
    return text.getvalue().encode(drawing.output_encoding)


COLOURS = {"R": "#d6453d", "G": "#3a9d5d", "B": "#3b6fd4"}


def strip_svg(flat: Strip, colours: str) -> str:
    """Return the strip as SVG at its true size, the LEDs in their colours."""
    large = int(flat.sector_rad > pi)
    start, end = (1.0, 0.0), (cos(flat.sector_rad), -sin(flat.sector_rad))
    outline = (
        f"M{_at(start, flat.outer_radius_mm)} A{_round(flat.outer_radius_mm)} 0 {large} 0 "
        f"{_at(end, flat.outer_radius_mm)} L{_at(end, flat.inner_radius_mm)} A{_round(flat.inner_radius_mm)} 0 {large} "
        f"1 {_at(start, flat.inner_radius_mm)} Z"
    )
    body = [f'<path d="{outline}" fill="#f2c14e" fill-opacity=".25" stroke="currentColor" stroke-width=".15"/>']
    for led, colour in enumerate(colours):
        corners = " ".join(f"{x:.4f},{-y:.4f}" for x, y in flat.led_corners(led))
        body.append(f'<polygon points="{corners}" fill="{COLOURS[colour]}"/>')
    return _svg(body, _extent(flat))


def ring_svg(geometry: SensorGeometry, width_mm: float = STRIP_WIDTH_MM) -> str:
    """Return the section of the sensor as SVG at its true size: camera, LEDs with their axes, gel."""
    reach, height = geometry.gel_diameter_mm / 2, geometry.camera_height_mm
    gel = geometry.gel_thickness_mm
    body = [
        f'<rect x="{-reach}" y="{-gel}" width="{2 * reach}" height="{gel}" fill="#8fb8de" fill-opacity=".6"/>',
        f'<path d="M{-reach} 0V{-height - 3}M{reach} 0V{-height - 3}" stroke="currentColor" stroke-width=".3"/>',
        f'<rect x="-4" y="{-height - 4}" width="8" height="4" fill="currentColor" fill-opacity=".6"/>',
        f'<path d="M0 {-height}V0" stroke="currentColor" stroke-width=".15" stroke-dasharray="1 1"/>',
    ]
    for side, letter in ((1, geometry.led_colours[0]), (-1, geometry.led_colours[len(geometry.led_colours) // 2])):
        body += _led_in_section(geometry, side, width_mm, COLOURS[letter])
    return _svg(body, (-reach - 4, -height - 6, reach + 4, 3.0))


def _led_in_section(geometry: SensorGeometry, side: int, width_mm: float, colour: str) -> list[str]:
    tilt, r = geometry.incident_angle_rad, side * geometry.ring_radius_mm
    y = -(geometry.camera_height_mm - geometry.mounting_height_mm)
    along = (cos(tilt) * side, sin(tilt))
    edges = [(r + t * width_mm / 2 * along[0], y + t * width_mm / 2 * along[1]) for t in (-1, 1)]
    length = -y / cos(tilt)
    end = (r - side * length * sin(tilt), 0.0)
    return [
        f'<path d="M{edges[0][0]:.3f} {edges[0][1]:.3f}L{edges[1][0]:.3f} {edges[1][1]:.3f}" stroke="#f2c14e"/>',
        f'<path d="M{r} {y}L{end[0]:.3f} {end[1]}" stroke="{colour}" stroke-width=".25" stroke-dasharray="1.5 .8"/>',
        f'<circle cx="{r}" cy="{y}" r="1.2" fill="{colour}"/>',
    ]


def led_table(geometry: SensorGeometry) -> str:
    """Return the LEDs as CSV: number along the strip, colour, azimuth, position in mm, axis."""
    rows = ["led,colour,azimuth_deg,x_mm,y_mm,z_mm,axis_x,axis_y,axis_z"]
    count = len(geometry.led_colours)
    for led, (at, axis) in enumerate(zip(led_positions(geometry), led_axes(geometry), strict=True)):
        numbers = [360 * led / count, *at.tolist(), *axis.tolist()]
        rows.append(",".join([str(led), geometry.led_colours[led], *(f"{value:.5f}" for value in numbers)]))
    return "\n".join(rows) + "\n"


def _at(direction: Point, radius: float) -> str:
    return f"{direction[0] * radius:.4f} {direction[1] * radius:.4f}"


def _round(radius: float) -> str:
    return f"{radius:.4f} {radius:.4f}"


def _extent(flat: Strip) -> tuple[float, float, float, float]:
    """Left, top, right, bottom of the flat strip in the drawing (y down), with a margin of 2 mm."""
    turns = [flat.sector_rad * step / 360 for step in range(361)]
    across = [radius * cos(turn) for turn in turns for radius in (flat.inner_radius_mm, flat.outer_radius_mm)]
    down = [-radius * sin(turn) for turn in turns for radius in (flat.inner_radius_mm, flat.outer_radius_mm)]
    return min(across) - 2, min(down) - 2, max(across) + 2, max(down) + 2


def _svg(body: list[str], extent: tuple[float, float, float, float]) -> str:
    left, top, right, bottom = extent
    width, height = right - left, bottom - top
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width:.3f}mm" height="{height:.3f}mm" '
        f'viewBox="{left:.3f} {top:.3f} {width:.3f} {height:.3f}" fill="none">' + "".join(body) + "</svg>"
    )


def strip_facts(flat: Strip) -> list[tuple[str, float, str]]:
    """Return the measures of the strip: name, value, unit."""
    return [
        ("sector", degrees(flat.sector_rad), "degrees"),
        ("inner radius", flat.inner_radius_mm, "mm"),
        ("middle radius", flat.middle_radius_mm, "mm"),
        ("outer radius", flat.outer_radius_mm, "mm"),
        ("pitch of the LEDs", degrees(flat.pitch_rad), "degrees"),
        ("height of the cone", flat.rise_mm, "mm"),
    ]
