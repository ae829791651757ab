"""The housing as solids, judged on the STL files that another library reads, and by the kernel's own volumes."""

import io
from itertools import combinations
from math import cos, pi, radians, sin
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from gellight_design.boards.strip import TAIL_WIDTH_MM, strip_board
from gellight_design.housing.measures import CLEARANCE_MM, FLEX_MM, housing
from gellight_design.housing.parts import assembly, housing_files, stand_ins
from gellight_design.housing.solids import Solid, box, stl_bytes, turned_solid
from sim_reference.geometry import SensorGeometry, led_axes, led_positions
from tests.helpers.boards import rolled_up
from tests.helpers.children import gellight

pytestmark = pytest.mark.nightly
Array = NDArray[np.float64]
GEOMETRIES = {
    "default": (SensorGeometry(), "5050"),
    "steep": (SensorGeometry(incident_angle_rad=radians(60), ring_radius_mm=22.0, mounting_height_mm=18.0), "5050"),
    "large": (
        SensorGeometry(
            gel_diameter_mm=60.0, gel_thickness_mm=3.0, ring_radius_mm=25.0, camera_height_mm=50.0,
            led_colours="RRRRRRRRGGGGGGGGBBBBBBBB",
        ),
        "2020",
    ),
}  # fmt: skip


@pytest.fixture(scope="module", params=GEOMETRIES)
def sensor(request: pytest.FixtureRequest) -> tuple[SensorGeometry, str, dict[str, Any]]:
    geometry, package = GEOMETRIES[request.param]
    return geometry, package, assembly(geometry, package)


def mesh(data: bytes) -> Any:
    import trimesh

    read = trimesh.load(io.BytesIO(data), file_type="stl")
    assert isinstance(read, trimesh.Trimesh)
    return read


def volume_mm3(solid: Solid) -> float:
    from OCP.BRepGProp import BRepGProp
    from OCP.GProp import GProp_GProps

    found = GProp_GProps()
    BRepGProp.VolumeProperties_s(solid, found)
    return float(found.Mass())


def shared_mm3(first: Solid, second: Solid) -> float:
    from OCP.BRepAlgoAPI import BRepAlgoAPI_Common

    return volume_mm3(BRepAlgoAPI_Common(first, second).Shape())


def test_every_part_is_watertight_and_says_its_volume(sensor: tuple[SensorGeometry, str, dict[str, Any]]) -> None:
    for name, solid in sensor[2].items():
        part = mesh(stl_bytes(solid))
        assert part.is_watertight, name
        assert part.is_winding_consistent, name
        assert part.body_count == 1, name
        assert part.volume == pytest.approx(volume_mm3(solid), rel=2e-3), name


def leds(geometry: SensorGeometry, package: str) -> dict[str, Any]:
    """The strip on its cone, its LEDs and the tail with the thermistor, as they come from the drawing."""
    at, tilt = housing(geometry, package), geometry.incident_angle_rad
    side, height = (5.0, 1.6) if package == "5050" else (2.2, 0.84)
    (r0, z0), (r1, z1) = at.seat
    down = np.array([-sin(tilt), -cos(tilt)])  # (r, z) into the sensor
    strip = [(r, z) for r, z in ((r1, z1), (r1 + FLEX_MM * down[0], z1 + FLEX_MM * down[1]),
                                 (r0 + FLEX_MM * down[0], z0 + FLEX_MM * down[1]), (r0, z0))]  # fmt: skip
    found = {"strip": turned_solid(strip)}
    mirror = np.array([1, -1, 1])
    for n, (place, axis) in enumerate(zip(led_positions(geometry) * mirror, led_axes(geometry) * mirror, strict=True)):
        azimuth = np.arctan2(place[1], place[0])
        middle = place - axis * (height / 2 + 1e-3)
        found[f"LED {n}"] = box(tuple(middle), (side, side, height), (-sin(azimuth), cos(azimuth), 0), tuple(axis))
    return found | {"tail": tail(geometry, package)}


def tail(geometry: SensorGeometry, package: str) -> Any:
    """The tail where it crosses the wall, bent down no more than the cone: from the seat's edge outwards."""
    at, tilt = housing(geometry, package), min(geometry.incident_angle_rad, radians(30))
    (radius, low), _ = at.seat
    azimuth = -pi / len(geometry.led_colours) + TAIL_WIDTH_MM / 2 / radius
    out = np.array([cos(azimuth) * cos(tilt), sin(azimuth) * cos(tilt), -sin(tilt)])
    normal = np.array([cos(azimuth) * sin(tilt), sin(azimuth) * sin(tilt), cos(tilt)])
    thick = FLEX_MM + 0.95  # the thermistor, a part of 0603, on the side of the LEDs
    start = np.array([radius * cos(azimuth), radius * sin(azimuth), low])
    middle = start + out * 4.5 - normal * (thick / 2 + 0.02)
    return box(tuple(middle), (8.0, TAIL_WIDTH_MM, thick), tuple(out), tuple(normal))


def test_nothing_collides(sensor: tuple[SensorGeometry, str, dict[str, Any]]) -> None:
    geometry, package, parts = sensor
    there = {name: solid for name, solid in parts.items() if name != "mould"} | dict(stand_ins(geometry, package))
    inside = leds(geometry, package)
    pairs = [*combinations(there, 2), *((name, other) for name in there for other in inside)]
    every = there | inside
    assert {pair: shared for pair in pairs if (shared := shared_mm3(every[pair[0]], every[pair[1]])) > 1e-3} == {}


def test_the_slot_is_where_the_strip_has_its_tail(sensor: tuple[SensorGeometry, str, dict[str, Any]]) -> None:
    """The thermistor on the tail, rolled up with the strip, lies in the slot; opposite is wall."""
    geometry, package, parts = sensor
    board = strip_board(geometry, package)
    flat = np.array(next(part.at for part in board.parts if part.reference == "TH1"))
    x, y_down, _ = rolled_up(flat, geometry)
    at = housing(geometry, package)
    wall, z = (at.bore_mm + at.outer_mm) / 2, at.seat[0][1] - 1.5
    for azimuth, free in ((np.arctan2(-y_down, x), True), (np.arctan2(-y_down, x) + pi, False)):
        inside = shared_mm3(parts["ring"], box((wall * cos(azimuth), wall * sin(azimuth), z), (1, 1, 1)))
        assert (inside < 1e-6) == free


def hits(part: Any, starts: Array, ends: Array) -> NDArray[np.bool_]:
    """Which of the ways from starts to ends, (N, 3) each, a part stands in (Moeller and Trumbore, 1997)."""
    corner, right, up = part.triangles[:, 0], *np.diff(part.triangles, axis=1).transpose(1, 0, 2)
    up = right + up
    found = np.zeros(len(starts), bool)
    for n, (start, way) in enumerate(zip(starts, ends - starts, strict=True)):
        side = np.cross(way, up)
        scale = np.einsum("ij,ij->i", right, side)
        with np.errstate(divide="ignore", invalid="ignore"):
            u = ((start - corner) * side).sum(axis=1) / scale
            turned = np.cross(start - corner, right)
            v, t = turned @ way / scale, (up * turned).sum(axis=1) / scale
            found[n] = bool(((u > 0) & (v > 0) & (u + v < 1) & (t > 1e-6) & (t < 1 - 1e-6)).any())
    return found


def view(geometry: SensorGeometry, steps: int = 9) -> Array:
    """Points of the view on the gel, to its corners; where the gel ends before, up to a mm inside its edge."""
    half = np.array(geometry.image_shape[::-1]) * geometry.pixel_size_mm / 2
    x, y = np.meshgrid(*(np.linspace(-1, 1, steps) * one for one in half))
    points = np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], axis=1)
    return points[np.hypot(points[:, 0], points[:, 1]) < geometry.gel_diameter_mm / 2 - 1]


def test_the_camera_sees_the_whole_view(sensor: tuple[SensorGeometry, str, dict[str, Any]]) -> None:
    geometry, package, parts = sensor
    points = view(geometry)
    pupil = np.broadcast_to([0, 0, geometry.camera_height_mm], points.shape)
    obstacles = parts | leds(geometry, package)
    for name in ("gel", "ring", "camera", "strip", *(name for name in obstacles if name.startswith("LED"))):
        assert not hits(mesh(stl_bytes(obstacles[name])), points, pupil).any(), name


def test_every_led_lights_the_whole_view(sensor: tuple[SensorGeometry, str, dict[str, Any]]) -> None:
    """From the middle of each LED to the view; a straight way lies higher than the one that acrylic and gel bend."""
    geometry, _, parts = sensor
    points, mirror = view(geometry, 5), np.array([1, -1, 1])
    for place, axis in zip(led_positions(geometry) * mirror, led_axes(geometry) * mirror, strict=True):
        lit = points[(points - place) @ axis > 0]
        assert len(lit) > len(points) / 2
        starts = np.broadcast_to(place, lit.shape)
        for name in ("gel", "ring", "camera"):
            assert not hits(mesh(stl_bytes(parts[name])), starts, lit).any(), name


@pytest.mark.parametrize("name", ["gel", "ring", "camera", "lid", "plug", "mould"])
def test_it_prints_without_support(name: str) -> None:
    """Lying as in its STL, no face looks down by more than 45 degrees but on the bed, and two roofs.

    Those are bridges of 9 mm over the slot of the tail, and the upper quarter of the round hole for the lens.
    """
    part = mesh(bytes(housing_files(SensorGeometry())[f"{name}.stl"]))  # type: ignore[arg-type]
    assert part.bounds[0, 2] == pytest.approx(0, abs=1e-3)
    middle = part.triangles_center[:, 2]
    hanging = (part.face_normals[:, 2] < -cos(radians(44.5))) & (middle > 0.05)
    allowed = {"ring": 28.0, "camera": 34.0}.get(name, 0.0)
    assert part.area_faces[hanging].sum() < allowed + 0.1, "mm2"


def test_the_plug_has_its_play(sensor: tuple[SensorGeometry, str, dict[str, Any]]) -> None:
    geometry, package, parts = sensor
    at = housing(geometry, package)
    wall, plug = mesh(stl_bytes(parts["camera"])), mesh(stl_bytes(parts["plug"]))
    for part, radius in ((wall, 7.0), (plug, 7.0 - CLEARANCE_MM)):
        corners = part.vertices[(part.vertices[:, 1] > at.bore_mm / 2) & (part.vertices[:, 1] < at.outer_mm - 0.2)]
        from_axis = np.hypot(corners[:, 0], corners[:, 2] - at.focus_mm)
        assert from_axis[from_axis < 8].max() == pytest.approx(radius, abs=0.02)


def test_the_verb_writes_every_part_and_nothing_of_one_that_cannot_be(tmp_path: Path) -> None:
    done = gellight("optimize", "make", "housing", "--out", tmp_path / "housing")
    assert done.returncode == 0, done.stderr
    names = {"gel", "ring", "camera", "lid", "plug", "mould"}
    wanted = {f"{name}.{kind}" for name in names for kind in ("stl", "step")} | {"sensor.step"}
    assert {path.name for path in (tmp_path / "housing").iterdir()} == wanted
    assert (tmp_path / "housing/sensor.step").read_bytes().startswith(b"ISO-10303-21;")
    (tmp_path / "mine.toml").write_text("[geometry]\nmounting_height_mm = 30.0\n")
    done = gellight("optimize", "make", "housing", "--out", tmp_path / "none", "--geometry", tmp_path / "mine.toml")
    assert done.returncode == 2
    assert "too low for a joint" in " ".join(done.stderr.split())
    assert not (tmp_path / "none").exists()
