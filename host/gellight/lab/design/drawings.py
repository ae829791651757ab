"""Drawings of the parts as SVG at their true size: the flat strip, and the ring in section and from the camera."""

from math import cos, degrees, pi, sin

import numpy as np

from gellight.lab.design.geometry import STRIP_WIDTH_MM
from gellight.lab.design.parts import LED_SIDE_MM, Point, Strip
from sim_reference.geometry import ACRYLIC_MM, SensorGeometry, led_positions

COLOURS = {"R": "#d6453d", "G": "#3a9d5d", "B": "#3b6fd4"}
LETTER_MM = 2.4
Extent = tuple[float, float, float, float]
"""left, top, right, bottom in mm, y down"""


def strip_svg(flat: Strip, colours: str) -> str:
    """Return the flat strip seen from the LED side; LEDs are numbered along the data line."""
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
        x, y = flat.led_centre(led)
        body.append(f'<polygon points="{corners}" fill="{COLOURS[colour]}"/>')
        body.append(_text(x, -y, str(led), "#fff"))
    lines = [
        "seen from the LED side; LED 0 is the first on the data line",
        f"sector {degrees(flat.sector_rad):.3f}°, pitch {degrees(flat.pitch_rad):.3f}°",
        f"radii {flat.inner_radius_mm:.3f}, {flat.middle_radius_mm:.3f}, {flat.outer_radius_mm:.3f} mm",
    ]
    left, top, right, bottom = _extent(flat)
    middle = (left + right) / 2
    body += [_text(middle, bottom + 2 + 3.2 * row, line) for row, line in enumerate(lines)]
    half = max(right - left, 72.0) / 2
    return _svg(body, (middle - half, top, middle + half, bottom + 3.5 * len(lines)))


def ring_svg(geometry: SensorGeometry, width_mm: float = STRIP_WIDTH_MM) -> str:
    """Return a section of the sensor with its dimensions in mm, and beside it the ring as the camera sees it."""
    reach, height = geometry.gel_diameter_mm / 2, geometry.camera_height_mm
    apart = 2 * reach + 30
    body = [*_section(geometry, width_mm), *_dimensions(geometry), *_from_the_camera(geometry, apart, -height / 2)]
    top = min(-height - 9, -height / 2 - reach - 7)
    return _svg(body, (-reach - 14, top, apart + reach + 6, max(12.0, reach - height / 2 + 7)))


def _section(geometry: SensorGeometry, width_mm: float) -> list[str]:
    reach, height, gel = geometry.gel_diameter_mm / 2, geometry.camera_height_mm, geometry.gel_thickness_mm
    opposite = geometry.led_colours[len(geometry.led_colours) // 2]
    return [
        f'<rect x="{-reach}" y="{-gel}" width="{2 * reach}" height="{gel}" fill="#8fb8de" fill-opacity=".6"/>',
        f'<rect x="{-reach}" y="{-gel - ACRYLIC_MM}" width="{2 * reach}" height="{ACRYLIC_MM}" fill="#8fb8de" '
        'fill-opacity=".25"/>',
        _text(0, -gel / 2, f"gel {gel:g}"),
        _text(0, -gel - ACRYLIC_MM / 2, f"acrylic {ACRYLIC_MM:g}"),
        f'<path d="M{-reach} 0V{-height - 3}M{reach} 0V{-height - 3}" stroke="currentColor" stroke-width=".3"/>',
        f'<rect x="-5" y="{-height - 4}" width="10" height="4" fill="currentColor" fill-opacity=".6"/>',
        _text(0, -height - 6, "camera"),
        f'<path d="M0 {-height}V{-gel - ACRYLIC_MM}" stroke="currentColor" stroke-width=".1" stroke-dasharray="1 1"/>',
        *_led_in_section(geometry, 1, width_mm, COLOURS[geometry.led_colours[0]]),
        *_led_in_section(geometry, -1, width_mm, COLOURS[opposite]),
    ]


def _dimensions(geometry: SensorGeometry) -> list[str]:
    reach, height = geometry.gel_diameter_mm / 2, geometry.camera_height_mm
    above, r = height - geometry.mounting_height_mm, geometry.ring_radius_mm
    return [
        *_dimension((-reach, 4), (reach, 4), f"housing ⌀ {2 * reach:g} mm"),
        *_dimension((0, 8.5), (r, 8.5), f"r {r:.5g}"),
        *_dimension((reach + 4, -height), (reach + 4, -above), f"{geometry.mounting_height_mm:.4g}"),
        *_dimension((reach + 4, -above), (reach + 4, 0), f"{above:.4g}"),
        *_dimension((-reach - 4, -height), (-reach - 4, 0), f"{height:.4g}", beside=-4.5),
        _text(r - 7, -above - 3.5, f"tilt {degrees(geometry.incident_angle_rad):.1f}°"),
    ]


def _led_in_section(geometry: SensorGeometry, side: int, width_mm: float, colour: str) -> list[str]:
    tilt, r = geometry.incident_angle_rad, side * geometry.ring_radius_mm
    y = -(geometry.camera_height_mm - geometry.mounting_height_mm)
    along = (cos(tilt) * side, sin(tilt))
    edges = [(r + t * width_mm / 2 * along[0], y + t * width_mm / 2 * along[1]) for t in (-1, 1)]
    length = -y / cos(tilt)
    if length * sin(tilt) > 2 * geometry.ring_radius_mm:
        length = 2 * geometry.ring_radius_mm / sin(tilt)
    end = (r - side * length * sin(tilt), y + length * cos(tilt))
    return [
        f'<path d="M{edges[0][0]:.3f} {edges[0][1]:.3f}L{edges[1][0]:.3f} {edges[1][1]:.3f}" stroke="#f2c14e"/>',
        f'<path d="M{r} {y}L{end[0]:.3f} {end[1]:.3f}" stroke="{colour}" stroke-width=".25" '
        'stroke-dasharray="1.5 .8"/>',
        f'<circle cx="{r}" cy="{y}" r="1.2" fill="{colour}"/>',
    ]


def _from_the_camera(geometry: SensorGeometry, x: float, y: float) -> list[str]:
    """Return the ring as the camera sees it, centred at (x, y): LED 0 at the right, then anticlockwise."""
    rows, columns = (count * geometry.pixel_size_mm for count in geometry.image_shape)
    body = [
        f'<circle cx="{x}" cy="{y}" r="{geometry.gel_diameter_mm / 2}" stroke="currentColor" stroke-width=".3"/>',
        f'<rect x="{x - columns / 2}" y="{y - rows / 2}" width="{columns}" height="{rows}" stroke="currentColor" '
        'stroke-width=".15" stroke-dasharray="1 1"/>',
        _text(x, y - 1.5, "as the camera sees it"),
        _text(x, y + 1.5, f"view {columns:.1f} × {rows:.1f} mm"),
    ]
    side = min(LED_SIDE_MM, 4 * geometry.ring_radius_mm / len(geometry.led_colours))
    for led, (led_x, led_y, _) in enumerate(led_positions(geometry).tolist()):
        corner = f'x="{x + led_x - side / 2:.3f}" y="{y + led_y - side / 2:.3f}"'
        turn = -360 * led / len(geometry.led_colours)
        body.append(
            f'<rect {corner} width="{side}" height="{side}" fill="{COLOURS[geometry.led_colours[led]]}" '
            f'transform="rotate({turn:.3f} {x + led_x:.3f} {y + led_y:.3f})"/>'
        )
        body.append(_text(x + led_x, y + led_y, str(led), "#fff"))
    return body


def _dimension(start: Point, end: Point, label: str, beside: float = 4.5) -> list[str]:
    """Return a horizontal or vertical dimension line with ticks at its ends and its label beside it."""
    upright = start[0] == end[0]
    tick = "m-1 0h2" if upright else "m0 -1v2"
    middle = ((start[0] + end[0]) / 2 + beside * upright, (start[1] + end[1]) / 2 + (0 if upright else 2.2))
    ends = f"M{start[0]} {start[1]}{tick}M{end[0]} {end[1]}{tick}"
    line = f'<path d="M{start[0]} {start[1]}L{end[0]} {end[1]}{ends}" stroke="currentColor" stroke-width=".15"/>'
    return [line, _text(*middle, label)]


def _text(x: float, y: float, text: str, colour: str = "currentColor") -> str:
    return (
        f'<text x="{x:.3f}" y="{y + LETTER_MM / 3:.3f}" fill="{colour}" text-anchor="middle" '
        f'style="font:{LETTER_MM}px system-ui,sans-serif">{text}</text>'
    )


def _at(direction: Point, radius: float) -> str:
    return f"{direction[0] * radius:.4f} {direction[1] * radius:.4f}"


def _round(radius: float) -> str:
    return f"{radius:.4f} {radius:.4f}"


def _extent(flat: Strip) -> Extent:
    """Return the bounding box of the flat strip with a margin of 2 mm."""
    edge = np.exp(-1j * np.linspace(0, flat.sector_rad, 361))
    edges = np.concatenate([radius * edge for radius in (flat.inner_radius_mm, flat.outer_radius_mm)])
    return edges.real.min() - 2, edges.imag.min() - 2, edges.real.max() + 2, edges.imag.max() + 2


def _svg(body: list[str], extent: Extent) -> str:
    left, top, right, bottom = extent
    width, height = right - left, bottom - top
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width:.3f}mm" height="{height:.3f}mm" '
        f'viewBox="{left:.3f} {top:.3f} {width:.3f} {height:.3f}" fill="none">' + "".join(body) + "</svg>"
    )
