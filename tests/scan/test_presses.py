"""Presses in a stream of frames: each is taken once, while it is still and deepest."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from gellight.base.errors import InputError
from gellight.frames.frames import TactileFrame
from gellight_scan import touches
from gellight_scan.contact_view import reached_by
from gellight_scan.presses import PressWatcher, presses_in
from gellight_scan.scan_files import path_of, read_presses, write_press
from tests.helpers.tactile import HILL
from tests.helpers.tactile import hill_frame as frame


def deepest(depths: list[float]) -> list[float]:
    watcher = PressWatcher()
    fed = [watcher.feed(frame(deep)) for deep in depths]
    return [round(float(view.depth_mm.max()), 3) for view in [*fed, watcher.end()] if view is not None]


def test_a_press_is_taken_when_it_is_lifted_as_it_was_while_still() -> None:
    assert deepest([0, 0.2, 0.5, 0.5, 0.5, 0.5, 0.3, 0, 0]) == [0.5]
    assert deepest([0, 0.4, 0.4, 0.4, 0, 0.6, 0.6, 0.6]) == [0.4, 0.6]


def test_of_a_press_that_goes_deeper_the_deepest_is_taken() -> None:
    assert deepest([0.4, 0.4, 0.4, 0.6, 0.7, 0.7, 0.7, 0.5, 0.5, 0.5, 0]) == [0.7]


def test_what_is_never_still_or_hardly_pressed_is_no_press() -> None:
    assert deepest([0, 0.2, 0.3, 0.4, 0.5, 0.4, 0.2, 0]) == []
    assert (deepest([0.079] * 9), deepest([0.081] * 9)) == ([], [0.081])
    assert (deepest([0.5] * 2), deepest([0.5] * 3)) == ([], [0.5])


@pytest.mark.parametrize("thickness_mm", [1.5, None])
def test_a_press_is_looked_at_with_the_thickness_of_the_gel_it_was_made_in(
    thickness_mm: float | None, tmp_path: Path
) -> None:
    seen = frame(0.5)
    assert seen.provenance is not None
    made = replace(seen.provenance, gel_thickness_mm=thickness_mm)
    (view,) = presses_in(iter([replace(seen, provenance=made)] * 3))
    write_press(path_of(tmp_path, 0, "press"), view, [])
    kept = read_presses(tmp_path, "press")[0][0]
    for one in (view, kept):
        assert one.thickness_mm == thickness_mm
        assert (one.reached == reached_by(view.depth_mm, view.pixel_size_mm, thickness_mm)).all()
    assert (view.reached != reached_by(view.depth_mm, view.pixel_size_mm, 5.0)).any() is np.bool_(bool(thickness_mm))


def level(left_mm: float, right_mm: float) -> TactileFrame:
    """A frame of two halves, each of one depth."""
    one = frame(max(left_mm, right_mm))
    depth = np.full_like(one.depth_mm, left_mm)
    depth[:, depth.shape[1] // 2 :] = right_mm
    return replace(one, depth_mm=depth)


@pytest.mark.parametrize(
    ("left_mm", "right_mm", "still"),
    [
        ([0.5, 0.5029, 0.5058], [0.5, 0.5029, 0.5058], True),
        ([0.5, 0.5031, 0.5062], [0.5, 0.5031, 0.5062], False),
        ([0.5, 0.4971, 0.4942], [0.5, 0.4971, 0.4942], True),
        ([0.5, 0.4969, 0.4938], [0.5, 0.4969, 0.4938], False),
        ([0.5] * 3, [0.039, 0.0, 0.039], True),
        ([0.5] * 3, [0.041, 0.0, 0.041], False),
        ([0.5] * 3, [0.0, 0.041, 0.0], False),
    ],
    ids=["slow", "fast", "slowly up", "fast up", "unpressed moves", "pressed moves", "becomes pressed"],
)
def test_a_press_is_still_while_what_is_pressed_moves_by_3_um_a_frame_at_most(
    left_mm: list[float], right_mm: list[float], still: bool
) -> None:
    watcher = PressWatcher()
    for left, right in zip(left_mm, right_mm, strict=True):
        watcher.feed(level(left, right))
    assert watcher.settled is still


def test_the_mean_is_that_of_the_last_eight_frames() -> None:
    watcher = PressWatcher()
    for deep in (0.5, *[0.501] * 8):
        watcher.feed(level(deep, deep))
    assert watcher.end().depth_mm.max() == pytest.approx(0.501, abs=1e-6)
    for deep in (0.5, *[0.501] * 7):
        watcher.feed(level(deep, deep))
    assert watcher.end().depth_mm.max() == pytest.approx(0.500875, abs=1e-6)


@pytest.mark.parametrize(("later_mm", "taken_mm"), [(0.491, 0.491), (0.489, 0.5)])
def test_a_press_that_sinks_by_two_hundredths_is_as_deep_and_later(later_mm: float, taken_mm: float) -> None:
    assert deepest([*[0.5] * 3, *[later_mm] * 3, 0]) == [taken_mm]


@pytest.mark.parametrize(("covered", "count"), [(0.84, 3), (0.86, 1)])
def test_a_touch_is_taken_where_less_than_85_percent_of_the_last_one_is_covered(
    covered: float, count: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    followed = SimpleNamespace(pose=SimpleNamespace(lost=False, number=1, motion=np.eye(4)))
    follower = SimpleNamespace(follow=lambda frame: followed)
    monkeypatch.setattr(touches, "ObjectFollower", lambda **how: follower)
    monkeypatch.setattr(touches, "covered", lambda *views: covered)
    assert len(list(touches.touches_in(iter([frame(0.5)] * 3)))) == count


def test_the_mean_of_still_frames_has_less_noise() -> None:
    watcher = PressWatcher()
    for seed in range(8):
        assert watcher.feed(frame(0.5, 0.002, seed)) is None
    assert watcher.settled
    view = watcher.end()
    assert (view.depth_mm - 0.5 * HILL).std() < 0.002 / np.sqrt(8) * 1.2


def test_frames_without_depth_are_refused() -> None:
    blind = frame(0.5)
    contact = replace(blind.contact, indentation_mm=float("nan"))
    with pytest.raises(InputError, match="no calibration"):
        PressWatcher().feed(replace(blind, contact=contact))


def test_a_hand_hears_that_a_press_was_lifted_before_the_press_is_out() -> None:
    heard: list[str] = []
    frames = (frame(deep) for deep in (0, 0.5, 0.5, 0.5, 0.0, 0.5))
    next(presses_in(frames, tell=heard.append))
    assert heard == ["hold", "lift", "press"]
