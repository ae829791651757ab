"""Cast shadows under distant light: how high the horizon stands, seen from each point of the surface.

A point is lit from elevation e when tan e exceeds the tangent of its horizon in that direction. The horizon depends on
the azimuth alone, so one map per azimuth serves every incident angle and every number of lights.
"""

from math import ceil, cos, hypot, sin

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.floating]
Box = tuple[int, int, int, int]
"""first row, last row + 1, first column, last column + 1"""
STEPS_BETWEEN_CHECKS = 8


def horizon(depth_mm: Array, spacing_mm: float, azimuth_rad: float, reach_mm: float, box: Box | None = None) -> Array:
    """Return the tangent of the horizon's elevation towards `azimuth_rad`, at least 0: (H, W), or that of `box` only.

    Points up to `reach_mm` away are considered; `reach(...)` says how far is enough. Beyond the map lies no obstacle.
    """
    across, down = cos(azimuth_rad), -sin(azimuth_rad)
    height, width = depth_mm.shape
    top, bottom, left, right = box or (0, height, 0, width)
    turned = depth_mm
    if abs(down) > abs(across):
        turned, across, down = depth_mm.T, down, across
        height, width, top, bottom, left, right = width, height, left, right, top, bottom
    upside, leftwards = down < 0, across < 0
    if upside:
        top, bottom = height - bottom, height - top
    if leftwards:
        left, right = width - right, width - left
    flips = (slice(None, None, -1 if upside else 1), slice(None, None, -1 if leftwards else 1))
    seen = np.ascontiguousarray(turned[flips])
    tangent = _march(seen, spacing_mm, abs(down / across), reach_mm, (top, bottom, left, right))[flips]
    return np.ascontiguousarray(tangent if turned is depth_mm else tangent.T)


def reach(depth_mm: Array, incident_angle_rad: float) -> float:
    """Return how far in mm a shadow can fall under light `incident_angle_rad` from the normal."""
    return float(np.ptp(depth_mm) * np.tan(incident_angle_rad))


def box_of(region: NDArray[np.bool_]) -> Box:
    """Return the smallest box that holds the true pixels of `region` (H, W)."""
    rows, columns = np.flatnonzero(region.any(axis=1)), np.flatnonzero(region.any(axis=0))
    return int(rows[0]), int(rows[-1]) + 1, int(columns[0]), int(columns[-1]) + 1


def _march(depth: Array, spacing: float, slope: float, reach_mm: float, box: Box) -> Array:
    """Horizon towards +column and +row * `slope`: step by step, the surface there is the surface here, shifted."""
    top, bottom, left, right = box
    here = np.ascontiguousarray(depth[top:bottom, left:right])
    next_row = depth[1:] - depth[:-1]
    tangent, rise, room = np.zeros_like(here), np.empty_like(here), depth.max() - here
    length = spacing * hypot(1, slope)
    rows, columns = depth.shape
    for step in range(1, ceil(reach_mm / length) + 1):
        whole, share = divmod(step * slope, 1.0)
        down = int(whole)
        kept = (
            slice(0, max(min(bottom, rows - 1 - down) - top, 0)),
            slice(0, max(min(right, columns - step) - left, 0)),
        )
        higher = rise[kept]
        if not higher.size:
            break
        there = (slice(top + down, top + down + higher.shape[0]), slice(left + step, left + step + higher.shape[1]))
        np.multiply(next_row[there], share, out=higher)
        higher += depth[there]
        higher -= here[kept]
        higher *= 1 / (step * length)
        np.maximum(tangent[kept], higher, out=tangent[kept])
        # Not even the highest point of the map, one step on, would stand above the horizon.
        if step % STEPS_BETWEEN_CHECKS == 0 and (room <= tangent * ((step + 1) * length)).all():
            break
    return tangent
