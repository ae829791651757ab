"""Turned bodies: what of them meets the gel, against what geometry says."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gellight.lab.simulator.bodies import BEADS, MESH_MM, body
from gellight.lab.simulator.objects import FLAT_MM, PLATE_MM
from gellight.lab.simulator.objects import object_height as plate_height
from sim_reference.deformation import NO_OBJECT, grid
from sim_reference.objects import object_height

SIZE, SPACING = 161, 0.125
AT = grid(SIZE, SPACING)
X, Y = AT[None, :], AT[:, None]


def turn(*degrees: float) -> np.ndarray:
    return Rotation.from_rotvec(np.radians(degrees)).as_matrix()


def test_a_smooth_bead_is_a_sphere_however_it_is_turned() -> None:
    near = np.hypot(X, Y) < 2.5
    sphere = np.sqrt(np.maximum(16 - X**2 - Y**2, 0)) - 4
    for rotation in (turn(0, 0, 0), turn(70, 20, -130)):
        height, top = body("MARBLE").upper_side(rotation, SIZE, SPACING)
        assert top == pytest.approx(4, abs=MESH_MM**2 / 4)
        assert np.abs(height - sphere)[near].max() < MESH_MM**2 / 4


def test_an_object_that_is_not_turned_is_as_high_as_its_formula_says() -> None:
    height, top = body("CCONVEX", 9.0).upper_side(np.eye(3), SIZE, SPACING)
    said = object_height("CCONVEX", X, Y)
    inside = np.hypot(X, Y) < 8.8
    assert top == pytest.approx(0, abs=1e-3)
    assert np.median(np.abs(height - said)[inside]) < 2e-3
    assert (height[np.hypot(X, Y) > 9.2] == NO_OBJECT).all()


def test_a_tilted_plane_has_the_slope_of_the_tilt() -> None:
    height, top = body("CYLINDER").upper_side(turn(0, 10, 0), SIZE, SPACING)
    inside = np.hypot(X / np.cos(np.radians(10)), Y) < 3.7
    expected = -np.tan(np.radians(10)) * (X + 0 * Y) - top
    assert np.abs(height - expected)[inside].max() < 1e-9


def test_a_turn_about_z_turns_the_height_map() -> None:
    plain, top = body("PEG").upper_side(np.eye(3), SIZE, SPACING)
    turned, turned_top = body("PEG").upper_side(turn(0, 0, 90), SIZE, SPACING)
    assert turned_top == pytest.approx(top)
    both = (np.rot90(plain, -1) > NO_OBJECT) & (turned > NO_OBJECT)
    assert both.sum() > 0.97 * (plain > NO_OBJECT).sum()
    assert (
        np.abs(np.rot90(plain, -1) - turned)[both].max() < 1e-6
    )  # x turns towards y: as the arrays show it, clockwise


def test_the_highest_point_is_where_the_pose_carries_the_body() -> None:
    rotation = turn(33, -12, 8)
    height, top = body("FINEBEAD").upper_side(rotation, SIZE, SPACING)
    vertices = body("FINEBEAD").vertices @ rotation.T
    assert height.max() == 0
    assert top == pytest.approx(vertices[:, 2].max(), abs=MESH_MM / 10)


@pytest.mark.parametrize("name", BEADS)
def test_the_relief_of_a_bead_is_as_large_as_it_is_said(name: str) -> None:
    radius, relief, _, _ = BEADS[name]
    off = np.linalg.norm(body(name).vertices, axis=1) - radius
    assert off.std() == pytest.approx(0.38 * relief, rel=0.2, abs=1e-9)


def test_rubbish_is_refused() -> None:
    with pytest.raises(ValueError, match="no object 'PIG': choose one of PEG"):
        body("PIG")
    with pytest.raises(ValueError, match="BEAD is a whole bead"):
        body("BEAD", 3.0)


# ---- plates whose roughness is known ----

PLATE_AT = grid(601, 0.05)
PLATE_X, PLATE_Y = PLATE_AT[None, :], PLATE_AT[:, None]


@pytest.mark.parametrize(("wavelength", "amplitude"), [(0.5, 0.01), (2.0, 0.04)])
def test_a_sine_plate_has_waves_of_its_length_and_amplitude(wavelength: float, amplitude: float) -> None:
    height = plate_height(f"SINE-{wavelength}-{amplitude}", PLATE_X, PLATE_Y)
    row = height[300, np.abs(PLATE_AT) < 10]
    assert height.max() == height[300, 300] == 0
    assert np.ptp(row) == pytest.approx(2 * amplitude, rel=1e-9)
    crests = np.flatnonzero((row[1:-1] > row[:-2]) & (row[1:-1] > row[2:]))
    assert np.diff(crests).mean() * 0.05 == pytest.approx(wavelength, rel=0.01)


def test_the_edge_is_rounded_and_ends() -> None:
    height = plate_height("SINE-1-0.01", PLATE_X, PLATE_Y)
    assert (height[np.hypot(PLATE_X, PLATE_Y) >= PLATE_MM] == NO_OBJECT).all()
    edge = height[300, (PLATE_AT > FLAT_MM) & (PLATE_AT < PLATE_MM - 0.1)]
    assert -0.8 < edge.min() < -0.6
    assert np.abs(np.diff(edge)).max() < 0.05


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("SINE-0.2-0.01", "0.5 to 12 mm long"),
        ("SINE-2-0", "up to 0.5 mm"),
        ("SINE-2-9", "up to 0.5 mm"),
        ("SINE-2", "no relief 'SINE-2': give SINE-WAVELENGTH-AMPLITUDE"),
        ("SINE-nan-0.1", "no relief"),
        ("SINE-1-2-3", "no relief"),
    ],
)
def test_what_is_no_relief_is_refused(name: str, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        plate_height(name, PLATE_X, PLATE_Y)
