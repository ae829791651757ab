"""Two views of one object: the rigid motion between them, how well it is known, and what it cannot tell.

Points of the first view, chosen by what they tell, are carried to the second one, whose depth and slopes there are
carried back and compared. Gauss-Newton on both makes them equal; the Jacobian is that of the first view alone (inverse
compositional; Baker and Matthews, IJCV 56, 2004). With slopes s, normal a = (-s, 1), curvatures H, a point r from the
contact's centre and a twist (v, w):

    d depth  = a . (v + w x r)
    d slopes = (turn of the normal by w) - H (v + w x r), along x and y

What noise does to the curvatures looks like information. The curvatures of the two views have independent noise, so
J1'J2 of both has none of it on the average: what a direction tells is judged by that.
"""

from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from gellight.frames.pixel_grid import bounding_box
from gellight_scan.tracking.rigid import carried, inverse, orthonormal, pose_of, twist_of
from gellight_scan.tracking.view import View, at_pixels


class Loss(StrEnum):
    """Why a frame has no pose of the object."""

    LIFTED = "lifted"
    UNLIKE = "unlike"
    """no motion makes its relief agree with what was seen before"""
    UNTOLD = "untold"
    """it agrees, and may have moved along what its relief does not tell"""
    UNSURE = "unsure"
    """it agrees, and the errors of all frames since the first have grown beyond what may be believed"""


Array = NDArray[np.float64]
Bools = NDArray[np.bool_]
MOST_POINTS = 1000
LEAST_POINTS = 60
MOST_STEPS, STRICT_STEPS = 15, 8
"""with Huber's weights, and afterwards"""
LEVER_MM = 3.0
"""a turn of 1 rad counts as this many mm: half across a usual contact"""
NEARLY_MM, SETTLED_MM = 5e-3, 5e-4
"""steps are over when they are shorter"""
SLOPE_ERROR, DEPTH_ERROR_MM = 0.003, 0.01
"""what a good pixel is out by; of the depth for its weight beside the slopes: its errors go together"""
PLACE_ERROR_MM = 0.02
"""and where it lies: of what the coating blurs, and of what lies between pixels"""
LEAST_USUAL = np.array([0.5, 1.0])
OUTLIER = 3.0
"""times the usual: such a residual is one"""
HELD_STEPS = 3
TURNS_LEAST = np.array([0.1, 0.1, 0.1, 1.0, 1.0, 1.0])
"""how much more a turn is avoided than a slide, where nothing tells"""
WEAK = 1e-5
"""of the strongest direction: along weaker ones no step is taken"""
SCALE = np.array([1.0, 1.0, 1.0, LEVER_MM, LEVER_MM, LEVER_MM])
"""turns a twist into mm"""


class Keyframe:
    """A view that others are registered to: its points, chosen by what they tell, and their Jacobian."""

    def __init__(self, view: View, most_points: int = MOST_POINTS) -> None:
        """Choose the points of `view`."""
        self.view, self.centre_mm = view, view.centre_mm
        rows, columns = np.nonzero(view.touching)
        points = view.places(rows, columns)
        slopes = view.planes[rows, columns, 1:].astype(np.float64)
        curvatures = view.curvatures[rows, columns].astype(np.float64)
        errors = errors_of(curvatures)
        jacobian = jacobian_of(points - self.centre_mm, slopes, curvatures, errors)
        chosen = informative(jacobian, most_points)
        self.errors = errors[chosen]
        """(N, 3) what depth and slopes of a good pixel are out by"""
        self.inside = view.inside[rows, columns][chosen]
        self.points, self.slopes, self.curvatures = points[chosen], slopes[chosen], curvatures[chosen]
        self.jacobian = jacobian[chosen]
        """(N, 3, 6) of depth and slopes over their errors, by twists about the centre in mm"""

    @cached_property
    def texture(self) -> Array:
        """(N, 2) of the slopes, what no smooth curve explains: the rest beside a plane."""
        smooth = np.column_stack([np.ones(len(self.points)), self.points[:, :2] - self.centre_mm[:2]])
        return np.asarray(self.slopes - smooth @ np.linalg.lstsq(smooth, self.slopes, rcond=None)[0])

    @property
    def registrable(self) -> bool:
        """Whether it has enough points."""
        return len(self.points) >= LEAST_POINTS


def errors_of(curvatures: Array) -> Array:
    """Return what depth and slopes (N, 3) are out by: slopes also by where they lie, which counts where they change."""
    slope = np.hypot(SLOPE_ERROR, PLACE_ERROR_MM * np.sqrt((curvatures**2 * [0.5, 1, 0.5]).sum(axis=1)))
    return np.stack([np.full(len(slope), DEPTH_ERROR_MM), slope, slope], axis=1)


def jacobian_of(r: Array, slopes: Array, curvatures: Array, errors: Array) -> Array:
    """Return (N, 3, 6): depth and slopes over their errors, by twists in mm about the point that `r` (N, 3) is from."""
    sx, sy, zero, one = slopes[:, 0], slopes[:, 1], np.zeros(len(r)), np.ones(len(r))
    a = np.stack([-sx, -sy, one], axis=1)
    b_x = np.stack([curvatures[:, 0], curvatures[:, 1], zero], axis=1)
    b_y = np.stack([curvatures[:, 1], curvatures[:, 2], zero], axis=1)
    turned_x = np.stack([sx * sy, -(1 + sx**2), -sy], axis=1)
    turned_y = np.stack([1 + sy**2, -sx * sy, sx], axis=1)
    depth = np.concatenate([a, np.cross(r, a)], axis=1)
    slope_x = np.concatenate([-b_x, turned_x - np.cross(r, b_x)], axis=1)
    slope_y = np.concatenate([-b_y, turned_y - np.cross(r, b_y)], axis=1)
    return np.asarray(np.stack([depth, slope_x, slope_y], axis=1) / errors[:, :, None] / SCALE)


def informative(jacobian: Array, most: int) -> NDArray[np.intp]:
    """Return which of the points to take: half of them spread evenly, half by their leverage."""
    count = len(jacobian)
    if count <= most:
        return np.arange(count)
    flat = jacobian.reshape(-1, 6)
    information = flat.T @ flat
    inverted = np.linalg.pinv(information + 1e-6 * np.trace(information) * np.eye(6), hermitian=True)
    leverage = np.einsum("nij,nij->n", jacobian @ inverted, jacobian)
    share = np.cumsum(0.5 * leverage / leverage.sum() + 0.5 / count)
    return np.unique(np.searchsorted(share, (np.arange(most) + 0.5) / most).clip(max=count - 1))


@dataclass(frozen=True, eq=False)
class Compared:
    """The second view carried back to the points of the first one."""

    residuals: Array
    """(N, 3) of depth and slopes over their errors"""
    seen: Bools
    """(N,) where the second view touches the object too"""
    pixels: NDArray[np.float32]


def compare(key: Keyframe, view: View, pose: Array) -> Compared:
    """Carry the points of `key` to `view` by `pose`, and what is there back."""
    rotation = pose[:3, :3]
    there = carried(pose, key.points)
    pixels = view.pixels(there)
    found = view.sampled(view.planes, pixels)
    normals = np.stack([-found[:, 1], -found[:, 2], np.ones(len(found))], axis=1) @ rotation
    surface = np.stack([there[:, 0], there[:, 1], found[:, 0]], axis=1)
    moved = carried(inverse(pose), surface) - key.points
    depth = moved[:, 2] - (key.slopes * moved[:, :2]).sum(axis=1)
    slopes = -normals[:, :2] / np.maximum(normals[:, 2:], 0.2) - key.slopes
    residuals = np.concatenate([depth[:, None], slopes], axis=1) / key.errors
    return Compared(residuals, at_pixels(view.touching, pixels), pixels)


def weights_of(compared: Compared, *, strict: bool) -> tuple[Array, Array]:
    """Return weights (N, 3), 0 where nothing is seen, and the usual size (2,) of the residuals of depth and slopes.

    Outliers pull with constant strength, which finds the way from afar (Huber). strict: with ever less, which leaves
    out the gel beside the object (Geman and McClure).
    """
    seen, residuals = compared.seen, compared.residuals
    sizes = np.abs(residuals[:, 0]), np.hypot(residuals[:, 1], residuals[:, 2])
    middles = [float(np.median(size[seen])) for size in sizes]
    usual = np.maximum([1.48 * middles[0], 0.85 * middles[1]], LEAST_USUAL)
    each = [
        (1 + (size / (OUTLIER * one)) ** 2) ** -2.0 if strict else 1 / np.maximum(size / (OUTLIER * one), 1)
        for size, one in zip(sizes, usual, strict=True)
    ]
    depth, slope = ((seen * weight) / one**2 for weight, one in zip(each, usual, strict=True))
    return np.stack([depth, slope, slope], axis=1), usual


@dataclass(frozen=True, eq=False)
class Registration:
    """The motion between two views."""

    pose: Array
    """(4, 4) carries points of the first view to the second"""
    compared: Compared
    weights: Array
    """(N, 3) of the residuals"""
    usual: Array
    """(2,) size of the residuals of depth and slopes, over what a good pixel is out by"""
    steps: int

    @property
    def overlap(self) -> float:
        """Share of the points of the first view that the second one touches too."""
        return float(self.compared.seen.mean())


def register(
    key: Keyframe, view: View, start: Array, *, most_steps: int = MOST_STEPS, along: Array | None = None
) -> Registration | None:
    """Find the pose that carries `key` to `view`, from a pose near it; None where too little of it is seen.

    `along` (6, k): steps are sums of these twists about the centre of `key`, in mm. Default: of all.
    """
    pose, steps, strict, left = start, 0, along is not None, most_steps
    basis = np.eye(6) if along is None else along
    flat = key.jacobian.reshape(-1, 6) @ basis
    while True:
        compared = compare(key, view, pose)
        if np.count_nonzero(compared.seen) < LEAST_POINTS:
            return None
        weights, usual = weights_of(compared, strict=strict)
        w = weights.reshape(-1)
        strength, directions = np.linalg.eigh(flat.T @ (flat * w[:, None]))
        pull = directions.T @ (flat.T @ (w * compared.residuals.reshape(-1)))
        strong = strength > WEAK * strength[-1]
        step = basis @ directions[:, strong] @ (pull[strong] / strength[strong])
        length = float(np.linalg.norm(step))
        if strict and (left <= 0 or length < SETTLED_MM):
            return Registration(pose, compared, weights, usual, steps)
        pose = orthonormal(pose @ pose_of(step / SCALE, key.centre_mm))
        steps, left = steps + 1, left - 1
        if not strict and (left <= 0 or length < NEARLY_MM):
            strict, left = True, STRICT_STEPS


def hold(key: Keyframe, view: View, start: Array, found: Registration, told: Array) -> Registration | None:
    """Return a registration that did not move along twists that tell nothing, as seen from where it started.

    `told` (6, k): what is told, an orthonormal basis. Of all motions that explain the views this is the one that turns
    least: a smooth ball slides, and does not roll.
    """
    moved = twist_of(inverse(start) @ found.pose, key.centre_mm) * SCALE
    untold = np.linalg.svd(told, full_matrices=True)[0][:, told.shape[1] :]
    heavy = untold * TURNS_LEAST[:, None]
    moved -= untold @ np.linalg.lstsq(heavy, moved * TURNS_LEAST, rcond=None)[0]
    return register(key, view, start @ pose_of(moved / SCALE, key.centre_mm), most_steps=HELD_STEPS, along=told)


FLAT_MM = 40.0
"""a body with a larger radius does not roll"""
SPINS_RAD = np.radians([-20.0, -10.0, 10.0, 20.0])


def guesses(before: View, now: View) -> list[Array]:
    """Return poses that the motion from one view to the next may be near to; rest is the first."""
    contact = now.centre_mm - before.centre_mm
    relief = np.append(_relief_shift(before, now), contact[2])
    still = np.append(np.zeros(2), contact[2])
    guessed = [np.eye(4)]
    guessed += [_moved(before, shift, np.zeros(3)) for shift in (contact, relief)]
    radius_mm = _radius_mm(before)
    if radius_mm < FLAT_MM:
        for shift in (still, relief):
            x, y = (shift - contact)[:2] / radius_mm
            guessed.append(_moved(before, shift, np.array([-y, x, 0.0])))
    return guessed


def spins(before: View, now: View) -> list[Array]:
    """Return poses that move the contact to where it is now and turn it about z."""
    return [_moved(before, now.centre_mm - before.centre_mm, np.array([0, 0, angle])) for angle in SPINS_RAD]


def _moved(view: View, shift_mm: Array, turn_rad: Array) -> Array:
    return pose_of(np.concatenate([shift_mm, turn_rad]), view.centre_mm)


def _relief_shift(before: View, now: View) -> Array:
    """Return by how many mm along x and y the curvatures have moved, by phase correlation."""
    rows, columns = bounding_box(before.touching | now.touching, 4)
    parts = [
        np.ascontiguousarray(((view.curvatures[..., 0] + view.curvatures[..., 2]) * view.touching)[rows, columns])
        for view in (before, now)
    ]
    if min(parts[0].shape) < 8:
        return np.zeros(2)
    (x, y), _ = cv2.phaseCorrelate(*parts)
    return np.array([x * now.pixel_mm[0], y * now.pixel_mm[1]])


def _radius_mm(view: View) -> float:
    """Return the radius of the body by the mean of its curvatures."""
    if not view.inside.any():
        return np.inf
    mean = float((view.curvatures[..., 0] + view.curvatures[..., 2])[view.inside].mean()) / 2
    return 1 / max(-mean, 1e-6)
