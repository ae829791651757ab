"""How a frame is judged by someone who knows what was really pressed."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

from gellight.frames.frames import TactileFrame


@dataclass(frozen=True, kw_only=True)
class SelfCheckResult:
    """How far the host's answer is from the reference's, in one frame."""

    sequence: int
    depth_error_mm: float
    """mean absolute error of the depth over the contact (over the whole map where nothing touches)"""
    shape_error_mm: float
    """the same after the best constant is taken off"""
    normal_error_deg: float
    """mean angle between the normals over the whole map"""
    contact_normal_error_deg: float
    """the same over the contact"""
    integral_error_mm: float
    """mean absolute difference of the two integrals, constants removed"""
    picture_error_grey: float
    """mean absolute difference of the picture and its re-rendering, grey levels"""
    indentation_mm: float
    true_indentation_mm: float
    bounds: Mapping[str, float]
    """by the names of the errors they bound"""

    @property
    def passed(self) -> bool:
        """Whether every error is within its bound."""
        return all(getattr(self, name) <= bound for name, bound in self.bounds.items())

    def as_json(self) -> dict[str, object]:
        """Return the numbers, rounded for people."""
        fields = {**vars(self), "bounds": dict(self.bounds), "passed": self.passed}
        return {name: round(value, 5) if isinstance(value, float) else value for name, value in fields.items()}


class FrameJudge(Protocol):
    """Compares what was reconstructed from a camera's frames with the truth."""

    def compare(self, frame: TactileFrame) -> SelfCheckResult:
        """Compare one frame that carries its truth; raises InputError for one that does not."""
