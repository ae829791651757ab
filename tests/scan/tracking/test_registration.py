"""Rigid motions, and two views of one surface with a formula: the motion is found, and what cannot be told is said."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from gellight.frames.pose import ObjectPose
from gellight_scan.tracking.information import Agreement, agreement, information
from gellight_scan.tracking.registration import SCALE, Keyframe, hold, register
from gellight_scan.tracking.rigid import (
    carried,
    inverse,
    moved_twists,
    orthonormal,
    pose_of,
    rotation_of,
    turn_of,
    twist_of,
)
from gellight_scan.tracking.tracker import agrees, is_certain
from tests.helpers.moving import Height, ball, bar, from_height, moved, noisy, other, relief, seen

MOTIONS = [moved(0.3, -0.2, (0, 0, 0)), moved(0.1, 0.1, (2, -3, 5)), moved(0, 0, (-1, 2, -6), z=0.1)]
RANDOM = np.random.default_rng(3)
POINT = np.array([1.0, -2.0, 0.7])


@pytest.mark.parametrize("angle", [0.0, 1e-8, 0.3, 3.0, np.pi - 1e-7, np.pi])
def test_a_turn_is_that_of_another_library(angle: float) -> None:
    axis = RANDOM.normal(size=3)
    vector = axis / np.linalg.norm(axis) * angle
    np.testing.assert_allclose(rotation_of(vector), Rotation.from_rotvec(vector).as_matrix(), atol=1e-9)
    np.testing.assert_allclose(rotation_of(turn_of(rotation_of(vector))), rotation_of(vector), atol=1e-6)


def test_a_twist_about_a_point_moves_the_point_by_its_translation() -> None:
    twist = np.array([0.1, 0.2, -0.3, 0.4, -0.1, 0.2])
    pose = pose_of(twist, POINT)
    np.testing.assert_allclose(carried(pose, POINT), POINT + twist[:3], atol=1e-12)
    np.testing.assert_allclose(twist_of(pose, POINT), twist, atol=1e-12)
    np.testing.assert_allclose(inverse(pose) @ pose, np.eye(4), atol=1e-12)


def test_thousands_of_products_stay_rigid() -> None:
    pose, step = np.eye(4), pose_of(np.array([0.01, 0, 0, 0.02, 0.03, 0.01]))
    step[:3, :3] *= 1 + 1e-6
    for _ in range(20_000):
        pose = orthonormal(pose @ step)
    np.testing.assert_allclose(pose[:3, :3] @ pose[:3, :3].T, np.eye(3), atol=1e-5)


def test_covariances_at_other_points_are_those_of_the_motion_there() -> None:
    """Against many small motions drawn at random, also where axes turn."""
    root = RANDOM.normal(size=(6, 6)) * 1e-4
    twists = RANDOM.normal(size=(4000, 6)) @ root.T
    rotation, by = rotation_of(np.array([0.4, 0.2, -0.5])), np.array([2.0, -1.0, 3.0])
    moved = moved_twists(rotation, by)
    there = twists[:, :3] @ rotation.T + np.cross(twists[:, 3:] @ rotation.T, by)
    np.testing.assert_allclose(
        twists @ moved.T, np.concatenate([there, twists[:, 3:] @ rotation.T], axis=1), atol=1e-12
    )
    pose = ObjectPose(number=1, since_sequence=0, motion=np.eye(4), origin_mm=POINT, centre_mm=POINT,
                      covariance=root @ root.T, untellable=np.zeros((0, 6)))  # fmt: skip
    beside = np.concatenate([twists[:, :3] + np.cross(twists[:, 3:], by), twists[:, 3:]], axis=1)
    np.testing.assert_allclose(pose.covariance_at(POINT + by), np.cov(beside.T), rtol=0.2, atol=4e-9)


@pytest.mark.parametrize("motion", MOTIONS)
def test_the_motion_of_a_relief_is_found(motion: np.ndarray) -> None:
    key, view = Keyframe(seen(relief)), seen(relief, motion)
    found = register(key, view, np.eye(4))
    off = twist_of(inverse(motion) @ found.pose, key.centre_mm)
    assert np.linalg.norm(off[:3]) < 0.002
    assert np.degrees(np.linalg.norm(off[3:])) < 0.05
    assert agrees(agreement(key, view, found))
    assert information(key, view, found).told.shape[1] == 6


@pytest.mark.parametrize(("told_mm", "least_mm", "most_mm"), [(53.12, 0, 2e-3), (0, 0.015, 0.03)])
def test_what_rolls_under_a_pinhole_moves_as_far_as_it_does(told_mm: float, least_mm: float, most_mm: float) -> None:
    """A relief on a ball of 5 mm, 1 mm deep, rolls 2 mm; it seems to roll .02 mm farther where nobody says so."""
    start, rolled = moved(-1, 0.5, (0, 0, 0)), moved(1, 0.5, (0, np.degrees(2 / 5), 0))
    key, view = (Keyframe(from_height(relief, pose, 53.12, told_mm)) for pose in (start, rolled))
    motion = rolled @ inverse(start)
    off = twist_of(inverse(motion) @ register(key, view.view, motion).pose, key.centre_mm)
    assert least_mm <= np.linalg.norm(off[:3]) < most_mm


@pytest.mark.parametrize(("height", "hidden"), [(ball, 3), (bar, 2), (relief, 0)])
def test_what_a_surface_hides_is_said(height: Height, hidden: int) -> None:
    """A ball tells no turn about its middle, a bar no slide along it and no roll."""
    key, view = Keyframe(seen(height, noise=0.003)), seen(height, moved(0.1, 0.05, (0, 0, 0)), noise=0.003, seed=1)
    found = register(key, view, np.eye(4))
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
    held = hold(key, view, np.eye(4), found, information(key, view, found).told)
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
        off = twist_of(inverse(motion) @ found.pose, key.centre_mm) * SCALE
        squares.append(off @ np.linalg.solve(information(key, view, found).covariance, off))
    assert np.mean(np.array(squares) < chi2.ppf(0.9, 6)) > 0.85
    assert np.median(squares) > 0.5  # and it is not so large that it says nothing


def test_another_object_does_not_agree() -> None:
    key, view = Keyframe(seen(relief)), seen(other)
    found = register(key, view, np.eye(4))
    assert found is None or not agrees(agreement(key, view, found))


def test_a_motion_beyond_the_view_is_none() -> None:
    key = Keyframe(seen(relief))
    assert register(key, seen(relief), pose_of(np.array([30.0, 0, 0, 0, 0, 0]))) is None


def agreed(**changes: float) -> Agreement:
    """What two views of one textured place agree in, with `changes`."""
    same = {"overlap": 1.0, "unlike": 0.0, "curvature": 1.0, "slope": 1.0, "residual": 0.5, "texture": 10.0}
    return Agreement(**{**same, **changes})


@pytest.mark.parametrize(
    ("within", "beyond"),
    [
        ({"overlap": 0.351}, {"overlap": 0.349}),
        ({"slope": 0.7, "curvature": 0.61}, {"slope": 0.7, "curvature": 0.59}),
        ({"slope": 0.7, "unlike": 0.49}, {"slope": 0.7, "unlike": 0.51}),
        ({"unlike": 0.6, "residual": 1.49}, {"unlike": 0.6, "residual": 1.51}),
        ({"unlike": 0.24, "residual": 9, "curvature": 0.5}, {"unlike": 0.26, "residual": 9, "curvature": 0.5}),
        ({"slope": 0.81, "curvature": 0.5}, {"slope": 0.79, "curvature": 0.5}),
        ({"curvature": 0.41}, {"curvature": 0.39}),
        ({"curvature": 0.3, "texture": 2.09}, {"curvature": 0.3, "texture": 2.11}),
        ({"curvature": 0.3, "residual": 1.0, "texture": 2.99}, {"curvature": 0.3, "residual": 1.0, "texture": 3.01}),
    ],
)
def test_where_two_views_cease_to_show_one_place(within: dict[str, float], beyond: dict[str, float]) -> None:
    assert (agrees(agreed(**within)), agrees(agreed(**beyond))) == (True, False)


@pytest.mark.parametrize(
    ("within", "beyond"),
    [
        ({"unlike": 0.2, "residual": 1.49}, {"unlike": 0.2, "residual": 1.51}),
        ({"unlike": 0.09, "residual": 1.55}, {"unlike": 0.11, "residual": 1.55}),
        ({"curvature": 0.76, "residual": 1.55}, {"curvature": 0.74, "residual": 1.55}),
        ({"residual": 1.59}, {"residual": 1.61}),
        ({"overlap": 0.351}, {"overlap": 0.349}),
    ],
)
def test_where_another_start_is_tried(within: dict[str, float], beyond: dict[str, float]) -> None:
    """The residual of this object is usually 1."""
    assert (is_certain(agreed(**within), 1.0), is_certain(agreed(**beyond), 1.0)) == (True, False)


@pytest.mark.parametrize(("points", "enough"), [(59, False), (60, True)])
def test_sixty_points_are_registered(points: int, enough: bool) -> None:
    key = Keyframe(seen(relief), points)
    assert len(key.points) == points
    assert (key.registrable, register(key, seen(relief), np.eye(4)) is not None) == (enough, enough)


@pytest.mark.parametrize(("count", "told"), [(39, 0), (40, 6)])
def test_forty_points_inside_the_contact_tell_a_motion(count: int, told: int) -> None:
    key, view = Keyframe(seen(relief)), seen(relief)
    found = register(key, view, np.eye(4))
    key.inside &= np.cumsum(key.inside & found.compared.seen) <= count
    assert information(key, view, found).told.shape[1] == told
