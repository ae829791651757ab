"""Poses from joints: exact where these agree, and a joint that is wrong is found and left out."""

from dataclasses import replace

import numpy as np
import pytest

from gellight.lab.scanning.pairs import Joint
from gellight.lab.scanning.pose_graph import LEFT_OUT, connected, solve
from gellight.tracking.rigid import inverse, pose_of, twist_of

COVARIANCE = np.diag([0.01, 0.01, 0.005, 0.002, 0.002, 0.001]) ** 2


def truth(count: int = 8) -> list[np.ndarray]:
    """Presses on a ring, turned and tilted."""
    random = np.random.default_rng(3)
    poses = []
    for number in range(count):
        angle = 2 * np.pi * number / count
        twist = np.array([20 * np.cos(angle), 15 * np.sin(angle), 0, *random.normal(size=3) * [0.01, 0.01, 0.08]])
        poses.append(pose_of(twist))
    return [inverse(poses[0]) @ pose for pose in poses]


def joint(one: int, other: int, *, noise: np.random.Generator | None = None) -> Joint:
    pose = inverse(truth()[other]) @ truth()[one]
    if noise is not None:
        pose = pose @ pose_of(noise.normal(size=6) * np.sqrt(np.diag(COVARIANCE)))
    return Joint(one, other, pose, np.zeros(3), COVARIANCE, 50.0, 0.98)


def ring(noise: np.random.Generator | None = None) -> list[Joint]:
    near = [(one, (one + step) % 8) for one in range(8) for step in (1, 2)]
    return [joint(*sorted(pair), noise=noise) for pair in near]


def off(poses: dict, number: int) -> np.ndarray:
    return np.abs(twist_of(inverse(truth()[number]) @ poses[number]))


def test_joints_that_agree_are_met_exactly() -> None:
    solved = solve(ring(), 0)
    assert max(off(solved.poses, number).max() for number in range(8)) < 1e-6
    assert solved.weights == (1.0,) * 16


def test_a_loop_takes_away_what_a_chain_adds_up() -> None:
    """Errors along a chain of seven add up; closed to a ring and braced, they are less than half."""
    chain, closed = [], []
    for seed in range(8):
        joints = ring(np.random.default_rng(seed))
        along = [one for one in joints if one.other == one.one + 1]
        chain.append(off(solve(along, 0).poses, 7)[:2])
        closed.append(off(solve(joints, 0).poses, 7)[:2])
    assert np.sqrt(np.mean(np.square(closed))) < 0.5 * np.sqrt(np.mean(np.square(chain)))


@pytest.mark.parametrize("which", [0, 5, 15])
@pytest.mark.parametrize("by_mm", [0.3, 1.0, 8.0])
def test_one_wrong_joint_is_left_out(which: int, by_mm: float) -> None:
    """The poses are as good as without it, though the chain that they begin with may go through it."""
    joints = ring(np.random.default_rng(1))
    wrong = joints[which].pose.copy()
    wrong[0, 3] += by_mm
    spoilt = [*joints]
    spoilt[which] = replace(joints[which], pose=wrong, common_mm2=1000.0)
    solved = solve(spoilt, 0)
    assert [number for number, weight in enumerate(solved.weights) if weight < LEFT_OUT] == [which]
    without = solve(joints[:which] + joints[which + 1 :], 0)
    for number in range(8):
        np.testing.assert_allclose(solved.poses[number], without.poses[number], atol=0.004)


def test_what_hangs_on_nothing_has_no_place() -> None:
    """Presses 4 and 5 hang together, and on no other one."""
    joints = [joint(0, 1), joint(1, 2), joint(4, 5)]
    assert set(solve(joints, 0).poses) == {0, 1, 2}
    assert set(connected(joints, 4)) == {4, 5}
    assert solve([], 3).poses.keys() == {3}
