"""Where a search for the object may begin: what it may have done since the last frame.

Gauss-Newton finds the nearest minimum, and a relief that moved by half of its own wavelength has several. So the motion
is also guessed from what can be seen at once: how far the contact has moved, and how far the relief in it. A round body
whose contact moves farther than its relief has rolled.
"""

import cv2
import numpy as np
from numpy.typing import NDArray

from gellight.frames.pixel_grid import bounding_box
from gellight.tracking.rigid import pose_of
from gellight.tracking.view import View

Array = NDArray[np.float64]
FLAT_MM = 40.0
"""a body with a larger radius does not roll"""
SPINS_RAD = np.radians([-20.0, -10.0, 10.0, 20.0])


def guesses(before: View, now: View) -> list[Array]:
    """Return poses that the motion from one view to the next may be near to; rest is the first."""
    contact = now.centre_mm - before.centre_mm
    relief = np.append(_relief_shift(before, now), contact[2])
    still = np.append(np.zeros(2), contact[2])
    guessed = [np.eye(4)]
    guessed += [_moved(before, shift, np.zeros(3)) for shift in (contact, relief)]
    radius_mm = _radius_mm(before)
    if radius_mm < FLAT_MM:
        for shift in (still, relief):
            x, y = (shift - contact)[:2] / radius_mm
            guessed.append(_moved(before, shift, np.array([-y, x, 0.0])))
    return guessed


def spins(before: View, now: View, angles_rad: Array = SPINS_RAD) -> list[Array]:
    """Return poses that move the contact to where it is now and turn it about z."""
    return [_moved(before, now.centre_mm - before.centre_mm, np.array([0, 0, angle])) for angle in angles_rad]


def _moved(view: View, shift_mm: Array, turn_rad: Array) -> Array:
    return pose_of(np.concatenate([shift_mm, turn_rad]), view.centre_mm)


def _relief_shift(before: View, now: View) -> Array:
    """Return by how many mm along x and y the curvatures have moved, by phase correlation."""
    rows, columns = bounding_box(before.touching | now.touching, 4)
    parts = [
        np.ascontiguousarray(((view.curvatures[..., 0] + view.curvatures[..., 2]) * view.touching)[rows, columns])
        for view in (before, now)
    ]
    if min(parts[0].shape) < 8:
        return np.zeros(2)
    (x, y), _ = cv2.phaseCorrelate(*parts)
    return np.array([x * now.pixel_mm[0], y * now.pixel_mm[1]])


def _radius_mm(view: View) -> float:
    """Return the radius of the body by the mean of its curvatures."""
    if not view.inside.any():
        return np.inf
    mean = float((view.curvatures[..., 0] + view.curvatures[..., 2])[view.inside].mean()) / 2
    return 1 / max(-mean, 1e-6)
