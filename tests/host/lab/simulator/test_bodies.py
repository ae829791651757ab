"""Turned bodies: what of them meets the gel, and sequences of them with their true poses."""

import csv
import json
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gellight.base.errors import InputError
from gellight.frames.image_files import read_image
from gellight.lab.simulator.bodies import BEADS, MESH_MM, body
from gellight.lab.simulator.objects import FLAT_MM, PLATE_MM
from gellight.lab.simulator.objects import object_height as plate_height
from gellight.lab.simulator.scene import Press
from gellight.lab.simulator.sequence import read_sequence
from gellight.opening import open_camera
from gellight_design.simulating.written_sequence import write_sequence
from sim_reference.deformation import NO_OBJECT, grid
from sim_reference.geometry import SensorGeometry
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


# ---- sequences of presses ----


SMALL = SensorGeometry(image_width_px=160, image_height_px=120, pixel_size_mm=0.2352)
STEPS = [[0.8, 0, 0, 0, 0, 0], None, [0.7, 0.5, -0.25, 4, 0, 10]]


def written(folder: Path, **content: object) -> Path:
    path = folder / "sequence.json"
    path.write_text(json.dumps({"object": "peg", "steps": STEPS} | content))
    return path


def test_pictures_and_true_poses_are_written(tmp_path: Path) -> None:
    report = write_sequence(read_sequence(written(tmp_path), SMALL), tmp_path / "out", SMALL)
    assert report.frames == 3
    pictures = [read_image(tmp_path / "out" / f"{number:05}.png").astype(int) for number in range(3)]
    changed = [np.abs(picture - pictures[1]).max(axis=2) > 15 for picture in pictures]
    assert changed[0].sum() > 100
    assert not changed[1].any()
    rows = list(csv.DictReader((tmp_path / "out/poses.csv").open()))
    assert rows[1]["object"] == ""
    said = np.array([[float(rows[2][f"{axis}{of}"]) for of in ("_of_x", "_of_y", "_of_z", "_mm")] for axis in "xyz"])
    np.testing.assert_allclose(said[:, :3], Rotation.from_rotvec(np.radians([4, 0, 10])).as_matrix(), atol=1e-8)
    np.testing.assert_allclose(said[:2, 3], [0.5, -0.25])
    assert (body("PEG").vertices @ said[:, :3].T + said[:, 3])[:, 2].max() == pytest.approx(0.7, abs=0.01)


def test_a_simulated_sensor_shows_a_step_a_frame_there_and_back(tmp_path: Path) -> None:
    url = f"sim://?board=0&fps=1000&sequence={written(tmp_path)}"
    with open_camera(url, geometry={"image_width_px": 160, "image_height_px": 120, "pixel_size_mm": 0.2352}) as camera:
        truths = [camera.read().truth for _ in range(5)]
    poses = [truth.pose for truth in truths if truth]
    assert [pose is None for pose in poses] == [False, True, False, True, False]
    np.testing.assert_array_equal(poses[4], poses[0])
    assert truths[2].depth_mm.max() == pytest.approx(0.7, abs=0.1)
    # The contact lies where the pose carries the end of the peg.
    rows, columns = np.nonzero(truths[2].contact)
    middle = np.array([columns.mean() - 79.5, rows.mean() - 59.5]) * 0.2352
    assert np.abs(middle - poses[2][:2, 3]).max() < 2.5


def test_a_press_that_is_not_turned_has_a_pose_too() -> None:
    np.testing.assert_array_equal(Press("BALL", 0.7, 1.0, 2.0).pose[:3, 3], [1.0, 2.0, 0.7])


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ({"object": "PIG"}, "no object 'PIG': choose one of PEG"),
        ({"object": "BEAD", "within_mm": 3.0}, "BEAD is a whole bead"),
        ({"steps": []}, "steps = .* is not allowed: give a list of at least 1 entry"),
        ({"steps": [[9, 0, 0, 0, 0, 0]]}, "step 0 is 9 mm deep"),
        ({"steps": [[0.5, 99, 0, 0, 0, 0]]}, r"at \(99, 0\) mm: give 0 to 3 mm, within 25 mm of the centre"),
        ({"steps": [[0.5, 0, 0]]}, "steps.0.3 is missing; give"),
        ({"speed": 3}, "speed is unknown: leave it out"),
    ],
)
def test_rubbish_is_refused_in_one_sentence(tmp_path: Path, content: dict[str, object], message: str) -> None:
    with pytest.raises(InputError, match=message):
        read_sequence(written(tmp_path, **content), SMALL)


def test_a_file_that_is_not_there_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="cannot be read"):
        read_sequence(tmp_path / "none.json", SMALL)
