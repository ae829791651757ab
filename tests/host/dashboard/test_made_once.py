"""What is made once of what stays the same."""

from dataclasses import replace

import numpy as np

from gellight.dashboard.made_once import MadeOnce
from gellight.dashboard.messages import encode
from gellight.dashboard.reference_views import ReferenceViews
from tests.helpers.dashboard_source import PIXEL_MM, bump
from tests.helpers.view_messages import decode


def test_a_map_that_stays_the_same_is_packed_once() -> None:
    once, made = MadeOnce(), []
    flat = np.zeros(3)
    flat.flags.writeable = False
    for _ in range(3):
        assert once.of("depth", (flat, "truth"), lambda: made.append(1) or len(made)) == 1
    assert once.of("contact", (flat, "truth"), lambda: 7) == 7
    other = flat.copy()
    other.flags.writeable = False
    assert once.of("depth", (other, "truth"), lambda: 2) == 2
    assert once.of("depth", (flat, "truth"), lambda: 3) == 3


def test_a_map_that_may_change_is_packed_each_time_and_not_kept() -> None:
    once, taken = MadeOnce(), np.zeros(3)
    numbers = iter(range(9))
    assert [once.of("depth", (taken,), lambda: next(numbers)) for _ in range(3)] == [0, 1, 2]
    assert not once._made


def test_frames_at_rest_touched_and_at_rest_again_come_out_as_they_are() -> None:
    once, references = MadeOnce(), ReferenceViews()
    touched, rest = bump(1.2, 3.0, -2.0), bump(0.0, 0.0, 0.0)
    for array in (rest.depth_mm, rest.contact.mask):
        array.flags.writeable = False
    for frame in (rest, replace(rest), touched, rest):
        view = decode(encode(frame, pixel_size_mm=(PIXEL_MM, PIXEL_MM), references=references, once=once))
        assert np.abs(view.depth_mm - frame.depth_mm.reshape(240, 2, 320, 2).mean(axis=(1, 3))).max() < 0.3e-3
        assert view.contact.any() == frame.contact.mask.any()
