"""Where the parts of the housing end, and their profiles.

A profile is a closed polygon of points (r, z) in mm: r from the axis, z from the gel surface at rest towards the
camera. Each part carries a spigot for the one above it. Printed with the camera's side on the bed, nothing hangs over
by more than 45 degrees: steps outwards are cones.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from math import cos, hypot, radians, sin, tan

from gellight.base.errors import InputError
from gellight_design.boards.catalogue import find_lamp
from gellight_design.parts import Point
from gellight_design.simulating.geometry_file import STRIP_WIDTH_MM, check
from sim_reference.geometry import ACRYLIC_MM, SensorGeometry

WALL_MM = 3.0
SPIGOT_MM = 3.0
"""height of a joint"""
CLEARANCE_MM = 0.15
"""between parts that are put together, for a printer with a nozzle of 0.4 mm"""
LIP_MM = 1.5
"""how far the gel module reaches over the acrylic, and how thick the lip is"""
FLEX_MM = 0.2
"""of the strip"""
DRAFT_RAD = radians(2)
"""of the mould's wall beside the gel"""
BOARD_MM, HOLES_MM = 32.0, 28.0
"""side of the camera's board, and between its holes: the square pattern of many USB cameras"""
POST_MM = 10.0
"""from the camera's board to the lid, for its plug and the nut of the cable gland"""
FOCUS_MM = 14.0
"""diameter of the hole through which the lens is turned"""
Profile = tuple[Point, ...]


@dataclass(frozen=True)
class Housing:
    """Where the parts end; z in mm from the gel surface."""

    radius_mm: float
    """of gel and acrylic"""
    bore_mm: float
    """inner radius of the light module"""
    outer_mm: float
    spigot_mm: float
    """outer radius of a spigot"""
    acrylic_mm: tuple[float, float]
    """z of the two faces of the acrylic"""
    ring_foot_mm: float
    """z where the light module stands on the spigot of the gel module"""
    seat: tuple[Point, Point]
    """lower outer and upper inner edge of the cone that the strip is glued to"""
    camera_foot_mm: float
    """z where the camera module stands on the spigot of the light module"""
    board_mm: float
    """z of the face that the camera's board is screwed to"""
    focus_mm: float
    """z of the middle of the hole through which the lens is turned"""

    @property
    def lid_mm(self) -> float:
        """Z of the lid's inner face, on which the camera module ends."""
        return self.board_mm + POST_MM


def housing(geometry: SensorGeometry, package: str = "5050", lens_mm: float = 15.0) -> Housing:
    """Return the measures of the housing; lens_mm: from the lens's entrance pupil to behind the camera's board.

    Raises ConfigError for a sensor that cannot be built, InputError where the ring leaves no room for the joints or the
    housing none for the camera.
    """
    check(geometry)
    radius, tilt = geometry.gel_diameter_mm / 2, geometry.incident_angle_rad
    stack = find_lamp(package).height_mm + FLEX_MM
    above_mm = geometry.camera_height_mm - geometry.mounting_height_mm
    back = (geometry.ring_radius_mm + stack * sin(tilt), above_mm + stack * cos(tilt))
    along = (STRIP_WIDTH_MM / 2 * cos(tilt), -STRIP_WIDTH_MM / 2 * sin(tilt))
    low, high = (back[0] + along[0], back[1] + along[1]), (back[0] - along[0], back[1] - along[1])
    bore = max(radius, low[0]) + CLEARANCE_MM
    acrylic = (geometry.gel_thickness_mm, geometry.gel_thickness_mm + ACRYLIC_MM)
    foot, top = acrylic[1] + LIP_MM + SPIGOT_MM, high[1] + LIP_MM + SPIGOT_MM
    board = geometry.camera_height_mm + lens_mm
    focus = max(geometry.camera_height_mm + lens_mm / 3, top + LIP_MM + FOCUS_MM / 2)
    at = Housing(
        radius, bore, bore + WALL_MM, bore + WALL_MM / 2, acrylic, foot, (low, high), top, board, focus
    )  # fmt: skip
    _check_room(at, above_mm, lens_mm)
    return at


def _check_room(at: Housing, above_mm: float, lens_mm: float) -> None:
    short = at.ring_foot_mm + LIP_MM - at.seat[0][1]
    if short > 0:
        raise InputError(
            f"the LEDs are {above_mm:g} mm above the gel surface, too low for a joint below them: choose "
            f"camera_height_mm - mounting_height_mm at least {above_mm + short:.1f}"
        )
    short = at.focus_mm + FOCUS_MM / 2 - at.board_mm - POST_MM / 2
    if short > 0:
        raise InputError(
            f"the camera's board at {at.board_mm:.1f} mm lies too near to the ring, which ends at "
            f"{at.camera_foot_mm:.1f} mm: choose a lens at least {lens_mm + short:.1f} mm long or a smaller tilt of "
            "the LEDs"
        )
    needed = hypot(BOARD_MM, BOARD_MM) / 2 + CLEARANCE_MM
    if at.bore_mm < needed:
        raise InputError(
            f"the camera's board, a square of {BOARD_MM:g} mm, does not go into a bore of {2 * at.bore_mm:.1f} mm: "
            f"choose gel_diameter_mm at least {2 * (needed - CLEARANCE_MM):.1f}"
        )


def profiles(at: Housing) -> Mapping[str, Profile]:
    """Return the profile of each part that is turned, by its name, anticlockwise."""
    return {
        "gel": _gel_module(at),
        "ring": _light_module(at),
        "camera": _camera_module(at),
        "lid": _lid(at),
        "mould": _mould(at),
    }


def _spigot(at: Housing, foot: float) -> Profile:
    """Return the outside of a part up to the top of its spigot: a cone of 45 degrees, then the spigot."""
    step = at.outer_mm - at.spigot_mm
    return (at.outer_mm, foot - SPIGOT_MM - step), (at.spigot_mm, foot - SPIGOT_MM), (at.spigot_mm, foot)


def _socket(at: Housing, foot: float) -> Profile:
    """Return the lower end of a part that stands on a spigot: from its inside to its outside.

    It stands on the top of the spigot; beside that and at the cone it keeps the clearance.
    """
    beside = at.spigot_mm + CLEARANCE_MM
    gap = CLEARANCE_MM * 2**0.5
    return (
        (at.bore_mm, foot),
        (beside, foot),
        (beside, foot - SPIGOT_MM - CLEARANCE_MM + gap),
        (at.outer_mm, foot - SPIGOT_MM - at.outer_mm + at.spigot_mm + gap),
    )


def _gel_module(at: Housing) -> Profile:
    """Return the ring that holds the acrylic from the side and from above; it is put on from the camera's side."""
    hole, lip, (below, above) = at.radius_mm + CLEARANCE_MM, at.radius_mm - LIP_MM, at.acrylic_mm
    foot = at.ring_foot_mm
    return (hole, below), (at.outer_mm, below), *_spigot(at, foot), (lip, foot), (lip, above), (hole, above)


def _light_module(at: Housing) -> Profile:
    """Return the ring with the cone for the strip, a socket below and a spigot above."""
    low, high = at.seat
    top = at.camera_foot_mm
    return *_socket(at, at.ring_foot_mm), *_spigot(at, top), (high[0], top), high, low, (at.bore_mm, low[1])


def _camera_module(at: Housing) -> Profile:
    """Return the tube between light module and lid."""
    return *_socket(at, at.camera_foot_mm), (at.outer_mm, at.lid_mm), (at.bore_mm, at.lid_mm)


def _lid(at: Housing) -> Profile:
    """Return the lid with its rim, which goes into the tube."""
    rim, low, top = at.bore_mm - CLEARANCE_MM, at.lid_mm - SPIGOT_MM, at.lid_mm + WALL_MM
    inner = rim - WALL_MM / 2
    return (
        (0.0, at.lid_mm),
        (inner, at.lid_mm),
        (inner, low),
        (rim, low),
        (rim, at.lid_mm),
        (at.outer_mm, at.lid_mm),
        (at.outer_mm, top),
        (0.0, top),
    )


def _mould(at: Housing) -> Profile:
    """Return the cup that the gel is cast in: the acrylic lies on its floor, the gel is level with its rim."""
    hole, gel = at.radius_mm + CLEARANCE_MM, at.acrylic_mm[0]
    disc, depth = at.acrylic_mm[1] - gel, at.acrylic_mm[1]
    rim = hole + gel * tan(DRAFT_RAD)
    outer = rim + WALL_MM
    return (0.0, -WALL_MM), (outer, -WALL_MM), (outer, depth), (rim, depth), (hole, disc), (hole, 0.0), (0.0, 0.0)
