"""The sizes of the tools that a calibration presses into the gel, declared once for the page, the files, the steps."""

from collections.abc import Mapping
from typing import Any, Self

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from gellight.base.allowed import refusals
from gellight.base.errors import InputError
from gellight.lab.training.prisms import STEEPEST_DEG, prism_angle_rad


class ToolSizes(BaseModel):
    """Sizes of the tools at hand: lengths in mm, the angle in degrees, as people name them."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    ball_radius_mm: float = Field(default=4.0, ge=0.1, le=100)
    cylinder_diameter_mm: float = Field(default=8.0, ge=0.1, le=100)
    pin_pitch_mm: float | None = Field(default=None, ge=0.1, le=100)
    """distance of neighbouring pins of the grid that measures the lens; None without one"""
    pixel_size_mm: float | None = Field(default=None, ge=0.001, le=1)
    """of a square pixel, where it is known already; None: the cylinder measures it"""
    prism_angle_deg: float | None = Field(default=None, ge=1, le=STEEPEST_DEG)
    """of a prism that verifies beside the ball, between each face and the gel at rest; None without one"""

    @classmethod
    def of(cls, sizes: Mapping[str, float | None]) -> Self:
        """Take sizes by name; InputError for one that no tool can have."""
        if (angle_deg := sizes.get("prism_angle_deg")) is not None:
            prism_angle_rad(angle_deg, "prism_angle_deg")
        try:
            return cls.model_validate(sizes)
        except ValidationError as error:
            raise InputError(refusals(error, cls, "size")) from None

    def sizes(self) -> dict[str, Any]:
        """Return the sizes alone, by name."""
        return {name: getattr(self, name) for name in ToolSizes.model_fields}
