"""Contacts from frame to frame: which one is which, since when, and how it moves; and who follows the object."""

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from math import inf, isnan

import numpy as np
from numpy.typing import NDArray

from gellight.base.beside import installed
from gellight.frames.frames import Patch, TactileFrame

Array = NDArray[np.float64]
MISSED_S = 0.1
"""as long may noise hide a contact near the threshold; later it is another one"""
APART_S = 1.0
"""as far apart may two frames be, one after the other, that both show a contact; farther, it is another one"""
WINDOW_S = 0.15
"""the velocity is the slope of the line through the places of the last 0.15 s, and of the last two in any case"""


@dataclass
class _Followed:
    """A contact that was seen, by now or a moment ago."""

    number: int
    since_s: float
    radius_mm: float = 0.0
    places: deque[tuple[float, float, float]] = field(default_factory=deque)
    """time, x, y"""

    @property
    def seen_s(self) -> float:
        return self.places[-1][0]

    def note(self, patch: Patch, now_s: float) -> None:
        """Take in where it is now; the same frame again says nothing new."""
        self.radius_mm = _radius_mm(patch)
        if not self.places or now_s > self.seen_s:
            self.places.append((now_s, *patch.centroid_mm))
        while len(self.places) > 2 and now_s - self.places[0][0] > WINDOW_S:
            self.places.popleft()

    @property
    def velocity_mm_s(self) -> tuple[float, float] | None:
        """(x, y), by least squares; None where it was seen once."""
        if len(self.places) < 2:
            return None
        seen = np.array(self.places)
        time_s = seen[:, 0] - seen[:, 0].mean()
        x, y = (time_s @ seen[:, 1:] / (time_s @ time_s)).tolist()
        return x, y

    def expected_mm(self, now_s: float) -> Array:
        """Return where it is if it went on as it did."""
        return np.array(self.places[-1][1:]) + np.array(self.velocity_mm_s or (0.0, 0.0)) * (now_s - self.seen_s)


class ContactFollower:
    """Numbers the contacts of the frames of one sensor; one thread uses it.

    A contact of the next frame is the same one where the circles of their areas meet; of several, those that lie
    nearest together in sum. Where two grow together the nearer one goes on, where one parts the farther part is new.
    """

    def __init__(self) -> None:
        """Begin with number 1; none is given twice."""
        self._followed: list[_Followed] = []
        self._given = 0
        self._before_s = -inf
        """when the frame before was taken"""

    def follow(self, frame: TactileFrame) -> TactileFrame:
        """Return the frame with number, age and velocity of its contacts; one that feels nothing as it is."""
        if isnan(frame.contact.indentation_mm):
            return frame
        now_s = frame.camera_frame.time_s
        self._followed = [one for one in self._followed if abs(now_s - one.seen_s) <= self._kept_s(one)]
        self._before_s = now_s
        known = _matched(self._followed, frame.contacts, now_s)
        return replace(frame, contacts=tuple(self._note(patch, one, now_s) for patch, one in known))

    def _kept_s(self, one: _Followed) -> float:
        """How long after it was seen a contact is still the same one."""
        return APART_S if one.seen_s == self._before_s else MISSED_S

    def _note(self, patch: Patch, one: _Followed | None, now_s: float) -> Patch:
        if one is None:
            self._given += 1
            one = _Followed(self._given, now_s)
            self._followed.append(one)
        one.note(patch, now_s)
        age_s = max(now_s - one.since_s, 0.0)
        return replace(patch, number=one.number, age_s=age_s, velocity_mm_s=one.velocity_mm_s)


def object_follower() -> Callable[[TactileFrame], TactileFrame]:
    """Return what gives the frames of one sensor the pose of their object, one after the other.

    Another distribution has it (entry point `gellight.trackers`); InputError where none is installed.
    """
    follower = installed("gellight.trackers", what="tracking", home="gellight_scan", extra="scan")
    follow: Callable[[TactileFrame], TactileFrame] = follower().follow
    return follow


def _matched(
    followed: Sequence[_Followed], patches: Sequence[Patch], now_s: float
) -> list[tuple[Patch, _Followed | None]]:
    """Return each patch with the contact that it is; None: a new one."""
    known: list[_Followed | None] = [None] * len(patches)
    if followed and patches:
        expected = np.array([one.expected_mm(now_s) for one in followed])
        away = np.linalg.norm(np.array([patch.centroid_mm for patch in patches])[:, None] - expected, axis=2)
        near = away <= np.add.outer([_radius_mm(patch) for patch in patches], [one.radius_mm for one in followed])
        # What is too far costs more than all others together.
        for patch, one in _pairs(np.where(near, away, 1e6)):
            known[patch] = followed[one] if near[patch, one] else None
    return list(zip(patches, known, strict=True))


def _pairs(costs: Array) -> list[tuple[int, int]]:
    """Return the row and the column of each pair, which together cost least."""
    if 1 in costs.shape:
        row, column = np.unravel_index(np.argmin(costs), costs.shape)
        return [(int(row), int(column))]
    from scipy.optimize import linear_sum_assignment  # imported when it is needed: it takes a tenth of a second

    return list(zip(*(each.tolist() for each in linear_sum_assignment(costs)), strict=True))


def _radius_mm(patch: Patch) -> float:
    return float(np.sqrt(patch.area_mm2 / np.pi))
