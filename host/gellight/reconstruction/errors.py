"""How far a reconstruction is from the true surface, where a simulator knows it."""

from collections.abc import Sequence
from dataclasses import dataclass, fields
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
    where = true.contact if true.contact.any() else np.ones_like(true.contact)
    angle = angle_deg(frame.normal_map, normals(true.gradient_map))
    depth = np.abs(frame.depth_mm - true.depth_mm)
    return SurfaceErrors(
        normal_deg=float(angle.mean()),
        contact_normal_deg=float(angle[where].mean()),
        depth_mm=float(depth.mean()),
        contact_depth_mm=float(depth[where].mean()),
    )


def mean_errors(errors: Sequence[SurfaceErrors]) -> SurfaceErrors:
    """Return the means over presses."""
    names = [field.name for field in fields(SurfaceErrors)]
    return SurfaceErrors(**{name: float(np.mean([getattr(error, name) for error in errors])) for name in names})
