"""Rigid motions: what twists mean, and that they stay rigid."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gellight.frames.pose import ObjectPose
from gellight.tracking.rigid import carried, inverse, moved_twists, pose_of, rotation_of, turn_of, twist_of, upheld

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
        pose = upheld(pose @ step)
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
