"""What is known of the gel along its surface: where its marker dots are, how it is moved and pulled; as figures too."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from enum import IntEnum, StrEnum
from functools import cached_property
from math import isnan
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, FiniteFloat

from gellight.base.allowed import StrictModel

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
Place = tuple[FiniteFloat, FiniteFloat]
MOST_DOTS = 5000
"""of a gel: more small dark spots than these are noise"""


class Unseen(IntEnum):
    """Why a marker dot is not seen."""

    SEEN = 0
    """it is seen"""
    MISSING = 1
    """no dot is where it should be: it is hidden, has come off, or cannot be told from the dot beside it"""
    BEYOND_VIEW = 2
    """it has moved out of the picture"""
    DARK = 4
    """the gel is not lit"""


@dataclass(frozen=True, kw_only=True, eq=False)
class DotsSeen:
    """The marker dots of one picture, each in the row of its name."""

    rest_px: Floats
    """(N, 2) x, y of the dots on the untouched gel"""
    places_px: Floats
    """(N, 2) x, y of the dots now; a guess from their neighbours where they are not seen"""
    reasons: NDArray[np.uint8]
    """(N,) 0 for a dot that is seen, else why it is not: `Unseen`"""
    problem: str = ""
    """why the dots tell nothing of the gel, as on another gel; empty where they do"""

    def __repr__(self) -> str:
        """Return how many dots are seen in one line."""
        told = f", {self.problem}" if self.problem else ""
        return f"<{type(self).__name__} {int(self.seen.sum())} of {len(self.reasons)}{told}>"

    @property
    def seen(self) -> Bools:
        """(N,) which dots are seen."""
        return np.asarray(self.reasons == Unseen.SEEN)


FEW_DOTS = "few_dots"
"""flag: hardly a dot is in the contact or beside it, so the force is mostly a guess; its error says how much of one"""
FRICTION = "friction"
"""flag: the force along the gel is larger than friction lets the normal force hold, so one of them is wrong"""
PERSPECTIVE = "perspective"
"""flag: the bundle does not say how high the camera is, so what perspective moves is still in the displacement"""


@dataclass(frozen=True, kw_only=True, eq=False)
class Shear:
    """How the gel is moved and pulled along its surface, by its marker dots."""

    dots: DotsSeen
    field_mm: Floats
    """(N, 2) x, y by which the gel under each dot has moved along itself; NaN where a dot is not seen"""
    force_n: tuple[float, float] | None = None
    """x, y of the force that pulls the gel along itself; None where it is unknown"""
    force_error_n: tuple[float, float] | None = None
    """one standard deviation of each"""
    torque_nmm: float | None = None
    """about the centre of the pressure, from x towards y"""
    torque_error_nmm: float | None = None
    centre_mm: tuple[float, float] | None = None
    """x, y of the centre of the pressure, from the image centre; None where nothing touches, or it is unknown"""
    flags: tuple[str, ...] = ()
    """`few_dots`, `friction`, `perspective`, and those of the normal force"""
    unknown: str = ""
    """why the force is unknown; empty where it is known"""
    traction_of: Callable[[], NDArray[np.float32] | None] | None = field(default=None, repr=False)
    """computes the traction map; None where nothing pulls, or it is unknown"""

    def __repr__(self) -> str:
        """Return the force, or why it is unknown, in one line."""
        told = f"force {self.unknown or 'unknown'}"
        if self.force_n is not None:
            told = f"force ({self.force_n[0]:.3f}, {self.force_n[1]:.3f}) N"
        return f"<{type(self).__name__} by {int(self.dots.seen.sum())} of {len(self.dots.reasons)} dots, {told}>"

    @cached_property
    def traction_mpa(self) -> NDArray[np.float32] | None:
        """(H, W, 2) force along the gel on its area, MPa (N / mm2), constant over cells; None where it is unknown."""
        return self.traction_of() if self.traction_of else None


class SlipState(StrEnum):
    """What is known of slip under the deepest contact."""

    STICK = "stick"
    """the gel goes with the object"""
    PARTIAL = "partial"
    """the gel goes with it less far"""
    FULL = "full"
    """the object slides over the gel"""
    UNKNOWN = "unknown"


@dataclass(frozen=True, kw_only=True)
class Slip:
    """Whether what touches the gel slips, over the last 0.06 s, or 0.24 s where it slips slowly."""

    state: SlipState
    confidence: float = 0.0
    """from 0.5, as likely as not, to 1; 0 where it is unknown"""
    velocity_mm_s: tuple[float, float] | None = None
    """x, y of the object against the gel under it; None unless it slips"""
    why: str = ""
    """it is unknown"""


@dataclass(frozen=True, kw_only=True, eq=False)
class ShearTruth:
    """How a simulated gel is moved along its surface: what only a simulator can know."""

    dots_px: Floats
    """(N, 2) x, y of the middle of each dot in the picture, px; they may lie beyond it"""
    dots_mm: Floats
    """(N, 2) by which the gel under each dot has moved along itself"""
    field_mm: NDArray[np.float32] = field(repr=False)
    """(H, W, 2) the same of the gel that lay under each pixel when it was at rest"""
    force_n: tuple[float, float]
    """x and y of the force that pulls the gel"""
    torque_nmm: float
    """of that force about the centre of the pressure, from x towards y"""
    sticks: Bools = field(repr=False)
    """(H, W) where the gel is touched and does not slip, over the gel at rest"""
    sticking_share: float
    """of the contact; 0 where nothing touches"""


class DotFigures(StrictModel):
    """`DotsSeen`; places to a thousandth of a pixel."""

    rest_px: Annotated[tuple[Place, ...], Field(max_length=MOST_DOTS)]
    places_px: Annotated[tuple[Place, ...], Field(max_length=MOST_DOTS)]
    reasons: tuple[Annotated[int, Field(ge=0, le=max(Unseen))], ...]
    problem: str = ""

    @classmethod
    def of(cls, dots: DotsSeen) -> "DotFigures":
        """Return the figures of the dots of a picture."""
        return cls.model_construct(
            rest_px=_rounded(dots.rest_px, 3), places_px=_rounded(dots.places_px, 3),
            reasons=tuple(dots.reasons.tolist()), problem=dots.problem,
        )  # fmt: skip

    def dots(self) -> DotsSeen:
        """Return the dots; ValueError where the lists are not of one length."""
        if not len(self.rest_px) == len(self.places_px) == len(self.reasons):
            raise ValueError(f"{len(self.rest_px)} dots, {len(self.places_px)} places, {len(self.reasons)} reasons")
        rest, places = (np.array(one, np.float64).reshape(-1, 2) for one in (self.rest_px, self.places_px))
        return DotsSeen(rest_px=rest, places_px=places, reasons=np.array(self.reasons, np.uint8), problem=self.problem)


class ShearFigures(StrictModel):
    """`Shear` without its dots and its traction map."""

    field_mm: tuple[Place | None, ...]
    """to a tenth of a micrometre; None for a dot that is not seen"""
    force_n: Place | None
    force_error_n: Place | None
    torque_nmm: FiniteFloat | None
    torque_error_nmm: FiniteFloat | None
    centre_mm: Place | None
    flags: tuple[str, ...]
    unknown: str

    @classmethod
    def of(cls, shear: Shear) -> "ShearFigures":
        """Return the figures of what a frame feels."""
        field = tuple(None if isnan(x) else (x, y) for x, y in _rounded(shear.field_mm, 4))
        known = {name: getattr(shear, name) for name in cls.model_fields if name != "field_mm"}
        return cls.model_construct(field_mm=field, **known)

    def shear(self, dots: DotsSeen) -> Shear:
        """Return what was felt, without the traction map; ValueError where it is of other dots."""
        if len(self.field_mm) != len(dots.reasons):
            raise ValueError(f"{len(self.field_mm)} displacements of {len(dots.reasons)} dots")
        field = np.array([(np.nan, np.nan) if one is None else one for one in self.field_mm]).reshape(-1, 2)
        known = {name: getattr(self, name) for name in type(self).model_fields}
        return replace(Shear(dots=dots, field_mm=field), **known | {"field_mm": field})


def _rounded(values: Floats, digits: int) -> tuple[Place, ...]:
    return tuple((x, y) for x, y in np.round(values, digits).tolist())
