"""Where all presses lie on the part: the poses that agree best with what pairs of them told.

Every joint of two presses is a measured motion with a covariance; the poses make the sum of their squared errors least,
by Gauss-Newton on rigid motions with SciPy's sparse solver (a library for larger graphs would have to be installed for
some dozens of presses). A joint that is wrong contradicts those around it. Graduated non-convexity finds it: joints
with large errors lose weight, mildly at first and ever more strictly, until each counts or does not (Yang, Antonante,
Tzoumas and Carlone, IEEE RA-L 5, 2020, truncated least squares). A press that hangs on a single joint has nothing that
could contradict it.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix
from scipy.sparse.linalg import spsolve
from scipy.special import chdtri

from gellight_scan.pairs import Joint
from gellight_scan.tracking.rigid import inverse, moved_twists, orthonormal, pose_of, twist_of

Array = NDArray[np.float64]
LIMIT = float(chdtri(6, 0.001))
"""of the squared error of a joint, by its covariance: beyond it hardly any right one lies"""
STRICTER = 1.4
"""by so much in each round"""
MOST_ROUNDS = 60
LEFT_OUT = 0.5
"""a joint with less weight is taken for wrong"""
MOST_STEPS, SETTLED = 10, 1e-6
LEAST_WEIGHT = 1e-6
"""of a joint that does not count: a press that hangs on it alone still has a place"""


@dataclass(frozen=True, eq=False)
class Solved:
    """The poses of the presses that hang together."""

    poses: Mapping[int, Array]
    """(4, 4) of each press by its number: carries points of the press to the part, which are those of the first one"""
    weights: tuple[float, ...]
    """of each joint, 1 to 0"""


def solve(joints: Sequence[Joint], first: int) -> Solved:
    """Return where the presses lie that joints connect with press `first`; weights are those of all joints."""
    poses = connected(joints, first)
    used = [number for number, joint in enumerate(joints) if joint.one in poses]
    weights = np.ones(len(joints))
    if used and len(poses) > 1:
        chosen = [joints[number] for number in used]
        poses, found = _robust(chosen, poses, first)
        weights[used] = found
    return Solved(poses, tuple(float(weight) for weight in weights))


def connected(joints: Sequence[Joint], first: int) -> dict[int, Array]:
    """Return first poses of all presses that hang on `first`, along the joints with the largest overlap."""
    poses = {first: np.eye(4)}
    ordered = sorted(joints, key=lambda joint: -joint.common_mm2)
    while True:
        following = next((joint for joint in ordered if (joint.one in poses) != (joint.other in poses)), None)
        if following is None:
            return poses
        if following.one in poses:
            poses[following.other] = poses[following.one] @ inverse(following.pose)
        else:
            poses[following.one] = poses[following.other] @ following.pose


def _robust(joints: list[Joint], poses: dict[int, Array], first: int) -> tuple[dict[int, Array], Array]:
    """Return poses and the weight of each joint."""
    poses = _least_squares(joints, np.ones(len(joints)), poses, first)
    squares = _squares(joints, poses)
    if squares.max() <= LIMIT:
        return poses, np.ones(len(joints))
    strict = LIMIT / (2 * squares.max() - LIMIT)
    weights = _truncated(squares, strict)
    for _ in range(MOST_ROUNDS):
        poses = _least_squares(joints, weights, poses, first)
        squares, strict = _squares(joints, poses), strict * STRICTER
        weights = _truncated(squares, strict)
        if ((weights == 0) | (weights == 1)).all():
            break
    return _least_squares(joints, weights, poses, first), weights


def _truncated(squares: Array, strict: float) -> Array:
    """Return weights: 1 up to a limit, 0 beyond a second one, which both go to `LIMIT` the stricter it is."""
    between = np.sqrt(LIMIT / np.maximum(squares, 1e-12) * strict * (strict + 1)) - strict
    low, high = strict / (strict + 1) * LIMIT, (strict + 1) / strict * LIMIT
    return np.where(squares <= low, 1.0, np.where(squares >= high, 0.0, between))


def errors(joints: Sequence[Joint], poses: Mapping[int, Array]) -> Array:
    """Return (K, 6) by how many standard deviations poses are off each joint, along six independent twists."""
    off = [
        twist_of(inverse(joint.pose) @ inverse(poses[joint.other]) @ poses[joint.one], joint.centre_mm)
        for joint in joints
    ]
    return np.stack([_whitened(joint, one) for joint, one in zip(joints, off, strict=True)])


def _whitened(joint: Joint, values: Array) -> Array:
    return np.asarray(np.linalg.solve(np.linalg.cholesky(joint.covariance), values))


def _squares(joints: Sequence[Joint], poses: Mapping[int, Array]) -> Array:
    return np.asarray((errors(joints, poses) ** 2).sum(axis=1))


def _least_squares(joints: Sequence[Joint], weights: Array, poses: Mapping[int, Array], first: int) -> dict[int, Array]:
    """Return the poses of least weighted errors, near given ones; that of `first` stays."""
    free = [number for number in poses if number != first]
    place = {number: 6 * index for index, number in enumerate(free)}
    jacobian = _jacobian(joints, place, weights)
    roots = np.sqrt(np.maximum(weights, LEAST_WEIGHT))[:, None]
    moved = dict(poses)
    for _ in range(MOST_STEPS):
        pull = jacobian.T @ (roots * errors(joints, moved)).ravel()
        step = -np.asarray(spsolve((jacobian.T @ jacobian).tocsc(), pull)).reshape(-1, 6)
        for number, one in zip(free, step, strict=True):
            moved[number] = orthonormal(moved[number] @ pose_of(one))
        if np.abs(step).max() < SETTLED:
            break
    return moved


def _jacobian(joints: Sequence[Joint], place: Mapping[int, int], weights: Array) -> csr_matrix:
    """Return (6 K, 6 N) of the errors, by twists of the presses about their own middles, where the errors are small."""
    blocks: list[tuple[int, int, Array]] = []
    for row, (joint, weight) in enumerate(zip(joints, np.maximum(weights, LEAST_WEIGHT), strict=True)):
        back, root = inverse(joint.pose), np.sqrt(weight)
        turned = (
            (joint.one, np.eye(3), joint.centre_mm, 1),
            (joint.other, back[:3, :3], joint.centre_mm - back[:3, 3], -1),
        )
        for number, rotation, lever, sign in turned:
            if number in place:
                blocks.append((6 * row, place[number], sign * root * _whitened(joint, moved_twists(rotation, lever))))
    rows, columns = (np.concatenate([np.repeat(np.arange(6), 6) + block[0] for block in blocks]),
                     np.concatenate([np.tile(np.arange(6), 6) + block[1] for block in blocks]))  # fmt: skip
    values = np.concatenate([block[2].ravel() for block in blocks])
    return csr_matrix((values, (rows, columns)), shape=(6 * len(joints), 6 * len(place)))
