"""Sequences of presses: the file, the frames that a sensor shows of it, and the true poses."""

import csv
import json
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gellight.base.errors import InputError
from gellight.frames.image_files import read_image
from gellight.lab.simulator.bodies import body
from gellight.lab.simulator.scene import Press
from gellight.lab.simulator.sequence import read_sequence
from gellight.opening import open_camera
from gellight_design.simulating.written_sequence import write_sequence
from sim_reference.geometry import SensorGeometry

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
