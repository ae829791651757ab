"""Two views of one surface with a formula: the motion is found, and what cannot be told is said."""

import numpy as np
import pytest
from scipy.stats import chi2

from gellight.tracking.information import agreement, information
from gellight.tracking.registration import SCALE, Keyframe, hold, register
from gellight.tracking.rigid import inverse, pose_of, twist_of
from gellight.tracking.tracker import right
from tests.helpers.moving import Height, ball, bar, moved, noisy, other, relief, seen

MOTIONS = [moved(0.3, -0.2, (0, 0, 0)), moved(0.1, 0.1, (2, -3, 5)), moved(0, 0, (-1, 2, -6), z=0.1)]


@pytest.mark.parametrize("motion", MOTIONS)
def test_the_motion_of_a_relief_is_found(motion: np.ndarray) -> None:
    key, view = Keyframe(seen(relief)), seen(relief, motion)
    found = register(key, view, np.eye(4))
    assert found is not None
    off = twist_of(inverse(motion) @ found.pose, key.centre_mm)
    assert np.linalg.norm(off[:3]) < 0.002
    assert np.degrees(np.linalg.norm(off[3:])) < 0.05
    assert right(agreement(key, view, found))
    assert information(key, view, found).told.shape[1] == 6


@pytest.mark.parametrize(("height", "hidden"), [(ball, 3), (bar, 2), (relief, 0)])
def test_what_a_surface_hides_is_said(height: Height, hidden: int) -> None:
    """A ball tells no turn about its middle, a bar no slide along it and no roll."""
    key, view = Keyframe(seen(height, noise=0.003)), seen(height, moved(0.1, 0.05, (0, 0, 0)), noise=0.003, seed=1)
    found = register(key, view, np.eye(4))
    assert found is not None
    told = information(key, view, found).told
    assert told.shape[1] == 6 - hidden
    below = np.array([0, 0, -4.0]) - key.centre_mm  # the middle of the ball, the axis of the bar
    spins = [np.array([*-np.cross(axis, below), *axis]) * SCALE for axis in np.eye(3)]
    secret = {ball: spins, bar: [np.eye(6)[0], spins[0]], relief: []}[height]
    for twist in secret:
        assert np.linalg.norm(told.T @ twist) < 0.15 * np.linalg.norm(twist)


def test_a_smooth_ball_slides_and_does_not_roll() -> None:
    key, view = Keyframe(seen(ball)), seen(ball, moved(0.3, 0.0, (0, 0, 0)))
    found = register(key, view, np.eye(4))
    assert found is not None
    held = hold(key, view, np.eye(4), found, information(key, view, found).told)
    assert held is not None
    motion = twist_of(held.pose, key.centre_mm)
    assert motion[:3] == pytest.approx([0.3, 0, 0], abs=0.01)
    assert np.degrees(np.linalg.norm(motion[3:])) < 0.3


def test_nine_of_ten_errors_lie_within_the_ellipsoid_that_is_stated_for_them() -> None:
    """With noise in each pixel, and with errors that no residual shows, for all of the contact shares them."""
    motion, squares = MOTIONS[1], []
    first, second = seen(relief), seen(relief, motion)
    for seed in range(60):
        key, view = Keyframe(noisy(first, 0.005, 2 * seed)), noisy(second, 0.005, 2 * seed + 1, shared=0.006)
        found = register(key, view, motion)
        assert found is not None
        off = twist_of(inverse(motion) @ found.pose, key.centre_mm) * SCALE
        squares.append(off @ np.linalg.solve(information(key, view, found).covariance, off))
    assert np.mean(np.array(squares) < chi2.ppf(0.9, 6)) > 0.85
    assert np.median(squares) > 0.5  # and it is not so large that it says nothing


def test_another_object_does_not_agree() -> None:
    key, view = Keyframe(seen(relief)), seen(other)
    found = register(key, view, np.eye(4))
    assert found is None or not right(agreement(key, view, found))


def test_a_motion_beyond_the_view_is_none() -> None:
    key = Keyframe(seen(relief))
    assert register(key, seen(relief), pose_of(np.array([30.0, 0, 0, 0, 0, 0]))) is None
