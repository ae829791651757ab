"""The sizes of the tools that a calibration presses into the gel, declared once for the page, the files, the steps."""

from collections.abc import Mapping
from typing import Any, Self

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from gellight.base.allowed import refusals
from gellight.base.errors import InputError


class ToolSizes(BaseModel):
    """Sizes of the tools at hand: lengths in mm."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    ball_radius_mm: float = Field(default=4.0, ge=0.1, le=100)
    cylinder_diameter_mm: float = Field(default=8.0, ge=0.1, le=100)
    pin_pitch_mm: float | None = Field(default=None, ge=0.1, le=100)
    """distance of neighbouring pins of the grid that measures the lens; None without one"""
    pixel_size_mm: float | None = Field(default=None, ge=0.001, le=1)
    """of a square pixel, where it is known already; None: the cylinder measures it"""

    @classmethod
    def of(cls, sizes: Mapping[str, float | None]) -> Self:
        """Take sizes by name; InputError for one that no tool can have."""
        try:
            return cls.model_validate(sizes)
        except ValidationError as error:
            raise InputError(refusals(error, cls, "size")) from None

    def sizes(self) -> dict[str, Any]:
        """Return the sizes alone, by name."""
        return {name: getattr(self, name) for name in ToolSizes.model_fields}
