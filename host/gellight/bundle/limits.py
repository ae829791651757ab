"""What the verification of a bundle must have reached before the bundle may be installed."""

import math
from dataclasses import dataclass

from gellight.base.errors import BundleError, InputError
from gellight.bundle.bundle import Bundle


@dataclass(frozen=True, kw_only=True)
class Limits:
    """The largest errors on fresh presses.

    The defaults are what the best calibrations of real, soft sensors of this kind reach; a rigid simulated one does
    ten times better.
    """

    depth_mm: float = 0.08
    """mean absolute depth error: in contact against the simulator's truth, nothing taken off, where it is known; and
    inside the contact circle, the mean error of each press taken off, as a circle does not say how deep its rim lies"""
    normal_deg: float = 7.0
    """mean angle between the normals there"""

    def __post_init__(self) -> None:
        """Refuse what no calibration could reach."""
        for name, value in vars(self).items():
            if not (math.isfinite(value) and value > 0):
                raise InputError(f"the largest {name} allowed is {value}: give a limit greater than 0")

    def check(self, bundle: Bundle) -> None:
        """Raise BundleError unless fresh presses have shown the bundle to be within the limits."""
        figures = bundle.metrics.get("verification", {})
        try:
            shape_mm, normal_deg = float(figures["depth_mm"]), float(figures["normal_deg"])
            true_mm = figures.get("true_depth_mm")
            depth_mm = shape_mm if true_mm is None else float(true_mm)
        except (AttributeError, TypeError, KeyError, ValueError) as error:
            raise BundleError(
                f"{bundle.source} was never verified on fresh presses: run `gellight calibrate`, whose last step does "
                "that"
            ) from error
        if not (max(depth_mm, shape_mm) <= self.depth_mm and normal_deg <= self.normal_deg):
            shape = f"{shape_mm * 1000:.0f} um with the mean error of each press taken off"
            depth = f"shape of the depth {shape}" if true_mm is None else f"depth {depth_mm * 1000:.0f} um; {shape}"
            raise BundleError(
                f"{bundle.source} did not pass its verification ({depth}; normals {normal_deg:.1f} degrees; allowed "
                f"are {self.depth_mm * 1000:.0f} um and {self.normal_deg:g} degrees): nothing was replaced; "
                "calibrate again"
            )
