"""The housing to print: four solids of revolution that hold gel, ring and camera where the geometry puts them.

A profile is a closed polygon of points (r, z) in mm: r from the axis, z from the gel surface at rest towards the
camera. Each part stands on the one before it with a tenon in a groove.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from math import cos, sin

from gellight.base.errors import InputError
from gellight.lab.design.geometry import STRIP_WIDTH_MM, check
from gellight.lab.design.parts import Point
from sim_reference.geometry import SensorGeometry
from sim_reference.optimizer.refraction import ACRYLIC_MM

WALL_MM = 3.0
TENON_MM = 3.0
"""height of a joint"""
CLEARANCE_MM = 0.15
"""between parts that are put together, for a printer with a nozzle of 0.4 mm"""
LIP_MM = 1.5
"""how far the gel module reaches over the acrylic, and how thick the lip is"""
LED_STACK_MM = 1.8
"""a WS2812B is 1.6 mm high (its data sheet), the flexible circuit 0.2 mm"""
Profile = tuple[Point, ...]


@dataclass(frozen=True)
class Housing:
    """Where the parts end; z in mm from the gel surface."""

    bore_mm: float
    """inner radius of the light module"""
    outer_mm: float
    tenon_mm: float
    """outer radius of a tenon"""
    acrylic_mm: tuple[float, float]
    """z of the two faces of the acrylic"""
    ring_foot_mm: float
    """z where the light module stands on the gel module"""
    seat: tuple[Point, Point]
    """lower outer and upper inner edge of the cone that the strip is glued to"""
    camera_foot_mm: float
    """z where the camera module stands on the light module"""
    board_mm: float
    """z of the face that the camera's board is screwed to"""


def housing(geometry: SensorGeometry, lens_mm: float = 15.0) -> Housing:
    """Return the measures of the housing; lens_mm: from the lens's entrance pupil to the camera's board.

    Raises ConfigError for a sensor that cannot be built, InputError where the ring leaves no room for the joints.
    """
    check(geometry)
    radius, tilt = geometry.gel_diameter_mm / 2, geometry.incident_angle_rad
    above_mm = geometry.camera_height_mm - geometry.mounting_height_mm
    back = (geometry.ring_radius_mm + LED_STACK_MM * sin(tilt), above_mm + LED_STACK_MM * cos(tilt))
    along = (STRIP_WIDTH_MM / 2 * cos(tilt), -STRIP_WIDTH_MM / 2 * sin(tilt))
    low, high = (back[0] + along[0], back[1] + along[1]), (back[0] - along[0], back[1] - along[1])
    bore = max(radius, low[0]) + CLEARANCE_MM
    acrylic = (geometry.gel_thickness_mm, geometry.gel_thickness_mm + ACRYLIC_MM)
    foot, top = acrylic[1] + LIP_MM + TENON_MM, high[1] + LIP_MM
    board = geometry.camera_height_mm + lens_mm
    if low[1] < foot + LIP_MM:
        raise InputError(
            f"the LEDs are {above_mm:g} mm above the gel surface, too low for a joint below them: choose "
            f"camera_height_mm - mounting_height_mm at least {above_mm + foot + LIP_MM - low[1]:.1f}"
        )
    if board < top + TENON_MM + LIP_MM:
        raise InputError(
            f"the camera's board at {board:.1f} mm lies in the ring, which ends at {top + TENON_MM:.1f} mm: choose a "
            f"lens at least {lens_mm + top + TENON_MM + LIP_MM - board:.1f} mm long or a smaller tilt of the LEDs"
        )
    return Housing(bore, bore + WALL_MM, bore + WALL_MM / 2, acrylic, foot, (low, high), top, board)


def profiles(geometry: SensorGeometry, lens_mm: float = 15.0) -> Mapping[str, Profile]:
    """Return the profile of each part by its name, `mould` included; raises as `housing` does."""
    measures, radius = housing(geometry, lens_mm), geometry.gel_diameter_mm / 2
    return {
        "gel": _gel_module(measures, radius),
        "ring": _light_module(measures),
        "camera": _camera_module(measures),
        "mould": _mould(radius + CLEARANCE_MM, measures.acrylic_mm[1]),
    }


def housing_scad(geometry: SensorGeometry, lens_mm: float = 15.0) -> str:
    """Return the parts as one OpenSCAD file, with slots for the cables; raises as `housing` does."""
    measures = housing(geometry, lens_mm)
    (_, low), (inner, high) = measures.seat
    lines = [
        "// GelLight housing, mm. Write one part as STL: openscad -D 'part=\"ring\"' -o ring.stl housing.scad",
        'part = "all";  // gel, ring, camera, mould or all',
        "slot_width = 9;  // of the tail of the LED strip, and of the camera's cable",
        "$fn = 180;",
        "",
    ]
    for name, profile in profiles(geometry, lens_mm).items():
        points = ", ".join(f"[{r:.3f}, {z:.3f}]" for r, z in profile)
        lines += [f"module {name}_solid() rotate_extrude() polygon([{points}]);"]
    lines += [
        "module slot(from, z, height) translate([from, -slot_width / 2, z]) cube([100, slot_width, height]);",
        "module gel() gel_solid();",
        f"module ring() difference() {{ ring_solid(); slot({inner:.3f}, {low:.3f}, {high - low:.3f}); }}",
        f"module camera() difference() {{ camera_solid(); slot(0, {measures.board_mm - 8:.3f}, 6); }}",
        "module mould() mould_solid();",
        'if (part == "gel" || part == "all") gel();',
        'if (part == "ring" || part == "all") ring();',
        'if (part == "camera" || part == "all") camera();',
        'if (part == "mould") mould();',
    ]
    return "\n".join(lines) + "\n"


def _gel_module(at: Housing, radius: float) -> Profile:
    """Return the ring that holds the acrylic from the side and from above; it is put on from the camera's side."""
    hole, lip, (below, above) = radius + CLEARANCE_MM, radius - LIP_MM, at.acrylic_mm
    groove, floor = at.tenon_mm + CLEARANCE_MM, at.ring_foot_mm - TENON_MM
    return (
        (hole, below),
        (at.outer_mm, below),
        (at.outer_mm, at.ring_foot_mm),
        (groove, at.ring_foot_mm),
        (groove, floor),
        (lip, floor),
        (lip, above),
        (hole, above),
    )


def _light_module(at: Housing) -> Profile:
    """Return the ring with the cone for the strip, its tenon below and a groove above."""
    low, high = at.seat
    groove, foot, top = at.tenon_mm + CLEARANCE_MM, at.ring_foot_mm, at.camera_foot_mm
    return (
        (at.bore_mm, foot - TENON_MM),
        (at.tenon_mm, foot - TENON_MM),
        (at.tenon_mm, foot),
        (at.outer_mm, foot),
        (at.outer_mm, top + TENON_MM),
        (groove, top + TENON_MM),
        (groove, top),
        (high[0], top),
        high,
        low,
        (at.bore_mm, low[1]),
    )


def _camera_module(at: Housing) -> Profile:
    """Return the cap that carries the camera's board on the inside of its floor."""
    foot = at.camera_foot_mm + TENON_MM
    return (
        (at.bore_mm, at.camera_foot_mm),
        (at.tenon_mm, at.camera_foot_mm),
        (at.tenon_mm, foot),
        (at.outer_mm, foot),
        (at.outer_mm, at.board_mm + WALL_MM),
        (0.0, at.board_mm + WALL_MM),
        (0.0, at.board_mm),
        (at.bore_mm, at.board_mm),
    )


def _mould(hole: float, depth: float) -> Profile:
    """Return the cup that the gel is cast in: the acrylic lies on its floor, the gel is level with its rim."""
    outer = hole + WALL_MM
    return (0.0, -WALL_MM), (outer, -WALL_MM), (outer, depth), (hole, depth), (hole, 0.0), (0.0, 0.0)
