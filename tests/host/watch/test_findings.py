"""What is told, and from which size on: each limit from both sides, in numbers of its own."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from gellight.frames.measures import STEEP
from gellight.watch.expected import ExpectedError
from gellight.watch.explanation import Explanation
from gellight.watch.findings import (
    advice,
    guessed_contact,
    impossible_depth,
    light_findings,
    spot_finding,
    unseen_contact,
)
from gellight.watch.spots import Spot, SpotKind, SpotTracker

CELLS = (30, 40)
EVEN = {"size_grey": 9.0, "left_grey": 0.0, "gains": (1.0, 1.0, 1.0)}
NO_ERROR = dict.fromkeys(("zero_deg", "zero_mm", "zero_most_mm", "gain_deg", "gain_mm"), 0.0)


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"leds": {3: 0.14}}, "led_dead fault"),
        ({"leds": {3: 0.16}}, "led_dimmed warning"),
        ({"leds": {3: 0.89}}, "led_dimmed warning"),
        ({"leds": {3: 0.91}}, ""),
        ({"gains": (1.0, 0.971, 1.0)}, ""),
        ({"gains": (1.0, 1.0, 1.029)}, ""),
        ({"gains": (1.01, 0.969, 1.0)}, "drift notice"),
        ({"gains": (1.031, 1.0, 1.0)}, "drift notice"),
        ({"gains": (1.0, 0.901, 1.0)}, "drift notice"),
        ({"gains": (1.0, 0.899, 1.0)}, "drift warning"),
        ({"shift_px": (0.29, -0.29)}, ""),
        ({"shift_px": (0.0, -0.31)}, "camera_moved warning"),
        ({"shift_px": (0.31, 0.0)}, "camera_moved warning"),
        ({"left_grey": 0.99}, ""),
        ({"left_grey": 1.01}, "uneven warning"),
    ],
)
def test_what_light_and_place_have_changed_is_told_from_a_size_on(change: dict[str, Any], told: str) -> None:
    found = light_findings(Explanation(**{**EVEN, **change}), (0.1, 0.1))
    assert [f"{one.kind} {one.severity}" for one in found] == list(filter(None, [told]))


@pytest.mark.parametrize(("left_grey", "told"), [(3.15, 0), (3.18, 1)])
def test_what_the_gel_at_rest_differs_by_in_any_case_is_not_told(left_grey: float, told: int) -> None:
    explanation = Explanation(**{**EVEN, "left_grey": left_grey})
    assert len(list(light_findings(explanation, (0.1, 0.1), 2.0))) == told


@pytest.mark.parametrize(
    ("error", "told"),
    [
        ({"zero_deg": 0.99, "zero_mm": 0.049, "gain_deg": 0.99, "gain_mm": 0.049, "zero_most_mm": 9.0}, []),
        ({"zero_deg": 1.01}, ["zero_off"]),
        ({"zero_mm": 0.051}, ["zero_off"]),
        ({"gain_deg": 1.01}, ["recalibrate"]),
        ({"gain_mm": 0.051}, ["recalibrate"]),
    ],
)
def test_advice_is_given_where_an_error_is_worth_it(error: dict[str, float], told: list[str]) -> None:
    assert [one.kind for one in advice(ExpectedError(**{**NO_ERROR, **error}))] == told


def test_a_spot_is_told_in_millimetres_from_the_middle_of_the_picture() -> None:
    spot = Spot(kind=SpotKind.TEAR, row=10.0, column=20.0, cells=3, light=(0.5, 0.5, 0.5))
    figures = spot_finding(spot, (240, 320), (0.1, 0.2)).figures
    assert (figures["x_mm"], figures["y_mm"], figures["area_mm2"]) == (0.4, -7.2, 3.84)


# ---- spots ----


def lasts(*, seconds: float = 9.0, releases: int = 3, cells: int = 4, away: int = 5, breaks: int = 0) -> bool:
    """Whether a spot is one after so many touches of so many cells that ended so far from it, and so many breaks."""
    tracker, nothing = SpotTracker(CELLS), np.zeros(CELLS, bool)
    spot, touched = nothing.copy(), nothing.copy()
    tracker.note(nothing, -1.0)
    spot[10, 8:11] = True
    touched[10, 10 + away : 10 + away + cells] = True
    for number in range(releases):
        tracker.note(spot | touched, 0.1 * number)
        tracker.note(spot, 0.1 * number + 0.05)
    for _ in range(breaks):
        tracker.note(nothing, 1.0)
        tracker.note(spot, 1.1)
    tracker.note(spot, seconds + breaks)
    assert not tracker.lasting[~spot].any()
    return bool(tracker.lasting[spot].all())


@pytest.mark.parametrize(
    ("history", "spot"),
    [
        ({}, True),
        ({"seconds": 7.9}, False),
        ({"seconds": 8.0}, True),
        ({"releases": 2}, False),
        ({"cells": 3}, False),
        ({"away": 4}, False),
        ({"breaks": 1, "seconds": 20.0}, False),
    ],
)
def test_a_spot_outlasts_some_touches_elsewhere_and_some_seconds(history: dict[str, Any], spot: bool) -> None:
    assert lasts(**history) == spot


def test_the_cells_beside_a_spot_belong_to_it() -> None:
    tracker, spot = SpotTracker(CELLS), np.zeros(CELLS, bool)
    spot[10, 8:11] = True
    for number in range(5):
        tracker.note(spot | (np.indices(CELLS)[0] > 25), 4.0 * number)
        tracker.note(spot, 4.0 * number + 1)
    assert np.flatnonzero(tracker.around[10]).tolist() == list(range(6, 13))


@pytest.mark.parametrize(("cells", "told"), [(2, 0), (3, 1), (72, 1), (73, 0)])
def test_what_is_too_small_or_too_large_is_no_spot(cells: int, told: int) -> None:
    tracker = SpotTracker(CELLS)
    tracker.lasting = np.arange(1200).reshape(CELLS) < cells
    assert len(tracker.spots(np.zeros((*CELLS, 3), np.float32), np.ones((*CELLS, 3), np.float32))) == told


@pytest.mark.parametrize(
    ("light", "kind"),
    [
        ((0.64, 0.64, 0.64), SpotKind.TEAR),
        ((0.66, 0.5, 0.5), SpotKind.DIRT),
        ((0.91, 0.91, 0.5), SpotKind.DIRT),
        ((0.93, 0.5, 0.5), SpotKind.STUCK),
        ((1.07, 1.5, 1.5), SpotKind.STUCK),
        ((1.09, 1.09, 1.09), SpotKind.TEAR),
    ],
)
def test_the_light_of_a_spot_tells_what_it_is(light: tuple[float, ...], kind: SpotKind) -> None:
    tracker, reference = SpotTracker(CELLS), np.full((*CELLS, 3), 100, np.float32)
    tracker.lasting = np.arange(1200).reshape(CELLS) < 5
    (spot,) = tracker.spots((np.array(light, np.float32) - 1) * reference, reference)
    assert (spot.kind, spot.light) == (kind, pytest.approx(light))


# ---- what can be ----


@pytest.mark.parametrize(("guessed", "told"), [(6, 0), (7, 1)])
def test_a_contact_is_a_guess_where_most_of_it_is(guessed: int, told: int) -> None:
    some = np.arange(10) < guessed
    flags, contact = np.where(some, STEEP, 0).astype(np.uint8), SimpleNamespace(mask=np.ones(10, bool))
    measures = SimpleNamespace(never_seen=lambda image, pixels: some[pixels])
    frame: Any = SimpleNamespace(contact=contact, confidence=SimpleNamespace(quality_flags=flags), measures=measures,
                                 camera_frame=SimpleNamespace(image=None))  # fmt: skip
    for found in (list(guessed_contact(frame)), list(unseen_contact(frame))):
        assert [one.figures["guessed"] for one in found] == [0.7] * told


def test_of_a_large_contact_some_pixels_tell_and_no_gel_is_pressed_deeper_than_it_is_thick() -> None:
    asked: list[int] = []
    measures = SimpleNamespace(never_seen=lambda image, pixels: (asked.append(len(pixels)), np.zeros(1))[1])
    frame: Any = SimpleNamespace(contact=SimpleNamespace(mask=np.ones((60, 100), bool)), measures=measures,
                                 camera_frame=SimpleNamespace(image=None))  # fmt: skip
    assert not list(unseen_contact(frame))
    assert asked == [2000]
    frames: list[Any] = [SimpleNamespace(contact=SimpleNamespace(indentation_mm=depth)) for depth in (4.99, 5.01)]
    assert [len(list(impossible_depth(frame, 5.0))) for frame in frames] == [0, 1]
    assert not list(impossible_depth(frames[1], None))
