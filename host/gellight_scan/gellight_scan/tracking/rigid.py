"""Rigid motions: a pose (4, 4) carries points in mm, a twist (6,) is a small one, translation first, then rotation.

A twist about a point c is the velocity of c and the rotation: exp of it moves c by the translation. Axes are x right,
y down, z towards the camera; they are left-handed, and the formulas below hold in them as they stand.
"""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
_SMALL_RAD = 1e-6


def cross_matrix(vector: Array) -> Array:
    """Return the (3, 3) that takes the cross product with `vector` from the left."""
    x, y, z = vector.tolist()
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def rotation_of(vector: Array) -> Array:
    """Return the rotation (3, 3) about a vector (3,), by its length in rad (Rodrigues)."""
    angle = float(np.linalg.norm(vector))
    if angle < _SMALL_RAD:
        small = cross_matrix(vector)
        return np.asarray(np.eye(3) + small + small @ small / 2)
    k = cross_matrix(vector / angle)
    return np.asarray(np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * k @ k)


def turn_of(rotation: Array) -> Array:
    """Return the vector (3,) about which a rotation (3, 3) turns, as long as its angle, 0 to pi rad."""
    skew = np.array([rotation[2, 1] - rotation[1, 2], rotation[0, 2] - rotation[2, 0], rotation[1, 0] - rotation[0, 1]])
    sine, cosine = float(np.linalg.norm(skew)) / 2, (float(np.trace(rotation)) - 1) / 2
    angle = float(np.arctan2(sine, cosine))
    if sine > _SMALL_RAD:
        return np.asarray(skew * (angle / (2 * sine)))
    if cosine > 0:
        return skew / 2
    # A half turn: the axis is the largest column of R + I.
    columns = rotation + np.eye(3)
    axis = columns[:, int(np.argmax(np.diag(columns)))]
    return np.asarray(axis * (angle / np.linalg.norm(axis)))


def pose_of(twist: Array, point_mm: Array | None = None) -> Array:
    """Return the pose of a twist about a point, default the origin: the point moves by the translation, all else turns.

    For a small twist this is the exponential map about the point; it differs from it in the second order.
    """
    pose = np.eye(4)
    pose[:3, :3] = rotation_of(twist[3:])
    point = np.zeros(3) if point_mm is None else point_mm
    pose[:3, 3] = point + twist[:3] - pose[:3, :3] @ point
    return pose


def twist_of(pose: Array, point_mm: Array | None = None) -> Array:
    """Return the twist (6,) about a point that `pose_of` makes the pose of."""
    point = np.zeros(3) if point_mm is None else point_mm
    return np.concatenate([pose[:3, :3] @ point + pose[:3, 3] - point, turn_of(pose[:3, :3])])


def inverse(pose: Array) -> Array:
    """Return the pose that takes a pose back."""
    back = np.eye(4)
    back[:3, :3] = pose[:3, :3].T
    back[:3, 3] = -back[:3, :3] @ pose[:3, 3]
    return back


def orthonormal(pose: Array) -> Array:
    """Return a pose whose rotation is one to the last digit, also after thousands of products."""
    rotation = pose[:3, :3]
    kept = pose.copy()
    kept[:3, :3] = rotation @ (1.5 * np.eye(3) - 0.5 * rotation.T @ rotation)
    return kept


def carried(pose: Array, points: Array) -> Array:
    """Return points (..., 3) moved by a pose."""
    return np.asarray(points @ pose[:3, :3].T + pose[:3, 3])


def moved_twists(rotation: Array, by_mm: Array) -> Array:
    """Return the (6, 6) that turns twists about a point into those about another one, in turned axes.

    A twist (v, w) about c in one frame is (R v + (R w) x d, R w) about the point d further on in a frame turned by R.
    """
    moved = np.zeros((6, 6))
    moved[:3, :3] = moved[3:, 3:] = rotation
    moved[:3, 3:] = -cross_matrix(by_mm) @ rotation
    return moved
