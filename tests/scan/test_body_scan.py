"""A bead that is rolled in the gel: its touches find their places, whatever the tracker says, and stay whole."""

import json
from dataclasses import fields, replace
from pathlib import Path
from unittest.mock import Mock

import numpy as np
import pytest

from gellight.base.errors import InputError
from gellight.lab.simulator.bodies import BEADS, bead_radius_mm
from gellight_scan import body_scan
from gellight_scan.body_scan import BodyScan, TouchReport
from gellight_scan.contact_view import ContactView
from gellight_scan.scan import Scan
from gellight_scan.scan_files import alone, path_of, write_press
from gellight_scan.touches import Touch, touches_in
from gellight_scan.tracking.information import Agreement
from gellight_scan.tracking.rigid import carried, inverse, pose_of, twist_of
from tests.benchmarks.scan_bodies import fitted, frames
from tests.benchmarks.tracking.sequences import Moving, press
from tests.helpers.command_line import invoke, refused
from tests.helpers.reliefs import record_rolled

RADIUS_MM, TURN_RAD = 4.0, np.radians(40)
FEWEST = 6


def way(name: str, offset_rad: float = 0.0) -> Moving:
    """A bead that rolls about y without slipping."""
    return Moving(
        object_name=name,
        frames=14,
        depth=lambda s: 0.8 + 0 * s,
        place=lambda s: (RADIUS_MM * TURN_RAD * (s - 0.5), 0 * s),
        turn=lambda s: (0 * s, np.degrees(TURN_RAD * s + offset_rad), 0 * s),
    )


@pytest.fixture(scope="module")
def pressed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return press("roll", tmp_path_factory.mktemp("pressed"), moving=way("FINEBEAD"))


@pytest.fixture(scope="module")
def rolled(pressed: Path) -> tuple[list[Touch], dict[int, np.ndarray]]:
    """The touches, and the true poses by frame."""
    poses, felt = zip(*frames(pressed), strict=True)
    true = {frame.camera_frame.sequence: pose for pose, frame in zip(poses, felt, strict=True)}
    return list(touches_in(iter(felt))), true


@pytest.fixture(scope="module")
def other(tmp_path_factory: pytest.TempPathFactory) -> Touch:
    moving = replace(way("BEAD"), frames=1)
    ((_, frame),) = frames(press("other", tmp_path_factory.mktemp("pressed"), moving=moving))
    (touch,) = touches_in(iter([frame]))
    return replace(touch, number=77)


def assert_in_place(
    scan: BodyScan, touches: list[Touch], true: dict[int, np.ndarray], most_mm: float = 0.015, most_deg: float = 0.2
) -> None:
    """Places are off by so much at most, at the middle of the contact."""
    first = true[touches[scan.first].sequence]
    for n in scan.placed:
        off = inverse(scan.solved.poses[n]) @ first @ inverse(true[touches[n].sequence])
        twist = twist_of(off, touches[n].view.centre_mm)
        assert np.linalg.norm(twist[:3]) < most_mm
        assert np.degrees(np.linalg.norm(twist[3:])) < most_deg


def test_touches_come_as_it_rolls_on_and_none_where_it_rests(pressed: Path, rolled: tuple) -> None:
    touches, _ = rolled
    assert FEWEST <= len(touches) <= 13
    assert {touch.number for touch in touches} == {1}
    resting = [frame for _, frame in frames(pressed)][:1] * 5
    assert len(list(touches_in(iter(resting)))) == 1


def test_the_mesh_is_the_bead(rolled: tuple, tmp_path: Path) -> None:
    touches, true = rolled
    scan = BodyScan(tmp_path)
    reports = [scan.add(touch) for touch in touches]
    assert scan.placed == list(range(len(touches)))
    assert all(report.placed and report.joined_to for report in reports[1:])
    assert_in_place(scan, touches, true)
    mesh = scan.mesh()
    points = carried(inverse(true[touches[0].sequence]), mesh.points_mm)
    off = fitted(points, bead_radius_mm(*BEADS["FINEBEAD"]))
    assert np.sqrt((off**2).mean()) < 0.013
    assert 0.5 < np.sqrt((mesh.error_mm**2).mean()) / np.sqrt((off**2).mean()) < 2


def test_where_the_tracker_drifts_the_overlaps_say_where_it_lies(rolled: tuple, tmp_path: Path) -> None:
    """By .14 mm and 1.4 degrees from touch to touch."""
    touches, true = rolled
    drift = pose_of(np.array([0.1, -0.1, 0, 0.015, 0, 0.02]))
    scan, wrong = BodyScan(tmp_path), np.eye(4)
    for touch in touches:
        scan.add(replace(touch, motion=wrong @ touch.motion))
        wrong = drift @ wrong
    assert np.linalg.norm(wrong[:3, 3]) > 0.8
    assert len(scan.placed) == len(touches)
    assert_in_place(scan, touches, true)


def test_what_touches_after_a_loss_and_in_a_scan_that_goes_on_is_found(rolled: tuple, tmp_path: Path) -> None:
    """Every touch is of an object that the tracker has not seen before."""
    touches, true = rolled
    for touch in touches[:5]:
        BodyScan(tmp_path).add(touch)
    scan = BodyScan(tmp_path)
    assert scan.placed == [0, 1, 2, 3, 4]
    for number, touch in enumerate(touches[5:]):
        scan.add(replace(touch, number=100 + number, motion=np.eye(4)))
    assert len(scan.placed) == len(touches)
    assert_in_place(scan, touches, true)


def test_another_body_is_joined_to_nothing_and_in_no_mesh(rolled: tuple, other: Touch, tmp_path: Path) -> None:
    touches, _ = rolled
    scan = BodyScan(tmp_path)
    for touch in touches[:4]:
        scan.add(touch)
    before = scan.mesh()
    report = scan.add(other)
    assert (report.joined_to, report.placed, report.worth_saying) == (0, False, True)
    assert "roll the body back to where it was touched" in report.in_words()
    np.testing.assert_array_equal(scan.mesh().points_mm, before.points_mm)


def test_two_rolls_that_nothing_connects_are_one_when_a_touch_does(rolled: tuple, tmp_path: Path) -> None:
    touches, true = rolled
    scan = BodyScan(tmp_path)
    scan.add(touches[0])
    apart = [replace(touch, number=2) for touch in touches[-3:]]
    reports = [scan.add(touch) for touch in apart]
    assert scan.placed == [0]
    assert [report.joined_to for report in reports] == [0, 1, 2]
    assert "not to where the scan began" in reports[-1].in_words()
    between = [replace(touch, number=2) for touch in touches[-4:0:-1]]
    for touch in between:
        scan.add(touch)
    assert len(scan.placed) == len(touches)
    assert_in_place(scan, [touches[0], *apart, *between], true, most_mm=0.02, most_deg=0.25)


@pytest.mark.parametrize(("part", "value"), [("pose", np.nan), ("covariance", np.nan), ("covariance", 0.0)])
def test_a_damaged_joint_is_named(part: str, value: float, rolled: tuple, tmp_path: Path) -> None:
    touches, _ = rolled
    scan = BodyScan(tmp_path)
    for touch in touches[:2]:
        scan.add(touch)
    damaged = replace(scan.joints[0], **{part: np.full_like(getattr(scan.joints[0], part), value)})
    write_press(path_of(tmp_path, 1, "touch"), scan.views[1], [damaged])
    with pytest.raises(InputError, match=r"touch-001\.npz is no press of a scan \(a joint whose pose or covariance"):
        BodyScan(tmp_path)


def test_a_lock_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    (tmp_path / "scan.lock").mkdir()
    with pytest.raises(InputError, match=r"scan\.lock cannot be written \(Is a directory\)"), alone(tmp_path):
        pass


def test_rubbish_is_refused_in_one_sentence(rolled: tuple, tmp_path: Path) -> None:
    touches, _ = rolled
    scan = BodyScan(tmp_path / "body")
    scan.add(touches[0])
    small = ContactView(np.full((48, 64), 0.3, np.float32), (0.06, 0.06), "synthetic")
    with pytest.raises(InputError, match="give it another folder"):
        scan.add(replace(touches[1], contact=small))
    with pytest.raises(InputError, match="holds the scan of a body, this is one of a flat part"):
        Scan(tmp_path / "body")


def test_with_many_touches_places_are_found_anew_from_time_to_time(
    rolled: tuple, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    touches, true = rolled
    monkeypatch.setattr(body_scan, "FEW", 2)
    monkeypatch.setattr(body_scan, "MOST_TOUCHES", len(touches) + 1)
    monkeypatch.setattr(body_scan, "solve", Mock(wraps=body_scan.solve))
    scan = BodyScan(tmp_path)
    for touch in touches:
        scan.add(touch)
    assert body_scan.solve.call_count == 2
    assert (scan.room, scan.placed) == (1, list(range(len(touches))))
    assert len(scan.solved.weights) == len(scan.joints)
    scan.mesh()
    assert body_scan.solve.call_count == 3
    assert_in_place(scan, touches, true)


def test_what_is_there_already_takes_no_room_from_the_rest_of_a_recording(
    pressed: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    record_rolled(tmp_path / "roll.mcap", pressed)
    for most in (3, 5):
        monkeypatch.setattr(body_scan, "MOST_TOUCHES", most)
        done = invoke("scan", str(tmp_path / "bead"), "--body", "--recording", str(tmp_path / "roll.mcap"), "--json")
        assert json.loads(done.stdout)["touches"] == most
        assert f"{most} touches are all that a scan holds" in done.stderr


def test_the_verb_makes_a_mesh_of_a_recording_and_goes_on_with_it(
    pressed: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    record_rolled(tmp_path / "roll.mcap", pressed)
    scan = ("scan", "bead", "--body", "--recording", "roll.mcap")
    for _ in range(2):
        done = invoke(*scan, "--json")
        assert done.exit_code == 0, done.output
        told = json.loads(done.stdout)
        assert told["touches"] >= FEWEST, "the second time they are there already"
        assert told["not_joined"] == []
        assert told["seam_um"] < 4
    names = {path.name for path in (tmp_path / "bead").iterdir()}
    assert {"body.ply", "body.stl", "body.png", "touch-000.npz"} <= names
    for wrong in ((*scan, "--curved"), scan[:2] + scan[3:]):
        assert refused(invoke(*wrong))


def agreed(**changes: float) -> Agreement:
    """What two views of one place agree in, with `changes`."""
    best = {field.name: 1.0 for field in fields(Agreement)} | {"unlike": 0.0}
    return Agreement(**{**best, **changes})


@pytest.mark.parametrize(
    ("changes", "again", "like"),
    [
        ({}, True, True),
        ({"unlike": 0.049}, True, True),
        ({"unlike": 0.051}, True, False),
        ({"unlike": 0.249}, True, False),
        ({"unlike": 0.251}, False, False),
        ({"overlap": 0.71}, True, True),
        ({"overlap": 0.69}, True, False),
        ({"curvature": 0.81}, True, True),
        ({"curvature": 0.79}, True, False),
    ],
)
def test_a_touch_that_nothing_led_to_is_found_where_it_is_like_enough(
    changes: dict[str, float], again: bool, like: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(body_scan, "agrees", lambda agreement: True)
    assert (body_scan.found_again(agreed(**changes)), body_scan.alike(agreed(**changes))) == (again, like)
    monkeypatch.setattr(body_scan, "agrees", lambda agreement: False)
    assert not body_scan.found_again(agreed(**changes))
    assert not body_scan.alike(agreed(**changes))


@pytest.mark.parametrize(
    ("number", "placed", "said"),
    [(8, True, False), (9, True, True), (10, True, False), (19, True, True), (3, False, True)],
)
def test_every_tenth_touch_that_went_well_is_worth_a_word(number: int, placed: bool, said: bool) -> None:
    assert TouchReport(number=number, joined_to=1, placed=placed).worth_saying is said


@pytest.mark.parametrize(("covers", "turned_deg", "asked"), [(0.31, 0, 1), (0.29, 0, 0), (0.31, 34, 1), (0.31, 36, 0)])
def test_touches_that_overlap_by_three_tenths_and_lie_within_35_degrees_are_asked(
    covers: float, turned_deg: float, asked: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(body_scan, "covered", lambda *views: covers)
    scan = BodyScan(tmp_path)
    monkeypatch.setattr(scan, "_key", Mock())
    monkeypatch.setattr(scan, "_joined", Mock(return_value=object()))
    pose = pose_of(np.array([0, 0, 0, np.radians(turned_deg), 0, 0]))
    assert len(list(scan._where(1, Mock(), {0: pose}))) == asked
