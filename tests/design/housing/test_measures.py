"""The measures of the housing: it holds what the geometry says, and its joints have the play that is said."""

import sys
from dataclasses import replace
from itertools import pairwise
from math import pi, radians, tan

import numpy as np
import pytest
from numpy.typing import NDArray

from gellight.base.errors import InputError
from gellight_design.housing.measures import Profile, housing, profiles
from gellight_design.housing.parts import housing_files
from sim_reference.geometry import SensorGeometry, led_axes, led_positions

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


@pytest.mark.parametrize(("package", "stack"), [("5050", 1.8), ("2020", 1.04)])
@pytest.mark.parametrize("geometry", GEOMETRIES)
def test_leds_on_the_cone_are_where_the_geometry_says(geometry: SensorGeometry, package: str, stack: float) -> None:
    low, high = (np.array(edge) for edge in housing(geometry, package).seat)
    place: NDArray[np.float64] = led_positions(geometry)[0]
    axis: NDArray[np.float64] = led_axes(geometry)[0]
    # LED 0 is at azimuth 0, so (x, z) is (r, z); its light leaves the stack of LED and strip in front of the cone.
    assert (low + high) / 2 + stack * axis[[0, 2]] == pytest.approx(place[[0, 2]])
    assert (high - low) @ axis[[0, 2]] == pytest.approx(0, abs=1e-12)


@pytest.mark.parametrize("geometry", GEOMETRIES)
def test_profiles_are_solid_and_the_joints_have_their_play(geometry: SensorGeometry) -> None:
    at = housing(geometry)
    parts = profiles(at)
    assert all(twice_area(profile) > 0 for profile in parts.values()), "anticlockwise, so solid and not a hole"
    for lower, upper, foot in (("gel", "ring", at.ring_foot_mm), ("ring", "camera", at.camera_foot_mm)):
        for height in np.linspace(foot - 3.0 + 0.1, foot - 0.01, 7):
            spigot, socket = crosses(parts[lower], height)[-1], crosses(parts[upper], height)[0]
            assert socket - spigot == pytest.approx(0.15)
    rim = crosses(parts["lid"], at.lid_mm - 1)[-1]
    assert crosses(parts["camera"], at.lid_mm - 1)[0] - rim == pytest.approx(0.15)


def test_the_mould_holds_the_acrylic_and_the_gel_up_to_its_rim_and_lets_it_go() -> None:
    geometry = SensorGeometry()
    mould = profiles(housing(geometry))["mould"]
    assert crosses(mould, 2.9)[0] == pytest.approx(25.0 + 0.15)
    assert crosses(mould, 8.0 - 1e-9)[0] - crosses(mould, 3.0 + 1e-9)[0] == pytest.approx(5 * tan(radians(2)), abs=1e-6)
    assert max(z for _, z in mould) == pytest.approx(3.0 + geometry.gel_thickness_mm)
    heights = np.linspace(3, 8, 501)[:-1] + 0.005
    gel_ml = sum(pi * crosses(mould, z)[0] ** 2 * 0.01 for z in heights) / 1000
    assert gel_ml == pytest.approx(10.0, abs=0.05), "ml, as docs/build.md says"


def test_what_cannot_be_built_is_refused_with_the_nearest_that_works() -> None:
    with pytest.raises(InputError, match=r"at least 1\d\.\d"):
        housing(SensorGeometry(mounting_height_mm=30.0))
    with pytest.raises(InputError, match="lens"):
        housing(replace(SensorGeometry(), mounting_height_mm=1.0), lens_mm=3.0)
    with pytest.raises(InputError, match=r"gel_diameter_mm at least 45\.3"):
        housing(SensorGeometry(gel_diameter_mm=44.0, ring_radius_mm=18.0))
    housing(SensorGeometry(gel_diameter_mm=45.3, ring_radius_mm=18.0))


def test_without_the_kernel_the_housing_is_refused_in_words(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "OCP.gp", None)
    with pytest.raises(InputError, match="pip install"):
        housing_files(SensorGeometry())
