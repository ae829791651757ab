"""How well a registration is known, along which twists it tells nothing, and whether it is the right one.

Errors of neighbouring pixels are alike, so their pulls are added up over squares first: the covariance of the pull is
that of the squares' sums, which the residuals themselves show (White, Econometrica 48, 1980, in clusters). Errors that
are alike over all of the contact show in no residual: depth and slopes are taken to be out by a little everywhere and
ever more to one side. What a pull is worth is said by J1'J2 of both views, whose noise is independent; inside the
contact alone, for the blurred rim goes with the contact and not with the object.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gellight_scan.tracking.registration import HELD_STEPS, SCALE, Keyframe, Registration, jacobian_of, register
from gellight_scan.tracking.rigid import pose_of
from gellight_scan.tracking.view import View, at_pixels

Array = NDArray[np.float64]
SQUARE_MM = 1.0
"""errors of pixels in one square are alike"""
RANDOM = 2.0
"""by so much the error that the squares show is too small"""
SHARED = np.array([0.4, 0.6, 0.6])
"""errors of depth and slopes that all of the contact shares, over what a good pixel is out by"""
LEAST_MM = 0.01
"""no pose is better known, along any twist"""
TELLING = 1.0
"""J1'J2 of a pixel, over its usual residual: a twist that has less is not told"""
VAGUE_MM = 10.0
"""standard deviation along a twist that is not told: anything may be"""
FEWEST_INSIDE = 40
FAR_MM, UNLIKE = 1.5, 0.5
"""moved so far along what is not told, a plain object differs in slope by less, over what a good pixel is out by"""


@dataclass(frozen=True, eq=False)
class Information:
    """What a registration tells, by twists about the centre of the first view in its axes, in mm."""

    covariance: Array
    """(6, 6)"""
    told: Array
    """(6, k) orthonormal directions that are told"""
    weakest: float
    """how many times as much as it has to the weakest of all directions tells"""


def information(key: Keyframe, view: View, found: Registration) -> Information:
    """Return what a registration tells."""
    seen = found.compared.seen
    first, weights = key.jacobian[seen], found.weights[seen]
    there = curvatures_of(view, found)[seen]
    second = jacobian_of(key.points[seen] - key.centre_mm, key.slopes[seen], there, key.errors[seen])
    inside = key.inside[seen] & at_pixels(view.inside, found.compared.pixels)[seen]
    if np.count_nonzero(inside) < FEWEST_INSIDE:
        return Information(np.eye(6) * VAGUE_MM**2, np.zeros((6, 0)), 0.0)
    directions, telling = _told(first[inside], weights[inside], second[inside])
    strength = np.einsum("nij,ni,nik->jk", first, weights, second)
    across = directions.T @ (strength + strength.T) @ directions / 2
    pull = directions.T @ _pull(key, found) @ directions
    told = telling > TELLING
    covariance = np.diag(np.where(told, 0.0, VAGUE_MM**2))
    if told.any():
        inverse = np.linalg.inv(across[np.ix_(told, told)])
        known = inverse @ pull[np.ix_(told, told)] @ inverse.T + LEAST_MM**2 * np.eye(len(inverse))
        covariance[np.ix_(told, told)] = known
    return Information(directions @ covariance @ directions.T, directions[:, told], float(telling[0] / TELLING))


def looks_alike(key: Keyframe, view: View, found: Registration, told: Array) -> bool:
    """Say whether the object looks the same elsewhere along the twists that are not told, as a ball and a bar do.

    A faint relief tells nothing of a small step, and shows after a large one.
    """
    here = _slopes_off(found)
    untold = np.linalg.svd(told, full_matrices=True)[0][:, told.shape[1] :]
    for step in np.hstack([untold, -untold]).T * FAR_MM / SCALE:
        moved = register(key, view, found.pose @ pose_of(step, key.centre_mm), most_steps=HELD_STEPS, along=told)
        if moved is not None and _slopes_off(moved) > here + UNLIKE**2 * max(here, 1.0):
            return False
    return True


def _slopes_off(found: Registration) -> float:
    """Return the mean square of the slopes' residuals, over what a good pixel is out by."""
    return float((found.compared.residuals[found.compared.seen, 1:] ** 2).mean())


def _told(first: Array, weights: Array, second: Array) -> tuple[Array, Array]:
    """Return directions (6, 6), a column each, and J1'J2 of a pixel along each."""
    strength = np.einsum("nij,ni,nik->jk", first, weights, second)
    telling, directions = np.linalg.eigh((strength + strength.T) / 2 / len(first))
    return directions, telling


def _pull(key: Keyframe, found: Registration) -> Array:
    """Return the covariance (6, 6) of J1'e: of errors that neighbours share, and of those that all share."""
    seen = found.compared.seen
    weighted = key.jacobian[seen] * found.weights[seen][:, :, None]
    pulls = np.einsum("nij,ni->nj", weighted, found.compared.residuals[seen])
    squares = np.floor(key.points[seen, :2] / SQUARE_MM).astype(np.int64)
    _, number = np.unique(squares[:, 0] * 100_000 + squares[:, 1], return_inverse=True)
    sums = np.zeros((int(number.max()) + 1, 6))
    np.add.at(sums, number, pulls)
    near = sums.T @ sums * len(sums) / max(len(sums) - 6, 1)
    r = key.points[seen, :2] - key.centre_mm[:2]
    places = np.column_stack([np.ones(len(r)), r / max(float(np.abs(r).max()), 1e-3)])
    usual = np.sqrt((found.compared.residuals[seen] ** 2).mean(axis=0)) + 1
    shared = np.einsum("nij,nk,i->ikj", weighted, places, SHARED * usual).reshape(-1, 6)
    return np.asarray(RANDOM**2 * near + shared.T @ shared)


def curvatures_of(view: View, found: Registration) -> Array:
    """Return the (N, 3) curvatures of the second view, turned back about z."""
    xx, xy, yy = view.sampled(view.curvatures, found.compared.pixels).T
    turn = found.pose[:2, :2]
    tensor = turn.T @ np.stack([xx, xy, xy, yy], axis=1).reshape(-1, 2, 2) @ turn
    return np.stack([tensor[:, 0, 0], (tensor[:, 0, 1] + tensor[:, 1, 0]) / 2, tensor[:, 1, 1]], axis=1)


@dataclass(frozen=True, kw_only=True)
class Agreement:
    """How well two views agree where a registration lays them on each other."""

    overlap: float
    unlike: float
    """square of the residual slopes over that of the object's texture; two that have nothing in common: 1"""
    curvature: float
    """correlation of the curvatures; 1: alike"""
    slope: float
    """correlation of the slopes"""
    residual: float
    """rms of the slopes over what a good pixel is out by"""
    texture: float
    """rms of the slopes beyond a smooth curve, the same way"""


def agreement(key: Keyframe, view: View, found: Registration) -> Agreement:
    """Return how well the views agree."""
    seen = found.compared.seen
    residuals, weight = found.compared.residuals[seen, 1:], found.weights[seen, 1:2]
    slopes, texture = key.slopes[seen] / key.errors[seen, 1:], key.texture[seen] / key.errors[seen, 1:]
    left, there = float((residuals**2).mean()), float((texture**2).mean())
    return Agreement(
        overlap=found.overlap,
        unlike=left / max(2 * there, 1e-9),
        curvature=_correlation(key.curvatures[seen], curvatures_of(view, found)[seen], weight),
        slope=_correlation(slopes, slopes + residuals, np.ones_like(weight)),
        residual=left**0.5,
        texture=there**0.5,
    )


def _correlation(one: Array, other: Array, weight: Array) -> float:
    """Return the correlation of two (N, K) about their means, with weights (N, 1)."""
    total = max(float(weight.sum()), 1e-12)
    one, other = (values - (values * weight).sum(axis=0) / total for values in (one, other))
    sums = [float((weight * a * b).sum()) for a, b in ((one, other), (one, one), (other, other))]
    return sums[0] / max(math.sqrt(sums[1] * sums[2]), 1e-12)
