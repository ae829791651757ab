"""Follows the object in the gel from frame to frame, and says when it is lost.

Every frame is registered to a keyframe, the oldest that shows the same part of the object: errors do not add up while
it does. A new keyframe is made where the contact has moved on. What a registration found is believed where the relief
of both frames agrees; else other starts are tried, and where none agrees the object is lost. So it is where its relief
is too faint to tell where it is, and where the errors of keyframes have added up: what may be wrong is no pose.
"""

from collections import deque
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from gellight.frames.pose import DOUBTFUL_MM, DOUBTFUL_RAD, ObjectPose
from gellight_scan.tracking.information import VAGUE_MM, Agreement, Information, agreement, information, looks_alike
from gellight_scan.tracking.registration import (
    LEAST_POINTS,
    SCALE,
    Keyframe,
    Loss,
    Registration,
    guesses,
    hold,
    register,
    spins,
)
from gellight_scan.tracking.rigid import carried, inverse, moved_twists, orthonormal, pose_of, twist_of
from gellight_scan.tracking.view import View, at_pixels

Array = NDArray[np.float64]
GIVE_UP = 5
"""frames without it, and what touches is another object"""
SAME_PART = 0.7
"""of a keyframe's points that has to be seen; with fewer another one is made"""
WEAKENING, WEAKENED_PART = 3.0, 0.8
"""below this multiple of what has to be told, and where a keyframe is seen so little, another one is made in time"""
LEAST_OVERLAP = 0.35
STEEPEST = np.cos(np.radians(30.0))
"""a keyframe that is turned away farther shows too little"""
MOST_KEYFRAMES = 100
COARSE_POINTS = 300
"""a start is tried with"""
TRIED_STEPS = 5
OWN, OWN_FRAMES, FEWEST_OWN = 1.6, 30, 4
"""a residual above so many times the median of the last frames is looked into"""
HOLDS = 0.8
"""of the last motion is expected again"""
UNTELLABLE_MM = VAGUE_MM / 3
"""standard deviation of a twist that is untellable, mm"""
MARGIN = 1.5
"""standard deviations that have to fit into the limits of what is doubtful, or the object is lost"""


@dataclass(frozen=True, eq=False)
class TrackedKeyframe:
    """A keyframe of an object, and its pose."""

    keyframe: Keyframe
    motion: Array
    """(4, 4) from the first frame of the object to the keyframe"""
    covariance: Array
    """(6, 6) of it, about the middle of the keyframe's contact"""

    @cached_property
    def coarse(self) -> Keyframe:
        """The keyframe with few points."""
        return Keyframe(self.keyframe.view, COARSE_POINTS)


@dataclass(frozen=True, eq=False)
class Match:
    """An object in a frame."""

    known: TrackedKeyframe
    registration: Registration
    agreement: Agreement
    information: Information
    plain: bool
    """whether the object looks the same wherever it is along what is not told; never where all is told"""

    @property
    def motion(self) -> Array:
        """(4, 4) from the first frame of the object to this one."""
        return orthonormal(self.registration.pose @ self.known.motion)


def agrees(a: Agreement) -> bool:
    """Say whether two views that agree so show one object in the same place.

    Where one is pressed deeper than the other the slopes differ, and the curvatures still agree.
    """
    smooth = a.texture <= 3 * max(a.residual, 0.7)
    slopes = a.slope >= 0.8 and (a.unlike <= 0.25 or a.residual <= 1.5)
    alike = (slopes and (a.curvature >= 0.4 or smooth)) or (a.curvature >= 0.6 and a.unlike <= 0.5)
    return a.overlap >= LEAST_OVERLAP and alike


def is_certain(a: Agreement, own: float) -> bool:
    """Say whether no other start needs to be tried; `own` is what the residual of this object usually is."""
    return agrees(a) and a.residual <= OWN * own and (a.residual <= 1.5 or (a.unlike <= 0.1 and a.curvature >= 0.75))


def score(a: Agreement) -> float:
    """Return how badly two views agree, to choose between starts."""
    return a.unlike + (1 - a.curvature) + 2 * max(SAME_PART - a.overlap, 0)


class Tracker:
    """Follows the objects of one sensor; one thread uses it."""

    def __init__(self, *, doubts: bool = True) -> None:
        """Begin with object number 1.

        doubts: an object whose place may be wrong is lost. Else it is followed on, for who has other means to judge it.
        """
        self._doubts = doubts
        self._number = 0
        self._known: list[TrackedKeyframe] = []
        """the keyframes of the object, the first one first; none: nothing is followed"""
        self._since = 0
        self._motion = np.eye(4)
        self._step = np.zeros(6)
        """the last motion, about the middle of the contact"""
        self._before: View | None = None
        """the last view in which the object was found"""
        self._missed = 0
        self._relief = False
        """whether the object has looked different along what was not told"""
        self._residuals: deque[float] = deque(maxlen=OWN_FRAMES)
        self.loss: Loss | None = None
        """why the newest frame has no pose of the object that is followed, None where it has one"""

    @property
    def _own(self) -> float:
        """What the residual of this object usually is."""
        return float(np.median(self._residuals)) if len(self._residuals) >= FEWEST_OWN else np.inf

    def follow(self, view: View, sequence: int) -> ObjectPose | None:
        """Return where the object is in a view, or that it is lost; None where nothing touches."""
        self.loss = None
        if np.count_nonzero(view.touching) < LEAST_POINTS:
            return self._lifted()
        if not self._known:
            return self._begin(view, sequence)
        found = self._find(view)
        if found is not None:
            covariance = self._covariance(view, found)
            if self._known_well(covariance):
                return self._note(view, found, covariance)
            self.loss = Loss.UNSURE
            self._missed = max(self._missed, GIVE_UP - 2)  # it has drifted: only a way back would help
        self._missed += 1
        self._step = np.zeros(6)
        return self._lost() if self._missed < GIVE_UP else self._begin(view, sequence)

    def forget(self) -> None:
        """Take what touches next for another object; its number is another one too."""
        self._known = []

    def _lifted(self) -> ObjectPose | None:
        announce = bool(self._known) and self._missed == 0
        self._missed, self._step, self.loss = max(self._missed, 1), np.zeros(6), Loss.LIFTED
        return self._lost() if announce else None

    def _begin(self, view: View, sequence: int) -> ObjectPose | None:
        keyframe = Keyframe(view)
        if not keyframe.registrable:
            return None
        self._number, self._since, self._missed = self._number + 1, sequence, 0
        self._residuals.clear()
        self._relief, self.loss = False, None
        self._known = [TrackedKeyframe(keyframe, np.eye(4), np.zeros((6, 6)))]
        self._motion, self._step, self._before = np.eye(4), np.zeros(6), view
        return self._pose(view, np.eye(4), np.zeros((6, 6)))

    # ---- one frame ----

    def _find(self, view: View) -> Match | None:
        """Return the object in a view, None where it is not found."""
        assert self._before is not None
        expected = pose_of(HOLDS * self._step, self._before.centre_mm) @ self._motion
        known = self._chosen(view, expected)
        found = self._registered(known, view, expected @ inverse(known.motion))
        if found is not None and is_certain(found.agreement, self._own):
            self.loss = None if self._tells(found) else Loss.UNTOLD
            return None if self.loss else found
        candidates = [found, *(self._registered(one, view, start) for one, start in self._best_starts(view, known))]
        agreed = [one for one in candidates if one is not None and agrees(one.agreement) and self._tells(one)]
        if not agreed:
            untold = any(one is not None and agrees(one.agreement) for one in candidates)
            self.loss = Loss.UNTOLD if untold else Loss.UNLIKE
        return min(agreed, key=lambda one: score(one.agreement), default=None)

    def _chosen(self, view: View, expected: Array) -> TrackedKeyframe:
        """Return the oldest keyframe of which enough is expected to be seen, else that of which most is."""
        shares = []
        for known in self._known:
            pose = expected @ inverse(known.motion)
            seen = at_pixels(view.touching, view.pixels(carried(pose, known.keyframe.points[::10]))).mean()
            share = float(seen) if pose[2, 2] > STEEPEST else 0.0
            if share > SAME_PART:
                return known
            shares.append(share)
        return self._known[int(np.argmax(shares))]

    def _best_starts(self, view: View, known: TrackedKeyframe) -> list[tuple[TrackedKeyframe, Array]]:
        """Return the two most promising of all starts, tried with few points."""
        assert self._before is not None
        moves = guesses(self._before, view) + spins(self._before, view)
        tried: list[tuple[float, int, TrackedKeyframe, Array]] = []
        for one in dict.fromkeys([known, self._known[-1]]):
            for move in moves:
                start = move @ self._motion @ inverse(one.motion)
                found = register(one.coarse, view, start, most_steps=TRIED_STEPS)
                if found is not None:
                    tried.append((score(agreement(one.coarse, view, found)), len(tried), one, found.pose))
        return [(one, pose) for _, _, one, pose in sorted(tried, key=lambda each: each[:2])[:2]]

    def _registered(self, known: TrackedKeyframe, view: View, start: Array) -> Match | None:
        key = known.keyframe
        found = register(key, view, start)
        if found is None:
            return None
        told = information(key, view, found)
        if not told.told.shape[1]:
            return None
        if told.told.shape[1] < 6:
            found = hold(key, view, start, found, told.told) or found
            told = information(key, view, found)
        plain = 0 < told.told.shape[1] < 6 and not self._relief and looks_alike(key, view, found, told.told)
        return Match(known, found, agreement(key, view, found), told, plain)

    def _tells(self, found: Match) -> bool:
        """Say whether all is told, or the object never had a relief: else it may have moved unseen."""
        self._relief = self._relief or not found.plain
        return found.information.told.shape[1] == 6 or not self._relief or not self._doubts

    # ---- what is known then ----

    def _known_well(self, covariance: Array) -> bool:
        """Say whether a pose may be believed: along all twists, or where the object is plain along those told."""
        if not self._doubts:
            return True
        variances, twists = np.linalg.eigh(covariance * SCALE[:, None] * SCALE)
        told = variances < UNTELLABLE_MM**2
        if self._relief and not told.all():
            return False
        known = twists[:, told] * np.sqrt(variances[told]) * MARGIN / SCALE[:, None]
        moved, turned = (float(np.linalg.eigvalsh(part @ part.T)[-1]) for part in (known[:3], known[3:]))
        return moved < DOUBTFUL_MM**2 and turned < DOUBTFUL_RAD**2

    def _note(self, view: View, found: Match, covariance: Array) -> ObjectPose:
        """Take in where the object is, and return it."""
        assert self._before is not None
        self._step = np.zeros(6)
        if not self._missed:
            self._step = twist_of(found.motion @ inverse(self._motion), self._before.centre_mm)
        self._motion, self._before, self._missed = found.motion, view, 0
        self._residuals.append(found.agreement.residual)
        if self._leads_on(found):
            keyframe = Keyframe(view)
            if keyframe.registrable:
                self._known = [*self._known[: MOST_KEYFRAMES - 1], TrackedKeyframe(keyframe, found.motion, covariance)]
        return self._pose(view, found.motion, covariance)

    def _leads_on(self, found: Match) -> bool:
        """Say whether a found frame is to be a keyframe, while it is still well known."""
        weak = 1 < found.information.weakest < WEAKENING and found.agreement.overlap < WEAKENED_PART
        a = found.agreement
        return weak or a.overlap < SAME_PART or not is_certain(a, self._own) or found.registration.pose[2, 2] < STEEPEST

    def _covariance(self, view: View, found: Match) -> Array:
        """Return the (6, 6) covariance of the motion, about the middle of the contact of a view."""
        known, pose = found.known, found.registration.pose
        told = found.information.covariance / SCALE[:, None] / SCALE
        moved = moved_twists(pose[:3, :3], view.centre_mm - carried(pose, known.keyframe.centre_mm))
        return np.asarray(moved @ (told + known.covariance) @ moved.T)

    def _pose(self, view: View, motion: Array, covariance: Array) -> ObjectPose:
        variances, twists = np.linalg.eigh(covariance * SCALE[:, None] * SCALE)
        return ObjectPose(
            number=self._number,
            since_sequence=self._since,
            motion=motion,
            origin_mm=self._known[0].keyframe.centre_mm,
            centre_mm=view.centre_mm,
            covariance=covariance,
            untellable=(twists[:, variances > UNTELLABLE_MM**2] / SCALE[:, None]).T,
        )

    def _lost(self) -> ObjectPose:
        return ObjectPose(
            number=self._number,
            since_sequence=self._since,
            motion=np.full((4, 4), np.nan),
            origin_mm=self._known[0].keyframe.centre_mm,
            centre_mm=np.full(3, np.nan),
            covariance=np.full((6, 6), np.nan),
            untellable=np.zeros((0, 6)),
        )
