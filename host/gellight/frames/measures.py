"""What is computed of a tactile frame only when somebody asks for it: the force, the confidence of each pixel."""

from collections.abc import Callable
from dataclasses import dataclass, field
from enum import StrEnum
from functools import cached_property
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from gellight.frames.shear import DotsSeen, Floats, Shear
from gellight.frames.status import ForceStatus

BEYOND_VIEW = "beyond_view"
"""flag of a force: the touch reaches the border of the view, so a part of it is missing"""
HEAVIER = "heavier"
"""flag of a force: it is larger than any that the sensor was calibrated with"""


@dataclass(frozen=True, kw_only=True, eq=False)
class ForceFigures:
    """`Force` without its map."""

    normal_n: float
    """N, 0 where nothing touches"""
    error_n: float
    """N, one standard deviation; with a flag the force may be farther off"""
    flags: tuple[str, ...] = ()
    """`beyond_view`, `heavier`"""

    def as_json(self) -> ForceStatus:
        """Return the figures, ready for JSON."""
        return {"normal_n": self.normal_n, "error_n": self.error_n, "flags": self.flags}


@dataclass(frozen=True, kw_only=True, eq=False)
class Force(ForceFigures):
    """The force that presses the gel, along its normal; found by depth, so shear is not in it."""

    pressure_of: Callable[[], NDArray[np.float32]] = field(repr=False)
    """computes the pressure map"""

    @cached_property
    def pressure_mpa(self) -> NDArray[np.float32]:
        """(H, W) pressure over the gel at rest, MPa (N / mm2), constant over cells of a tenth of the gel's thickness.

        Its integral is the force.
        """
        return self.pressure_of()


STEEP, DARK, CLIPPED, ELSEWHERE, STRANGE = 1, 2, 4, 8, 16
"""quality flags of a pixel: steeper than what was learnt; a colour in shadow; a grey level that cannot grow; far from
every press that was learnt from; a colour that none of them had"""


@dataclass(frozen=True, kw_only=True, eq=False)
class Confidence:
    """How far each pixel is to be believed."""

    value: NDArray[np.float32]
    """(H, W) from 1, as good as the calibration, down to 0.05, a guess; for weights, no probability"""
    quality_flags: NDArray[np.uint8]
    """(H, W) why: bits `STEEP`, `DARK`, `CLIPPED`, `ELSEWHERE`, `STRANGE`; 0 where nothing is known against it"""

    @property
    def not_learnt(self) -> NDArray[np.bool_]:
        """(H, W) pixels whose place or colour the calibration never saw."""
        return self.quality_flags & (ELSEWHERE | STRANGE) > 0


@dataclass(frozen=True, kw_only=True, eq=False)
class ErrorBounds:
    """What nine in ten pixels under a ball are off by at most, as far as presses that were not learnt from tell.

    Objects of another shape are farther off: docs/figures.md has figures. inf where nobody knows: outside of
    contacts, where the surface is steeper than any of these presses, and where no press lay or had such a colour.
    """

    normal_deg: NDArray[np.float32]
    """(H, W) angle between the normals, degrees"""
    shape_mm: NDArray[np.float32]
    """(H, W) depth beside the mean of its contact, mm: a circle does not say how deep its rim is"""

    def unless(self, unknown: NDArray[np.bool_]) -> "ErrorBounds":
        """Return the same with inf where (H, W) pixels are marked."""
        return ErrorBounds(
            normal_deg=np.where(unknown, np.float32(np.inf), self.normal_deg),
            shape_mm=np.where(unknown, np.float32(np.inf), self.shape_mm),
        )


class MapOnRequest(StrEnum):
    """A map that is computed and carried only where somebody asks for it."""

    PRESSURE = "pressure_mpa"
    """`Force.pressure_mpa`"""
    CONFIDENCE = "confidence"
    """both maps of `Confidence`"""


class FrameMeasures(Protocol):
    """Computes what a sensor can say of a frame beyond its maps."""

    from_network: bool
    """whether a network found the slopes, which is less sure where they are steeper than those it was trained on"""

    def force(self, depth_mm: NDArray[np.float32]) -> Force | None:
        """Return the force that makes a (H, W) depth map; None for a sensor without a constant for it."""

    def shear(self, depth_mm: NDArray[np.float32], dots: DotsSeen, force: Force | None) -> Shear | None:
        """Return how the gel is moved and pulled along itself, by its dots, (H, W) depth and normal force.

        None for a sensor whose gel nobody knows.
        """

    def dot_motion(self, depth_mm: NDArray[np.float32], dots: DotsSeen) -> tuple[Floats, Floats] | None:
        """Return (N, 2) rest places of dots, mm from the image centre, and (N, 2) mm they have moved along the gel.

        None for a sensor whose gel nobody knows.
        """

    def confidence(self, image: NDArray[np.uint8], gradient_map: NDArray[np.float32]) -> Confidence:
        """Judge the pixels of a frame by its (H, W, 3) picture and its (H, W, 2) slopes."""

    def never_seen(self, image: NDArray[np.uint8], pixels: NDArray[np.intp]) -> NDArray[np.bool_]:
        """Say of (n,) flat indices of a frame's pixels what `Confidence.not_learnt` says of all."""

    def error_bounds(
        self, gradient_map: NDArray[np.float32], depth_mm: NDArray[np.float32], touched: NDArray[np.bool_]
    ) -> ErrorBounds | None:
        """Return the errors of a frame by its (H, W, ...) maps; None for a sensor whose bundle does not know them."""
