"""The pose of frames: where somebody asks, of the true motion in simulated pictures, anew after a gap."""

import csv
import json
from dataclasses import replace

import numpy as np
import pytest

from gellight.base.settings import Settings
from gellight.frame_path.pipeline import Reconstructor
from gellight.frames.frames import CameraFrame, Provenance, TactileFrame
from gellight.frames.image_files import read_image
from gellight.lab.simulator.sequence import read_sequence, write_sequence
from gellight.tracking.following import GAP_S, ObjectFollower
from gellight.tracking.rigid import inverse, twist_of
from sim_reference.geometry import SensorGeometry
from tests.helpers.small_bundles import PIXEL_MM, SHAPE, ordinary

SMALL = SensorGeometry(image_width_px=SHAPE[1], image_height_px=SHAPE[0], pixel_size_mm=PIXEL_MM)
STEPS = [[0.9, 0.15 * i, 0.1 * i, 0.5 * i, 0, 1.5 * i] for i in range(6)]


@pytest.fixture(scope="module")
def felt(tmp_path_factory: pytest.TempPathFactory) -> list[tuple[np.ndarray, TactileFrame]]:
    """True pose and frame of a relief that slides, tilts and turns, seen by a small simulated sensor."""
    folder = tmp_path_factory.mktemp("sequence")
    file = folder / "sequence.json"
    file.write_text(json.dumps({"object": "CCONVEX", "within_mm": 8, "steps": STEPS}))
    write_sequence(read_sequence(file, SMALL), folder / "out", SMALL)
    reconstructor, found = Reconstructor(ordinary()), []
    for row in csv.DictReader((folder / "out/poses.csv").open()):
        pose = np.eye(4)
        pose[:3] = [[float(row[f"{axis}{of}"]) for of in ("_of_x", "_of_y", "_of_z", "_mm")] for axis in "xyz"]
        number = int(row["frame"])
        image = read_image(folder / "out" / f"{number:05}.png")
        frame = reconstructor.reconstruct(CameraFrame(image=image, time_s=0.1 * number, sequence=number))
        made = Provenance(calibration="a", zero="a", pixel_size_mm=(PIXEL_MM, PIXEL_MM), unix_s=0.0, ages_s={})
        found.append((pose, replace(frame, provenance=made)))
    return found


def test_nobody_asks_nothing_happens(felt: list[tuple[np.ndarray, TactileFrame]]) -> None:
    assert not Settings().tracking.enabled
    assert ObjectFollower().follow(felt[0][1]) is felt[0][1]


def test_the_pose_is_that_of_the_simulator(felt: list[tuple[np.ndarray, TactileFrame]]) -> None:
    follower = ObjectFollower(on=True)
    for true, frame in felt:
        pose = follower.follow(frame).pose
        assert pose is not None
        assert (pose.number, pose.since_sequence, pose.lost) == (1, 0, False)
        off = twist_of(pose.motion @ inverse(true @ inverse(felt[0][0])), pose.centre_mm)
        assert np.linalg.norm(off[:3]) < 0.04
        assert np.degrees(np.linalg.norm(off[3:])) < 0.5
        assert len(pose.untellable) == 0


def test_after_a_gap_or_with_another_calibration_it_is_another_object(
    felt: list[tuple[np.ndarray, TactileFrame]],
) -> None:
    follower, (_, frame) = ObjectFollower(on=True), felt[0]
    later = replace(frame, camera_frame=replace(frame.camera_frame, time_s=GAP_S + 1))
    other = replace(later, provenance=replace(later.provenance, calibration="b"))
    assert [follower.follow(one).pose.number for one in (frame, frame, later, other, other)] == [1, 1, 2, 3, 3]
    follower.switch(on=True)
    assert follower.follow(other).pose.number == 3, "it goes on"
    follower.switch(on=False)
    assert follower.follow(other).pose is None
    follower.switch(on=True)
    assert follower.follow(other).pose.number == 1
