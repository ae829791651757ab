"""Where the object in the gel has gone since it was first touched."""

from dataclasses import dataclass
from math import isnan, radians
from typing import Annotated, Any, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from gellight.base.allowed import StrictModel

Numbers = tuple[float, ...]
Row = Annotated[Numbers, Field(min_length=6, max_length=6)]  # of a covariance: three of the motion, three of the turn
DOUBTFUL_MM, DOUBTFUL_RAD = 1.0, radians(5.0)
"""a pose with a larger standard deviation is doubtful"""


class PoseFigures(StrictModel):
    """`ObjectPose` as it travels and is recorded: rows one after the other, none where the object is lost."""

    number: int
    since_sequence: int
    origin_mm: Annotated[Numbers, Field(min_length=3, max_length=3)]
    centre_mm: Annotated[Numbers, Field(max_length=3)] = ()
    motion: Annotated[Numbers, Field(max_length=16)] = ()
    """the first three rows"""
    covariance: Annotated[tuple[Row, ...], Field(max_length=6)] = ()
    untellable: Annotated[tuple[Row, ...], Field(max_length=6)] = ()
    doubtful: bool = False
    """follows from the covariance"""


@dataclass(frozen=True, kw_only=True, eq=False)
class ObjectPose:
    """The rigid motion of an object, from the frame in which it was first touched to this one.

    Axes are x right, y down, z towards the camera, mm from the image centre: they are left-handed. Where the object is
    lost all numbers are NaN.
    """

    number: int
    """of the object; another one where it was lost and not found again"""
    since_sequence: int
    """the frame in which it was first touched: there the motion is none"""
    motion: NDArray[np.float64]
    """(4, 4) carries points of the object from where they were in that frame, mm, to where they are"""
    origin_mm: NDArray[np.float64]
    """(3,) the middle of the contact in that frame: a point of the object"""
    centre_mm: NDArray[np.float64]
    """(3,) the middle of the contact now: the point that the covariance is about"""
    covariance: NDArray[np.float64]
    """(6, 6) of the translation of that point, mm2, and of the rotation, rad2, in this order"""
    untellable: NDArray[np.float64]
    """(k, 6) twists about that point, in mm and rad, along which the contact tells nothing; 3 mm weigh as 1 rad"""

    def __repr__(self) -> str:
        """Return the object and its place in one line."""
        return f"<{type(self).__name__}: {self.in_words()}>"

    @property
    def lost(self) -> bool:
        """Whether the object is not followed any more."""
        return isnan(self.motion[0, 0])

    @property
    def doubtful(self) -> bool:
        """Whether the covariance states more than 1 mm or 5 degrees along some direction; False where it is lost.

        It is where a direction is untellable.
        """
        if self.lost:
            return False
        blocks = self.covariance[:3, :3], self.covariance[3:, 3:]
        moved, turned = (float(np.linalg.eigvalsh(block)[-1]) for block in blocks)
        return moved > DOUBTFUL_MM**2 or turned > DOUBTFUL_RAD**2

    @property
    def place_mm(self) -> NDArray[np.float64]:
        """(3,) where the point is that was in the middle of the contact at first."""
        return np.asarray(self.motion[:3, :3] @ self.origin_mm + self.motion[:3, 3])

    def covariance_at(self, point_mm: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the (6, 6) covariance of the translation of another point that moves with the object."""
        x, y, z = (point_mm - self.centre_mm).tolist()
        moved = np.eye(6)
        moved[:3, 3:] = [[0, z, -y], [-z, 0, x], [y, -x, 0]]
        return np.asarray(moved @ self.covariance @ moved.T)

    def figures(self) -> PoseFigures:
        """Return the pose as it travels."""
        lost: dict[str, Any] = {
            "number": self.number,
            "since_sequence": self.since_sequence,
            "origin_mm": tuple(self.origin_mm.tolist()),
        }
        if self.lost:
            return PoseFigures(**lost)
        return PoseFigures(
            **lost,
            centre_mm=tuple(self.centre_mm.tolist()),
            motion=tuple(self.motion[:3].ravel().tolist()),
            covariance=tuple(map(tuple, self.covariance.tolist())),
            untellable=tuple(map(tuple, self.untellable.tolist())),
            doubtful=self.doubtful,
        )

    @classmethod
    def of(cls, figures: PoseFigures) -> Self:
        """Return the pose that has travelled; ValueError where numbers are missing."""
        motion, lost = np.full((4, 4), np.nan), not figures.motion
        if not lost:
            motion = np.vstack([np.array(figures.motion).reshape(3, 4), [0.0, 0.0, 0.0, 1.0]])
        return cls(
            number=figures.number,
            since_sequence=figures.since_sequence,
            motion=motion,
            origin_mm=np.array(figures.origin_mm),
            centre_mm=np.full(3, np.nan) if lost else np.array(figures.centre_mm).reshape(3),
            covariance=np.full((6, 6), np.nan) if lost else np.array(figures.covariance).reshape(6, 6),
            untellable=np.array(figures.untellable).reshape(-1, 6),
        )

    def in_words(self) -> str:
        """Return the object and its place in one line."""
        if self.lost:
            return f"object {self.number} is lost"
        x, y, z = self.place_mm.tolist()
        told = f", {len(self.untellable)} of 6 directions untellable" if len(self.untellable) else ""
        doubt = ", doubtful: press deeper, or where there is more relief" if self.doubtful else ""
        return f"object {self.number} at ({x:.2f}, {y:.2f}, {z:.2f}) mm{told}{doubt}"
