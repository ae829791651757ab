"""From frame to frame: one object keeps its number, a loss is announced, what comes then is another; the poses."""

import csv
import json
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from gellight.frame_path.pipeline import Reconstructor
from gellight.frames.frames import CameraFrame, Provenance, TactileFrame
from gellight.frames.image_files import read_image
from gellight.frames.pose import ObjectPose, PoseFigures
from gellight.lab.simulator.sequence import read_sequence
from gellight_design.simulating.written_sequence import write_sequence
from gellight_scan.tracking.following import ObjectFollower
from gellight_scan.tracking.information import Agreement
from gellight_scan.tracking.registration import Loss
from gellight_scan.tracking.rigid import inverse, twist_of
from gellight_scan.tracking.tracker import Tracker
from gellight_scan.tracking.view import touching
from sim_reference.geometry import AS_BUILT
from tests.helpers.moving import Height, ball, bar, faint, moved, nothing, other, relief, seen
from tests.helpers.small_bundles import PIXEL_MM, SHAPE, ordinary

DRIFTED_DEG = 4.0
SMALL = replace(AS_BUILT, image_width_px=SHAPE[1], image_height_px=SHAPE[0], pixel_size_mm=PIXEL_MM)
STEPS = [[0.9, 0.15 * i, 0.1 * i, 0.5 * i, 0, 1.5 * i] for i in range(6)]


def way(count: int) -> list[np.ndarray]:
    return [moved(0.12 * i, 0.05 * i, (0.6 * i, -0.8 * i, 1.5 * i)) for i in range(count)]


def test_an_object_is_followed_with_one_number() -> None:
    tracker = Tracker()
    for number, motion in enumerate(way(9)):
        pose = tracker.follow(seen(relief, motion, noise=0.003, seed=number), number)
        assert (pose.number, pose.since_sequence, pose.lost) == (1, 0, False)
        off = twist_of(pose.motion @ inverse(motion), pose.centre_mm)
        assert np.linalg.norm(off[:3]) < 0.02
        assert np.degrees(np.linalg.norm(off[3:])) < 0.5


@pytest.mark.parametrize("pixels", [0, 1, 2])
def test_a_touch_of_a_pixel_is_no_contact(pixels: int) -> None:
    depth = np.zeros((30, 40), np.float32)
    depth[10, 12 : 12 + pixels] = 0.5
    assert not touching(depth, depth, (0.2, 0.2)).any()


def test_a_fresh_tracker_backwards_takes_the_motion_back() -> None:
    """Closure with the keyframes of the way there would be zero whatever they are worth."""
    views = [seen(relief, motion, noise=0.003, seed=number) for number, motion in enumerate(way(7))]
    there, back = Tracker(), Tracker()
    forwards = [there.follow(view, number) for number, view in enumerate(views)][-1]
    backwards = [back.follow(view, number) for number, view in enumerate(reversed(views))][-1]
    closed = twist_of(backwards.motion @ forwards.motion, forwards.origin_mm)
    assert np.linalg.norm(closed[:3]) < 0.03
    assert np.degrees(np.linalg.norm(closed[3:])) < 0.5
    assert np.degrees(np.linalg.norm(twist_of(forwards.motion)[3:])) > 8


def test_another_object_is_announced_at_once_and_gets_another_number() -> None:
    tracker = Tracker()
    for number in range(4):
        tracker.follow(seen(relief), number)
    poses, why = [], []
    for number in range(4, 10):
        poses.append(tracker.follow(seen(other), number))
        why.append(tracker.loss)
    assert why == [*[Loss.UNLIKE] * 4, None, None]
    assert all(pose is not None for pose in poses)
    assert [pose.lost for pose in poses if pose] == [*[True] * 4, False, False]
    assert [pose.number for pose in poses if pose] == [*[1] * 4, 2, 2]
    assert poses[-1].since_sequence == 8


def test_a_lifted_object_is_lost_once_and_found_again() -> None:
    tracker = Tracker()
    tracker.follow(seen(relief), 0)
    lost = tracker.follow(nothing(), 1)
    assert lost.lost
    assert np.isnan(lost.motion).all()
    assert tracker.loss is Loss.LIFTED
    assert tracker.follow(nothing(), 2) is None
    again = tracker.follow(seen(relief, moved(0.1, 0, (0, 0, 2))), 3)
    assert (again.number, again.lost, tracker.loss) == (1, False, None)
    tracker.forget()
    assert tracker.follow(seen(relief), 4).number == 2


@pytest.mark.parametrize("plain", [ball, bar])
def test_a_plain_object_is_held_where_it_tells_nothing(plain: Height) -> None:
    tracker = Tracker()
    for number in range(6):
        pose = tracker.follow(seen(plain, moved(0.1 * number, 0.1, (0, 0, 0)), noise=0.003, seed=number), number)
        assert (pose.number, pose.lost) == (1, False)
    assert pose.doubtful


def test_an_object_with_a_relief_too_faint_to_tell_its_turn_is_lost_and_not_held() -> None:
    """It looks like a ball from one frame to the next, and rolls unseen."""
    tracker = Tracker()
    views = [seen(faint, moved(0, 0, (0, 2.0 * number, 0)), noise=0.003, seed=number) for number in range(3)]
    first, *later = (tracker.follow(view, number) for number, view in enumerate(views))
    assert first is not None
    assert all(pose is not None and pose.lost for pose in later)
    assert tracker.loss is Loss.UNTOLD


def test_an_object_is_lost_where_the_errors_of_its_keyframes_may_have_added_up() -> None:
    """And what touches from the next frame on but one is another: the errors begin anew."""
    tracker = Tracker()
    tracker.follow(seen(relief), 0)
    first = tracker._known[0]
    tracker._known = [replace(first, covariance=np.eye(6) * np.radians(DRIFTED_DEG) ** 2)]
    view = seen(relief, moved(0.05, 0, (0, 0, 1)))
    lost, why = tracker.follow(view, 1), tracker.loss
    other = tracker.follow(view, 2)
    assert [(pose.number, pose.lost) for pose in (lost, other) if pose] == [(1, True), (2, False)]
    assert (why, tracker.loss) == (Loss.UNSURE, None)


@pytest.mark.parametrize(
    ("sd", "doubtful"), [(0.9, False), (1.1, True), (np.radians(4.9), False), (np.radians(5.1), True)]
)
def test_a_pose_is_doubtful_where_its_largest_deviation_is(sd: float, doubtful: bool) -> None:
    """Along a direction askew to the axes, each of which states less."""
    tracker = Tracker()
    pose = tracker.follow(seen(relief), 0)
    block = slice(0, 3) if sd > 0.5 else slice(3, 6)
    covariance = np.eye(6) * 1e-6
    covariance[block, block] += np.full((3, 3), sd**2 / 3)
    stated = replace(pose, covariance=covariance)
    assert (stated.doubtful, stated.figures().doubtful) == (doubtful, doubtful)
    assert stated.in_words().endswith(", doubtful: press deeper, or where there is more relief") == doubtful


def test_a_pose_travels_as_figures() -> None:
    tracker = Tracker()
    tracker.follow(seen(relief), 5)
    pose = tracker.follow(seen(relief, moved(0.1, 0.1, (1, 2, 3))), 6)
    again = ObjectPose.of(PoseFigures.model_validate_json(pose.figures().model_dump_json()))
    for name in ("motion", "origin_mm", "centre_mm", "covariance", "untellable", "place_mm"):
        np.testing.assert_array_equal(getattr(again, name), getattr(pose, name))
    assert again.since_sequence == 5
    assert not again.doubtful
    assert again.in_words().startswith("object 1 at (")
    lost = tracker.follow(nothing(), 7)
    assert ObjectPose.of(lost.figures()).lost
    with pytest.raises(ValueError, match="reshape"):
        ObjectPose.of(pose.figures().model_copy(update={"motion": (1.0, 2.0)}))


@pytest.mark.parametrize(
    ("mm", "degrees", "relief", "known"),
    [
        (0.66, 0.0, True, True), (0.67, 0.0, True, False), (0.0, 3.32, True, True), (0.0, 3.34, True, False),
        (3.32, 0.0, False, False), (3.34, 0.0, False, True), (3.34, 0.0, True, False),
    ],
)  # fmt: skip
def test_a_pose_is_believed_to_two_thirds_of_what_would_be_doubtful(
    mm: float, degrees: float, relief: bool, known: bool
) -> None:
    """Beyond a third of a centimetre nothing is told; that is no fault of an object that looks the same all over."""
    tracker = Tracker()
    tracker._relief = relief
    assert tracker._known_well(np.diag([mm, 0, 0, np.radians(degrees), 0, 0]) ** 2) == known


@pytest.mark.parametrize(
    ("weakest", "overlap", "tilt_deg", "leads_on"),
    [
        (9.0, 0.71, 0.0, False), (9.0, 0.69, 0.0, True), (9.0, 1.0, 29.9, False), (9.0, 1.0, 30.1, True),
        (2.9, 0.79, 0.0, True), (2.9, 0.81, 0.0, False), (3.1, 0.79, 0.0, False), (0.99, 0.79, 0.0, False),
    ],
)  # fmt: skip
def test_a_frame_is_kept_while_its_object_is_still_well_known(
    weakest: float, overlap: float, tilt_deg: float, leads_on: bool
) -> None:
    same = Agreement(overlap=overlap, unlike=0.0, curvature=1.0, slope=1.0, residual=0.5, texture=10.0)
    told, pose = SimpleNamespace(weakest=weakest), moved(0, 0, (tilt_deg, 0, 0))
    found: Any = SimpleNamespace(agreement=same, information=told, registration=SimpleNamespace(pose=pose))
    assert Tracker()._leads_on(found) == leads_on


@pytest.mark.parametrize(("count", "usual"), [(3, np.inf), (4, 0.7)])
def test_four_frames_tell_what_the_residual_of_an_object_usually_is(count: int, usual: float) -> None:
    tracker = Tracker()
    tracker._residuals.extend([0.7] * count)
    assert tracker._own == usual


@pytest.mark.parametrize(("deep_mm", "found"), [(0.019, False), (0.021, True)])
def test_what_is_less_than_a_fiftieth_of_a_millimetre_deep_touches_nothing(deep_mm: float, found: bool) -> None:
    rows, columns = np.indices((60, 80))
    near = (np.hypot(rows - 30, columns - 40) < 20).astype(np.float32)
    pressure = near * (1 + np.arange(80, dtype=np.float32) / 80)
    assert touching(pressure, deep_mm * near, (0.1, 0.1)).any() == found


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


def test_the_pose_is_that_of_the_simulator(felt: list[tuple[np.ndarray, TactileFrame]]) -> None:
    follower = ObjectFollower()
    for true, frame in felt:
        pose = follower.follow(frame).pose
        assert (pose.number, pose.since_sequence, pose.lost) == (1, 0, False)
        off = twist_of(pose.motion @ inverse(true @ inverse(felt[0][0])), pose.centre_mm)
        assert np.linalg.norm(off[:3]) < 0.04
        assert np.degrees(np.linalg.norm(off[3:])) < 0.5
        assert len(pose.untellable) == 0


def test_after_a_gap_or_with_another_calibration_it_is_another_object(
    felt: list[tuple[np.ndarray, TactileFrame]],
) -> None:
    follower, (_, frame) = ObjectFollower(), felt[0]
    begun_s = frame.camera_frame.time_s
    soon, later = (replace(frame, camera_frame=replace(frame.camera_frame, time_s=begun_s + s)) for s in (0.99, 2.0))
    other = replace(later, provenance=replace(later.provenance, calibration="b"))
    assert [follower.follow(one).pose.number for one in (frame, soon, later, other, other)] == [1, 1, 2, 3, 3]
