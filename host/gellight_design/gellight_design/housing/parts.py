"""The parts of the housing as solids, where they are in the sensor, and the files to print them from.

x right as in the picture, y up, z towards the camera: azimuths run anticlockwise from x. y is turned over against the
rest of GelLight, since solids want a right-handed system.
"""

from collections.abc import Mapping
from math import cos, pi, sin

from gellight_design.boards.strip import GAP_MM, TAIL_WIDTH_MM
from gellight_design.housing.measures import (
    BOARD_MM,
    CLEARANCE_MM,
    FOCUS_MM,
    HOLES_MM,
    LIP_MM,
    POST_MM,
    WALL_MM,
    Housing,
    housing,
    profiles,
)
from gellight_design.housing.solids import (
    Place,
    Solid,
    box,
    check_kernel,
    cut,
    cylinder,
    joined,
    moved,
    step_bytes,
    stl_bytes,
    turned_solid,
)
from sim_reference.geometry import SensorGeometry

SLOT_MM = TAIL_WIDTH_MM + 2.0
"""width of the slot of the tail"""
SLOT_DEEP_MM, SLOT_BACK_MM = 4.0, 0.3
"""how far the slot reaches below and above the lower edge of the strip's seat: tail and thermistor pass it"""
GLAND_MM = 12.2
"""hole of a cable gland M12 x 1.5"""
SCREW_MM, POST_RADIUS_MM = 1.7, 3.0
"""holes for self-tapping screws of 2 mm, and the posts that have them"""
PUSH_MM = 6.0
"""hole in the mould's floor through which the disc is pushed out"""
PLUG_HEAD_MM = 2.0
UP: Place = (0, 0, 1)
FOCUS_SIDE: Place = (0, 1, 0)
"""the lens is turned from there"""


def assembly(geometry: SensorGeometry, package: str = "5050", lens_mm: float = 15.0) -> dict[str, Solid]:
    """Return the parts where they are in the sensor; raises as `measures.housing` does, or without the kernel."""
    at = housing(geometry, package, lens_mm)
    check_kernel()
    turned = {name: turned_solid(profile) for name, profile in profiles(at).items()}
    return {
        "gel": turned["gel"],
        "ring": cut(turned["ring"], _slot(at, geometry)),
        "camera": cut(turned["camera"], _focus_hole(at, FOCUS_MM / 2)),
        "lid": _lid(at, turned["lid"]),
        "plug": _plug(at),
        "mould": cut(turned["mould"], cylinder((0, 0, -2 * WALL_MM), UP, PUSH_MM / 2, 3 * WALL_MM)),
    }


def housing_files(geometry: SensorGeometry, package: str = "5050", lens_mm: float = 15.0) -> dict[str, bytes | str]:
    """Return the parts as STL, each as it lies on the printer's bed, and as STEP; the sensor put together as STEP."""
    at, parts = housing(geometry, package, lens_mm), assembly(geometry, package, lens_mm)
    files: dict[str, bytes | str] = {f"{name}.stl": stl_bytes(on_bed(at, name, solid)) for name, solid in parts.items()}
    files |= {f"{name}.step": step_bytes([solid]) for name, solid in parts.items()}
    return files | {"sensor.step": step_bytes(solid for name, solid in parts.items() if name != "mould")}


def on_bed(at: Housing, name: str, solid: Solid) -> Solid:
    """Return a part as it is printed: the mould on its floor, the plug on its head, the others on the camera's side."""
    if name == "mould":
        return moved(solid, WALL_MM)
    if name == "plug":
        return moved(solid, at.outer_mm + PLUG_HEAD_MM, -pi / 2)
    tops = {"gel": at.ring_foot_mm, "ring": at.camera_foot_mm, "camera": at.lid_mm, "lid": at.lid_mm + WALL_MM}
    return moved(solid, tops[name], pi)


def stand_ins(geometry: SensorGeometry, package: str = "5050", lens_mm: float = 15.0) -> Mapping[str, Solid]:
    """Return what is bought, as simple solids where it has to be: acrylic, gel, camera board, its lens."""
    at, camera = housing(geometry, package, lens_mm), geometry.camera_height_mm
    below, above = at.acrylic_mm
    return {
        "acrylic": cylinder((0, 0, below), UP, at.radius_mm, above - below),
        "gel pad": cylinder((0, 0, 0), UP, at.radius_mm, below),
        "board": box((0, 0, at.board_mm - 0.8), (BOARD_MM, BOARD_MM, 1.6)),
        "lens": cylinder((0, 0, camera), UP, 7.0, at.board_mm - 1.6 - camera),
    }


def _slot(at: Housing, geometry: SensorGeometry) -> Solid:
    """Return what the tail needs: it leaves beside LED 0, its first edge before the LED, half a pitch away."""
    (radius, low), _ = at.seat
    azimuth = -pi / len(geometry.led_colours) + (GAP_MM + TAIL_WIDTH_MM / 2) / radius
    reach = at.outer_mm + WALL_MM - radius + WALL_MM
    middle = radius - WALL_MM + reach / 2
    bottom, top = max(low - SLOT_DEEP_MM, at.ring_foot_mm + LIP_MM / 2), low + SLOT_BACK_MM
    place = (middle * cos(azimuth), middle * sin(azimuth), (bottom + top) / 2)
    return box(place, (reach, SLOT_MM, top - bottom), (cos(azimuth), sin(azimuth), 0))


def _focus_hole(at: Housing, radius: float) -> Solid:
    return cylinder((0, 0, at.focus_mm), FOCUS_SIDE, radius, at.outer_mm + WALL_MM)


def _lid(at: Housing, plate: Solid) -> Solid:
    """Return the lid with four posts for the camera's board and the hole of the gland."""
    corners = [(x * HOLES_MM / 2, y * HOLES_MM / 2) for x in (-1, 1) for y in (-1, 1)]
    posts = [cylinder((x, y, at.board_mm), UP, POST_RADIUS_MM, POST_MM + WALL_MM / 2) for x, y in corners]
    holes = [cylinder((x, y, at.board_mm - 1), UP, SCREW_MM / 2, POST_MM) for x, y in corners]
    gland = cylinder((0, 0, at.lid_mm - 1), UP, GLAND_MM / 2, 2 * WALL_MM)
    return cut(joined(plate, *posts), *holes, gland)


def _plug(at: Housing) -> Solid:
    """Return what closes the hole of the lens, its head outside on the round wall; it lies in the sensor's place."""
    stem = cut(_focus_hole(at, FOCUS_MM / 2 - CLEARANCE_MM), cylinder((0, 0, 0), UP, at.bore_mm, 2 * at.lid_mm))
    stem = cut(stem, box((0, 1.5 * at.outer_mm + PLUG_HEAD_MM, at.focus_mm), (99, at.outer_mm, 99)))
    head = cylinder((0, 0, at.focus_mm), FOCUS_SIDE, FOCUS_MM / 2 + 1.5, at.outer_mm + PLUG_HEAD_MM)
    wall = cylinder((0, 0, 0), UP, at.outer_mm + CLEARANCE_MM, 2 * at.lid_mm)
    return joined(stem, cut(head, wall))
