"""Faults that a virtual sensor makes on purpose, to test programs that have to notice them."""

from pydantic import BaseModel, ConfigDict, Field


class Faults(BaseModel):
    """The faults of a virtual sensor; by default it has none."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    drop: float = Field(default=0.0, ge=0, le=1)
    """share of the frames that the camera loses without any sign"""
    error: float = Field(default=0.0, ge=0, le=1)
    """share of the frames that the camera itself marks as damaged"""
    torn: float = Field(default=0.0, ge=0, le=1)
    """share of the frames of which only the beginning is sent"""
    duplicate: float = Field(default=0.0, ge=0, le=1)
    """share of the frames that are sent a second time instead of the next one"""
    late_ms: float = Field(default=0.0, ge=0)
    """the longest that a frame is held back before it is sent: the kernel's time stamp is wrong by as much"""
    stall_after: int = Field(default=0, ge=0)
    """frames after the start of a stream until the camera falls silent; 0: never"""


NO_FAULTS = Faults()
