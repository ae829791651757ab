"""Two overlapping presses: the rigid motion between them, and whether it is to be believed.

What registers an object in the gel registers presses of a part too, but its rule for what is believed asks for more
overlap than presses beside each other have. Here a motion is believed where slopes agree over enough common gel, so
well that no other place that was tried comes near, and where no direction along the part is left open.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gellight_scan.contact_view import ContactView
from gellight_scan.search import LEAST_MM2, starts
from gellight_scan.tracking.information import Agreement, agreement, information
from gellight_scan.tracking.registration import MOST_STEPS, SCALE, Keyframe, Registration, register
from gellight_scan.tracking.rigid import carried, inverse
from gellight_scan.tracking.view import View, at_pixels

Array = NDArray[np.float64]
POINTS, COARSE_POINTS = 3000, 600
TRIED, TRIED_STEPS = 8, 6
LEAST_CORRELATION = 0.8
"""of the slopes"""
RIVAL, RIVAL_LEFT, RIVAL_AREA = 3.0, 0.02, 0.3
"""where another place leaves no more unexplained than so many times as much as the best one and a little, over a common
area that is not much smaller, nothing tells them apart"""
ELSEWHERE_MM = 0.5
"""from a place, another one begins"""
MOST_TILT = np.cos(np.radians(5.0))
"""between two presses of a flat part"""


@dataclass(frozen=True, eq=False)
class Joint:
    """What is known of two presses by their overlap."""

    one: int
    other: int
    """numbers of the presses"""
    pose: Array
    """(4, 4) carries points of press `one` to press `other`"""
    centre_mm: Array
    """(3,) of the overlap, in press `one`"""
    covariance: Array
    """(6, 6) of the pose, by twists about the centre: mm and rad"""
    common_mm2: float
    """gel that reached the part in both"""
    correlation: float
    """of the slopes there"""


@dataclass(frozen=True, eq=False)
class Fit:
    """A registration, and how well the presses agree by it."""

    key: Keyframe
    found: Registration
    agreement: Agreement
    common_mm2: float

    @property
    def left(self) -> float:
        """Share of the slopes that is left unexplained; less is better, wherever the overlap is."""
        return 1 - self.agreement.slope

    @property
    def right(self) -> bool:
        """Whether it may be believed by itself."""
        level = self.found.pose[2, 2] > MOST_TILT
        return level and self.common_mm2 >= LEAST_MM2 and self.agreement.slope >= LEAST_CORRELATION


def fit(one: View, other: View, start: Array, points: int = POINTS, *, most_steps: int = MOST_STEPS) -> Fit | None:
    """Register two views where `start` says that they overlap; None where they do not."""
    common = overlap(one, other, start)
    if np.count_nonzero(common) * one.pixel_mm[0] * one.pixel_mm[1] < LEAST_MM2:
        return None
    part = replace(one, touching=common, inside=common)
    key = Keyframe(part, points)
    if not key.registrable:
        return None
    found = register(key, other, _level(part, other, start), most_steps=most_steps)
    if found is None:
        return None
    area = float(np.count_nonzero(overlap(one, other, found.pose))) * one.pixel_mm[0] * one.pixel_mm[1]
    return Fit(key, found, agreement(key, other, found), area)


def overlap(one: View, other: View, pose: Array) -> NDArray[np.bool_]:
    """Return the (h, w) pixels of `one` that reached the part, as did those of `other` where a pose carries them."""
    rows, columns = np.nonzero(one.touching)
    both = at_pixels(other.touching, other.pixels(carried(pose, one.places(rows, columns))))
    common = np.zeros_like(one.touching)
    common[rows[both], columns[both]] = True
    return common


def _level(one: View, other: View, pose: Array) -> Array:
    """Return the pose with the height at which the gel of both views is equally deep."""
    rows, columns = np.nonzero(one.touching)
    every = len(rows) // POINTS + 1
    there = carried(pose, one.places(rows[::every], columns[::every]))
    depth = other.sampled(other.planes, other.pixels(there))[:, 0]
    levelled = pose.copy()
    levelled[2, 3] += float(np.median(depth - there[:, 2]))
    return levelled


def joined(one: tuple[int, ContactView], other: tuple[int, ContactView], guess: Array | None = None) -> Joint | None:
    """Return what is known of two presses by their overlap; None where it tells nothing that can be believed.

    guess: a pose (4, 4) that the motion from `one` to `other` is near to. Default: any place is looked at.
    """
    a, b = one[1].view, other[1].view
    if not (a.touching.any() and b.touching.any()):
        return None
    best = fit(a, b, guess) if guess is not None else _searched(a, b)
    if best is None or not best.right:
        return None
    best = fit(a, b, best.found.pose) or best  # over all that is common now
    told = information(best.key, b, best.found)
    if not best.right or told.told.shape[1] < len(SCALE):
        return None
    covariance = told.covariance / SCALE[:, None] / SCALE
    return Joint(
        one[0], other[0], best.found.pose, best.key.centre_mm, covariance, best.common_mm2, best.agreement.slope
    )


def _searched(one: View, other: View) -> Fit | None:
    """Return the best fit of all places; None where another one is nearly as good."""
    tried = [fit(one, other, start, COARSE_POINTS, most_steps=TRIED_STEPS) for start in starts(one, other, TRIED)]
    fits = sorted((each for each in tried if each is not None), key=lambda each: each.left)
    if not fits or not fits[0].right:
        return None
    best = fits[0]
    middle = best.key.centre_mm
    rivals = [
        each
        for each in fits[1:]
        if np.linalg.norm(carried(inverse(best.found.pose) @ each.found.pose, middle) - middle) > ELSEWHERE_MM
    ]
    near = [each for each in rivals if each.right and each.left < RIVAL * best.left + RIVAL_LEFT]
    return None if any(each.common_mm2 > RIVAL_AREA * best.common_mm2 for each in near) else best
