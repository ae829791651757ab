"""What a calibration is asked for: the tools at hand, and how much of everything."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import inf
from pathlib import Path
from typing import Any, Self

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from gellight.base.allowed import refusals
from gellight.base.errors import InputError
from gellight.base.leds import MOST_LEDS
from gellight.bundle.bundle import Bundle
from gellight.bundle.limits import Limits
from gellight.lab.training.training import TrainingOptions
from gellight.photometric.ring_geometry import RingGeometry


class ToolSizes(BaseModel):
    """Sizes of the tools at hand: lengths in mm."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    ball_radius_mm: float = Field(default=4.0, ge=0.1, le=100)
    cylinder_diameter_mm: float = Field(default=8.0, ge=0.1, le=100)
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


LEAST_PRESSES, LEAST_WITH_LIKE = 8, 2
"""fewer ball presses than that are not fitted, without and with those of a like unit"""


@dataclass(frozen=True, kw_only=True)
class RoutineOptions:
    """The tools at hand, and what one calibration is to do."""

    out: Path
    """folder of the bundle that is written when the verdict is good"""
    sensor: str = "unnamed"
    """what the sensor is known by, see `Manifest.sensor`"""
    name: str = ""
    """what people call the sensor; empty: as the interrupted calibration was begun with"""
    tools: ToolSizes = field(default_factory=ToolSizes)
    reference_frames: int = 30
    cylinder_presses: int = 5
    presses: int = 40
    """ball presses to train on; a guided routine says when fewer are enough"""
    until_um: float | None = None
    """error of the depth beside its contact's mean on presses held out, at which fewer ball presses are enough"""
    verifications: int = 6
    """fresh ball presses, never trained on"""
    limits: Limits = field(default_factory=Limits)
    training: TrainingOptions = field(default_factory=lambda: TrainingOptions(recipe="thorough"))
    like: Bundle | None = None
    """of a unit of the same make, whose presses are begun with; None: as the interrupted calibration has it"""
    gel_thickness_mm: float = 0.0
    """of the soft gel; 0: nobody told. A simulated sensor knows its own"""
    camera_height_mm: float = inf
    """above the gel, as it seems from within it; infinite: along parallel rays. A simulated sensor knows its own"""
    ring: RingGeometry = field(default_factory=RingGeometry)
    """where the LEDs are, and of which colours"""
    overwrite: bool = False
    """replace an existing bundle of the same sensor"""

    @property
    def least_presses(self) -> int:
        """Fewer ball presses than that are not fitted."""
        return LEAST_WITH_LIKE if self.like else LEAST_PRESSES

    def __post_init__(self) -> None:
        """Refuse what cannot be done."""
        if len(self.ring.led_colours) > MOST_LEDS:
            raise InputError(f"led_colours = {self.ring.led_colours!r}: a board drives {MOST_LEDS} LEDs at most")
        if self.until_um is not None and not self.until_um > 0:
            raise InputError(f"until_um = {self.until_um}: give micrometres above 0")
        least = {"presses": self.least_presses, "verifications": 2, "cylinder_presses": 2,
                 "reference_frames": 8}  # fmt: skip
        for name, count in least.items():
            if getattr(self, name) < count:
                fewer = (
                    f", or {LEAST_WITH_LIKE} with a like unit" if count == LEAST_PRESSES and name == "presses" else ""
                )
                raise InputError(f"{name} = {getattr(self, name)}: at least {count} are needed{fewer}")
