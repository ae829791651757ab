"""Cast shadows under distant light: how high the horizon stands, seen from each point of the surface.

A point is lit from elevation e when tan e exceeds the tangent of its horizon in that direction. The horizon depends on
the azimuth alone, so one map per azimuth serves every incident angle and every number of lights.
"""

from math import ceil, cos, hypot, sin

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.floating]


def horizon(depth_mm: Array, spacing_mm: float, azimuth_rad: float, reach_mm: float) -> Array:
    """Return the tangent of the horizon's elevation towards `azimuth_rad`: (H, W), at least 0.

    Points up to `reach_mm` away are considered; `reach(...)` says how far is enough. Beyond the map lies no obstacle.
    """
    across, down = cos(azimuth_rad), -sin(azimuth_rad)
    swapped = abs(down) > abs(across)
    turned = depth_mm.T if swapped else depth_mm
    along, aside = (down, across) if swapped else (across, down)
    flips = (slice(None, None, -1 if aside < 0 else 1), slice(None, None, -1 if along < 0 else 1))
    tangent = _march(np.ascontiguousarray(turned[flips]), spacing_mm, abs(aside / along), reach_mm)[flips]
    return np.ascontiguousarray(tangent.T if swapped else tangent)


def reach(depth_mm: Array, incident_angle_rad: float) -> float:
    """Return how far in mm a shadow can fall under light `incident_angle_rad` from the normal."""
    return float(np.ptp(depth_mm) * np.tan(incident_angle_rad))


def _march(depth: Array, spacing: float, slope: float, reach_mm: float) -> Array:
    """Horizon towards +column and +row * `slope`: step by step, the surface there is the surface here, shifted."""
    tangent, rise = np.zeros_like(depth), np.empty_like(depth)
    next_row = depth[1:] - depth[:-1]
    length = spacing * hypot(1, slope)
    rows, columns = depth.shape
    for step in range(1, min(ceil(reach_mm / length), columns - 1) + 1):
        down, share = divmod(step * slope, 1.0)
        first, last = int(down), rows - 1
        if first >= last:
            break
        here = (slice(0, last - first), slice(0, columns - step))
        there = (slice(first, last), slice(step, columns))
        higher = rise[here]
        np.multiply(next_row[there], share, out=higher)
        higher += depth[there]
        higher -= depth[here]
        higher *= 1 / (step * length)
        np.maximum(tangent[here], higher, out=tangent[here])
    return tangent
