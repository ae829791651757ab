"""How far a reconstruction is from the true surface, where a simulator knows it."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from gellight.frames.frames import TactileFrame
from gellight.reconstruction.integration import angle_deg, normals


class TrueSurface(Protocol):
    """The gel as it really is: the truth of a simulated frame, or a surface of the reference simulator."""

    @property
    def depth_mm(self) -> NDArray[np.floating]:
        """(H, W)"""

    @property
    def gradient_map(self) -> NDArray[np.floating]:
        """(H, W, 2)"""

    @property
    def contact(self) -> NDArray[np.bool_]:
        """(H, W)"""


@dataclass(frozen=True, kw_only=True)
class SurfaceErrors:
    """Mean angle between the normals and mean absolute error of the depth, over the whole map and over the contact."""

    normal_deg: float
    contact_normal_deg: float
    depth_mm: float
    contact_depth_mm: float


def surface_errors(frame: TactileFrame, true: TrueSurface) -> SurfaceErrors:
    """Compare a tactile frame with the true surface; where nothing touches, the whole map stands for the contact."""
    angle = angle_deg(frame.normal_map, normals(true.gradient_map))
    depth_mm, contact_depth_mm = depth_errors(frame, true)
    return SurfaceErrors(
        normal_deg=float(angle.mean()),
        contact_normal_deg=float(angle[_judged(true)].mean()),
        depth_mm=depth_mm,
        contact_depth_mm=contact_depth_mm,
    )


def depth_errors(frame: TactileFrame, true: TrueSurface) -> tuple[float, float]:
    """Return the mean absolute error of the depth in mm, over the whole map and over the contact, nothing taken off."""
    error = np.abs(frame.depth_mm - true.depth_mm)
    return float(error.mean()), float(error[_judged(true)].mean())


def _judged(true: TrueSurface) -> NDArray[np.bool_]:
    """(H, W) the contact; everything where nothing touches."""
    return true.contact if true.contact.any() else np.ones_like(true.contact)
