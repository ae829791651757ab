"""Dots and shear as figures: what travels, and what recordings keep."""

from dataclasses import replace
from math import isnan
from typing import Annotated

import numpy as np
from pydantic import Field, FiniteFloat

from gellight.base.allowed import StrictModel
from gellight.frames.shear import DotsSeen, Floats, Shear, Unseen

Place = tuple[FiniteFloat, FiniteFloat]
MOST_DOTS = 1000


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
