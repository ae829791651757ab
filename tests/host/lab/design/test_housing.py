"""The housing: it holds what the geometry says, its parts fit, and the camera sees past them."""

from dataclasses import replace
from itertools import pairwise
from math import pi, radians
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from gellight.base.errors import InputError
from gellight.lab.design.housing import CLEARANCE_MM, LED_STACK_MM, TENON_MM, Profile, housing, housing_scad, profiles
from sim_reference.geometry import SensorGeometry, led_axes, led_positions
from tests.helpers.children import gellight

GEOMETRIES = [
    SensorGeometry(),
    SensorGeometry(incident_angle_rad=radians(60), ring_radius_mm=22.0, mounting_height_mm=18.0),
    SensorGeometry(gel_diameter_mm=60.0, gel_thickness_mm=3.0, ring_radius_mm=25.0, camera_height_mm=50.0),
]


def twice_area(profile: Profile) -> float:
    closed = [*profile, profile[0]]
    return sum(r0 * z1 - r1 * z0 for (r0, z0), (r1, z1) in pairwise(closed))


def crosses(profile: Profile, at_z: float) -> list[float]:
    """Return the radii at which a profile is cut at a height, from inside to outside."""
    closed = [*profile, profile[0]]
    cuts = [
        r0 + (r1 - r0) * (at_z - z0) / (z1 - z0)
        for (r0, z0), (r1, z1) in pairwise(closed)
        if (z0 > at_z) != (z1 > at_z)
    ]
    return sorted(cuts)


@pytest.mark.parametrize("geometry", GEOMETRIES)
def test_leds_on_the_cone_are_where_the_geometry_says(geometry: SensorGeometry) -> None:
    low, high = (np.array(edge) for edge in housing(geometry).seat)
    place: NDArray[np.float64] = led_positions(geometry)[0]
    axis: NDArray[np.float64] = led_axes(geometry)[0]
    # LED 0 is at azimuth 0, so (x, z) is (r, z); its light leaves LED_STACK_MM in front of the cone, along its axis.
    assert (low + high) / 2 + LED_STACK_MM * axis[[0, 2]] == pytest.approx(place[[0, 2]])
    assert (high - low) @ axis[[0, 2]] == pytest.approx(0, abs=1e-12)


@pytest.mark.parametrize("geometry", GEOMETRIES)
def test_parts_are_closed_fit_and_do_not_touch_but_at_their_faces(geometry: SensorGeometry) -> None:
    parts, at = profiles(geometry), housing(geometry)
    assert all(twice_area(profile) > 0 for profile in parts.values()), "anticlockwise, so solid and not a hole"
    for lower, upper, foot in (("gel", "ring", at.ring_foot_mm - TENON_MM), ("ring", "camera", at.camera_foot_mm)):
        for height in np.linspace(foot + 0.01, foot + TENON_MM - 0.01, 7):
            groove, tenon = crosses(parts[lower], height)[0], crosses(parts[upper], height)[-1]
            assert groove - tenon == pytest.approx(CLEARANCE_MM), "the tenon stands in the groove"


@pytest.mark.parametrize("geometry", GEOMETRIES)
def test_the_camera_sees_the_whole_view_past_every_part(geometry: SensorGeometry) -> None:
    corner = np.hypot(*(count * geometry.pixel_size_mm / 2 for count in geometry.image_shape))
    corner = min(corner, geometry.gel_diameter_mm / 2 - 1.5)  # what lies beyond the gel is hidden by its holder
    for name in ("gel", "ring"):
        for height in np.arange(geometry.gel_thickness_mm + 0.01, geometry.camera_height_mm, 0.25):
            cut = crosses(profiles(geometry)[name], height)
            seen = corner * (geometry.camera_height_mm - height) / geometry.camera_height_mm
            assert not cut or cut[0] > seen, (name, height)


def test_the_mould_holds_the_acrylic_and_the_gel_up_to_its_rim() -> None:
    geometry = SensorGeometry()
    mould = profiles(geometry)["mould"]
    inside = crosses(mould, 4.0)[0]
    assert inside == pytest.approx(25.0 + CLEARANCE_MM)
    assert max(z for _, z in mould) == pytest.approx(3.0 + geometry.gel_thickness_mm)
    volume = pi * inside**2 * (3.0 + geometry.gel_thickness_mm)
    assert volume / 1000 == pytest.approx(15.9, abs=0.1), "ml of acrylic and gel, as docs/build.md says"


def test_a_ring_without_room_for_the_joints_is_refused_with_the_nearest_that_works() -> None:
    with pytest.raises(InputError, match=r"at least 1\d\.\d"):
        housing(SensorGeometry(mounting_height_mm=30.0))
    with pytest.raises(InputError, match="lens"):
        housing(replace(SensorGeometry(), mounting_height_mm=1.0), lens_mm=3.0)


def test_the_verb_writes_every_part(tmp_path: Path) -> None:
    done = gellight("optimize", "parts", "--out", tmp_path)
    assert done.returncode == 0, done.stderr
    names = {path.name for path in tmp_path.iterdir()}
    assert names == {"gellight.toml", "strip.dxf", "strip.svg", "ring.svg", "leds.csv", "housing.scad"}
    text = (tmp_path / "housing.scad").read_text()
    assert text == housing_scad(SensorGeometry())
    assert text.count("rotate_extrude") == 4
