"""Whether what touches the gel slips: the motion of its imprint against the motion of the dots under it.

Where the gel sticks, its dots go with the object. Where it slips, the imprint goes on and the dots stay behind. Both
are known of every frame: the middle of the contact from the depth, the motion of the gel under it from the dots. Nobody
needs to know the friction. What happens at the rim of a contact, where slip begins, is finer than dots can show.
"""

from collections import deque
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gellight.frames.frames import Patch, TactileFrame
from gellight.frames.shear import Slip, SlipState

Array = NDArray[np.float64]
SPAN_S = 0.06
"""over which motions are compared"""
CREEP_S = 0.24
"""over which they are compared where that shows no slip: what slips at the rim leaves the middle behind slowly"""
LONGEST_S = 1.0
"""between two frames that are compared"""
LEAST_SLIP_MM = 0.02
"""in that time; less is the noise of both places"""
PARTIAL_SHARE, FULL_SHARE = 0.15, 0.7
"""of the faster of the two motions: less is how gel that sticks gives way, more is slip of the whole"""
INSIDE = 0.5
"""radii of the contact: standard deviation of how dots count by their distance from its middle"""
LEAST_WEIGHT = 0.6
"""of a dot in the middle: with less under the contact nothing is known"""
SINKING_SHARE = 0.1
"""change of the area in that time: the middle of a contact that grows is no place of the object"""


@dataclass(frozen=True, eq=False)
class _Seen:
    time_s: float
    area_mm2: float
    imprint_mm: Array
    gel_mm: Array


class SlipFollower:
    """Follows the deepest contact of one sensor; one thread uses it."""

    def __init__(self) -> None:
        """Begin without a contact."""
        self._forget()

    def _forget(self) -> None:
        self._before: deque[_Seen] = deque()
        self._slid_s = -np.inf
        """when all of it slipped last"""

    def follow(self, frame: TactileFrame) -> TactileFrame:
        """Return the frame with what is known of slip; as it is for a gel without dots or without depth."""
        if frame.camera_frame.dots is None or frame.measures is None:
            return frame
        return replace(frame, slip=self._judged(frame))

    def _judged(self, frame: TactileFrame) -> Slip:
        patch = frame.contacts[0] if frame.contacts else None
        if patch is None:
            self._forget()
            return Slip(state=SlipState.UNKNOWN, why="nothing touches")
        seen = _seen(frame, patch)
        if isinstance(seen, str):
            self._forget()
            return Slip(state=SlipState.UNKNOWN, why=seen)
        if self._before and not _same(self._before[-1], seen):
            self._forget()
        self._before.append(seen)
        while seen.time_s - self._before[0].time_s > CREEP_S and len(self._before) > 2:
            self._before.popleft()
        return self._compared(seen)

    def _compared(self, now: _Seen) -> Slip:
        lately = next((one for one in reversed(self._before) if now.time_s - one.time_s >= 0.9 * SPAN_S), None)
        if lately is None:
            return Slip(state=SlipState.UNKNOWN, why="it has only begun")
        if _sinks(lately, now):
            return Slip(state=SlipState.UNKNOWN, why="the contact grows or shrinks")
        slip = _between(lately, now)
        if slip.state is SlipState.FULL:
            self._slid_s = now.time_s
        moves = float(np.hypot(*(now.imprint_mm - lately.imprint_mm))) > LEAST_SLIP_MM
        if slip.state is not SlipState.STICK or not moves:
            return slip
        since = min(self._slid_s, lately.time_s)
        earlier = next(one for one in self._before if one.time_s >= since)
        crept = slip if _sinks(earlier, now) else _between(earlier, now)
        return replace(crept, state=SlipState.PARTIAL) if crept.state is SlipState.FULL else crept


def _sinks(first: _Seen, last: _Seen) -> bool:
    return abs(last.area_mm2 - first.area_mm2) > SINKING_SHARE * last.area_mm2


def _seen(frame: TactileFrame, patch: Patch) -> _Seen | str:
    """Return where imprint and gel are; else why that is not known."""
    dots, measures = frame.camera_frame.dots, frame.measures
    assert dots is not None
    assert measures is not None
    if dots.problem:
        return dots.problem
    motion = measures.dot_motion(frame.depth_mm, dots)
    if motion is None:
        return "nobody knows the gel"
    rest, moved = motion
    middle, radius = np.array(patch.centroid_mm), np.sqrt(patch.area_mm2 / np.pi)
    away = (rest + moved - middle)[dots.seen]
    weight = np.exp(-np.square(away).sum(axis=1) / (2 * (INSIDE * radius) ** 2))
    if weight.sum() < LEAST_WEIGHT:
        return "no dot is under the contact"
    gel = weight @ moved[dots.seen] / weight.sum()
    return _Seen(frame.camera_frame.time_s, patch.area_mm2, middle, gel)


def _same(before: _Seen, now: _Seen) -> bool:
    """Whether two frames show one contact, the later one after the other: a recording may begin again."""
    away = float(np.hypot(*(now.imprint_mm - before.imprint_mm)))
    return 0 < now.time_s - before.time_s < LONGEST_S and away < np.sqrt(now.area_mm2 / np.pi)


def _between(first: _Seen, last: _Seen) -> Slip:
    imprint, gel = last.imprint_mm - first.imprint_mm, last.gel_mm - first.gel_mm
    slipped = imprint - gel
    far, motion = float(np.hypot(*slipped)), max(float(np.hypot(*imprint)), float(np.hypot(*gel)))
    speed = slipped / (last.time_s - first.time_s)
    least = max(LEAST_SLIP_MM, PARTIAL_SHARE * motion)
    if far < least:
        return Slip(state=SlipState.STICK, confidence=1 - far / least / 2)
    state = SlipState.FULL if far > FULL_SHARE * motion else SlipState.PARTIAL
    return Slip(state=state, confidence=1 - least / far / 2, velocity_mm_s=(float(speed[0]), float(speed[1])))
