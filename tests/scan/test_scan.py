"""A rough part, pressed beside itself: the map is the part, and it stays whole whatever ends the program."""

import json
import subprocess
from pathlib import Path
from unittest.mock import Mock

import numpy as np
import pytest

from gellight.base.errors import InputError
from gellight_scan import scan as scan_module
from gellight_scan import scan_files
from gellight_scan.contact_view import ContactView
from gellight_scan.fusion import Fused
from gellight_scan.height_map import HeightMap, load_height_map
from gellight_scan.pairs import Joint
from gellight_scan.pose_graph import Solved
from gellight_scan.scan import MAP, PressReport, Scan
from gellight_scan.tracking.rigid import pose_of
from sim_reference.surface import press_object, sample
from tests.benchmarks.scan import Part, errors_mm
from tests.helpers.children import GELLIGHT, gellight, started
from tests.helpers.command_line import invoke
from tests.helpers.reliefs import GEOMETRY, felt, picture, press, record, untouched
from tests.helpers.waiting import eventually

PART = Part(rms_mm=0.06, seed=11, columns=2, rows=2, steps_mm=(15, 13), deep_mm=0.45)


@pytest.fixture(scope="module")
def surfaces() -> list:
    return [press(PART.plate, pose, PART.deep_mm) for pose in PART.poses]


@pytest.fixture(scope="module")
def views(surfaces: list) -> list[ContactView]:
    return [felt(surface, number) for number, surface in enumerate(surfaces)]


@pytest.fixture(scope="module")
def recording(surfaces: list, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("recorded") / "presses.mcap"
    record(path, [picture(surface, number) for number, surface in enumerate(surfaces[:2])])
    return path


def small(width: int = 64, pixel_mm: float = 0.06, calibration: str = "a") -> ContactView:
    """A press that shows nothing."""
    return ContactView(np.full((48, width), 0.3, np.float32), (pixel_mm, pixel_mm), calibration)


def elsewhere() -> ContactView:
    other = Part(rms_mm=0.06, seed=12, columns=1, rows=1, steps_mm=(0, 0), deep_mm=0.45)
    return felt(press(other.plate, other.poses[0], other.deep_mm), 99)


def test_only_gel_that_reached_the_part_counts(surfaces: list, views: list[ContactView]) -> None:
    for surface, view in zip(surfaces, views, strict=True):
        assert view.reached.mean() > 0.1
        wrong, deep = (float((~surface.contact[mask]).mean()) for mask in (view.reached, view.depth_mm > 0.02))
        assert wrong < 0.03
        assert deep > 5 * wrong, "a threshold of the depth would not do"


def test_a_map_ends_where_the_part_falls_off_steeply() -> None:
    """The coating's blur makes gel beside a steep edge look pressed."""
    surface = sample(press_object("TSTEP", 0.6, GEOMETRY), GEOMETRY, 0.0, 0.0)
    reached = felt(surface, 5).reached
    assert (reached & ~surface.contact).sum() < 0.002 * reached.sum()
    assert reached.sum() > 0.9 * surface.contact.sum()


def test_the_map_is_the_part_and_says_how_far(views: list[ContactView], tmp_path: Path) -> None:
    scan = Scan(tmp_path)
    reports = [scan.add(view) for view in views]
    assert scan.placed == [0, 1, 2, 3]
    assert [report.joined_to[:1] for report in reports[1:]] == [(0,), (0,), (0,)]
    off = errors_mm(PART, scan.fused, PART.poses[0], curved=False)
    stated = scan.fused.height_map.error_mm[scan.fused.height_map.reached]
    assert off.std() < 0.015
    assert 0.7 < np.sqrt((stated**2).mean()) / off.std() < 2
    assert scan.fused.seam_mm < 0.004
    kept = load_height_map(tmp_path / MAP)
    np.testing.assert_array_equal(kept.height_mm, scan.fused.height_map.height_mm)
    assert not kept.reached[~scan.fused.seen].any()


def test_it_says_on_which_sides_nothing_is_scanned_and_goes_on_where_it_was_ended(
    views: list[ContactView], tmp_path: Path
) -> None:
    """Each press is its file alone, so whatever ends the program, the next one finds those before."""
    first, scan = Scan(tmp_path).add(views[0]), Scan(tmp_path)
    assert set(first.missing) == {"right", "left", "below", "above"}
    second = scan.add(views[1])  # it lies right of the first one
    assert "left" not in second.missing
    assert {"right", "below", "above"} <= set(second.missing)
    assert "Not scanned yet: right" in second.in_words()
    again = Scan(tmp_path)
    assert again.placed == [0, 1]
    np.testing.assert_allclose(again.solved.poses[1], scan.solved.poses[1], atol=1e-4)
    (tmp_path / "press-000.npz").unlink()
    assert set(Scan(tmp_path).views) == {1}


def test_what_is_interrupted_while_it_is_joined_is_there(
    views: list[ContactView], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Ctrl-C after the file of a press was written: it is there, with its joints."""
    scan = Scan(tmp_path)
    scan.add(views[0])
    with monkeypatch.context() as patched:
        patched.setattr(scan_module, "solve", Mock(side_effect=KeyboardInterrupt))
        with pytest.raises(KeyboardInterrupt):
            scan.add(views[1])
    assert Scan(tmp_path).placed == [0, 1]


def test_a_press_that_cannot_be_written_is_not_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    scan = Scan(tmp_path / "scan")
    scan.add(small())
    with monkeypatch.context() as full:
        full.setattr(scan_files, "write_press", Mock(side_effect=OSError(28, "No space left on device")))
        with pytest.raises(InputError, match="No space left on device"):
            scan.add(small())
    scan.add(small())
    assert list(scan.views) == list(Scan(tmp_path / "scan").views) == [0, 1]


def test_what_does_not_overlap_is_kept_without_a_place(views: list[ContactView], tmp_path: Path) -> None:
    scan = Scan(tmp_path)
    scan.add(views[0])
    report = scan.add(elsewhere())
    assert report.joined_to == ()
    assert "could not be joined" in report.in_words()
    assert scan.placed == [0]


def test_presses_find_their_place_later(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Two that hang together, and not on the first, are placed as soon as one lies between."""
    places_mm = {0: 0.0, 1: 40.0, 2: 50.0, 3: 20.0}

    def joined(one, other, guess=None) -> Joint | None:
        by_mm = places_mm[one[0]] - places_mm[other[0]]
        known = Joint(one[0], other[0], pose_of(np.array([by_mm, 0, 0, 0, 0, 0])), np.zeros(3), np.eye(6), 9.0, 0.9)
        return known if abs(by_mm) < 25 else None

    monkeypatch.setattr(scan_module, "joined", joined)
    scan, placed = Scan(tmp_path), []
    for number in places_mm:
        scan.add(small())
        placed.append(list(scan.placed))
        assert len(scan.views) == number + 1
    assert placed == [[0], [0], [0], [0, 1, 2, 3]]
    assert scan.solved.poses[2][0, 3] == pytest.approx(50)


@pytest.mark.parametrize(
    ("other", "why"),
    [
        (small(calibration="another"), "another sensor or calibration"),
        (small(width=32), "32 x 48 pixels"),
        (small(pixel_mm=0.03), "pixels of 0.03 mm"),
    ],
)
def test_a_press_of_another_sensor_is_refused(tmp_path: Path, other: ContactView, why: str) -> None:
    scan = Scan(tmp_path)
    scan.add(small())
    with pytest.raises(InputError, match=why):
        scan.add(other, "other.mcap")
    assert len(Scan(tmp_path).views) == 1


@pytest.mark.parametrize(("reached", "harder"), [(0.049, True), (0.051, False)])
def test_a_press_that_reached_little_is_to_be_harder(reached: float, harder: bool) -> None:
    report = PressReport(number=0, joined_to=(), contradicted=(), reached=reached, missing=())
    assert ("harder" in report.in_words()) is harder


def test_a_press_is_looked_for_in_the_last_twelve_that_have_a_place_and_in_as_many_that_have_none(
    tmp_path: Path,
) -> None:
    scan = Scan(tmp_path)
    scan.views = dict.fromkeys(range(30), small())
    scan.solved = Solved(dict.fromkeys(range(15), np.eye(4)), ())
    assert scan._likely() == [*range(14, 2, -1), *range(29, 17, -1)]


@pytest.mark.parametrize(("away_mm", "near"), [(4.79, True), (4.81, False)])
def test_views_of_4_by_3_mm_overlap_up_to_their_diagonal(away_mm: float, near: bool, tmp_path: Path) -> None:
    pose = pose_of(np.array([away_mm * 0.6, away_mm * 0.8, 0, 0, 0, 0]))
    assert Scan(tmp_path)._near(pose, small()) is near


@pytest.mark.parametrize(("seen", "missing"), [(0.69, ["right"]), (0.71, [])])
def test_a_side_of_which_three_tenths_are_unseen_is_worth_a_press_there(
    seen: float, missing: list[str], tmp_path: Path
) -> None:
    """A view of 10 mm; the next one to the right reaches from 1 to 11 mm of its middle."""
    scan = Scan(tmp_path)
    scan.views = {0: ContactView(np.zeros((100, 100), np.float32), (0.1, 0.1), "a")}
    scan.solved = Solved({0: np.eye(4)}, ())
    known = np.ones((300, 300), bool)
    known[:, 160 + round(100 * seen) :] = False
    heights = HeightMap(np.zeros((300, 300), np.float32), np.zeros((300, 300), np.float32), 0.1)
    scan.fused = Fused(heights, known, 0.0, (-15.0, -15.0))
    found = scan.missing(0)
    assert list(found) == missing
    assert all(middle.tolist() == [6.0, 0.0] for middle in found.values())


@pytest.mark.parametrize("content", [b"", b"rubbish", b"PK\x03\x04rubbish"])
def test_a_damaged_press_is_named(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "press-000.npz").write_bytes(content)
    with pytest.raises(InputError, match=r"press-000\.npz is no press of a scan"):
        Scan(tmp_path)


def test_one_press_has_no_seams(recording: Path, tmp_path: Path) -> None:
    """JSON has no NaN, and a sentence needs none."""
    done = invoke("scan", tmp_path / "part", "--recording", recording, "--presses", "1", "--json")
    assert json.loads(done.stdout, parse_constant=pytest.fail)["seam_um"] is None
    again = invoke("scan", tmp_path / "again", "--recording", recording, "--presses", "1")
    assert "press 0: " in again.stderr
    assert "the gel reached" in again.stdout
    assert "differ by" not in again.stdout


def test_a_recording_becomes_a_map_though_the_scan_was_killed(recording: Path, tmp_path: Path) -> None:
    """By SIGKILL, as soon as the first press is there: the same command adds the second one, and none twice."""
    folder = tmp_path / "part"
    command = [*GELLIGHT, "scan", str(folder), "--recording", str(recording)]
    with started(command, stderr=subprocess.DEVNULL) as program:
        eventually((folder / "press-000.npz").exists, 120)
        program.kill()
        program.wait()
    assert len(Scan(folder).views) >= 1
    done = gellight("scan", folder, "--recording", recording, "--json")
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)
    assert (result["presses"], result["not_joined"]) == (2, [])
    assert result["seam_um"] < 4
    assert load_height_map(folder / MAP).reached.any()
    assert (folder / "map.png").read_bytes().startswith(b"\x89PNG")


def test_a_recording_without_a_press_is_refused(tmp_path: Path) -> None:
    record(tmp_path / "none.mcap", [untouched()])
    done = gellight("scan", tmp_path / "part", "--recording", tmp_path / "none.mcap")
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert "has no press that was held still" in done.stderr
    assert not (tmp_path / "part").exists()
