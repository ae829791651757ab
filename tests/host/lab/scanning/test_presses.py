"""Presses in a stream of frames: each is taken once, while it is still and deepest."""

from dataclasses import replace

import numpy as np
import pytest

from gellight.base.errors import InputError
from gellight.lab.scanning.presses import STILL_FRAMES, PressWatcher, presses_in
from tests.helpers.hill_frames import HILL, frame


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
    assert deepest([0.05] * 9) == []
    assert deepest([0.5] * (STILL_FRAMES - 1)) == []


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
