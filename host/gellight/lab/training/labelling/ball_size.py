"""The radius of the ball that was pressed, measured by an earlier calibration of the same sensor.

The colours of a press alone do not give the radius R of the ball. In the contact sin(slope) = distance / R, so another
R is the same pattern under a stronger or weaker response of the light, which is what is being calibrated. An earlier
calibration knows the response: the slope that it measures at a known distance gives R.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from gellight.base.errors import InputError
from gellight.bundle.bundle import Bundle
from gellight.frame_path.pipeline import Reconstructor
from gellight.lab.training.presses import Floats, Press, distance_px
from gellight.lab.training.validation import frame_of

_INNER, _OUTER = 0.3, 0.85
"""in contact radii: where slopes are steep enough to measure, and clear of the rim"""


class FeltBall(NamedTuple):
    """The ball by the slopes inside labelled circles."""

    radius_mm: float
    """that fits them best: median over the presses"""
    without: tuple[str, ...]
    """images in whose circle no ball is felt"""


def felt_ball(bundle: Bundle, presses: Sequence[Press]) -> FeltBall:
    """Return the ball that a bundle feels.

    Needs square pixels. Raises InputError where no press shows a ball, or for images of another size.
    """
    path, found, without = Reconstructor(bundle, masked=False, undistorted=False), [], []
    for press in presses:
        radius = radius_by_slopes_px(path.reconstruct(frame_of(press)).normal_map, press, _INNER, _OUTER)
        if 0 < radius < np.inf:
            found.append(radius)
        else:
            without.append(press.image.name)
    if not found:
        raise InputError("no ball is felt inside any circle: check the circles and the calibration")
    return FeltBall(float(np.median(found)) * bundle.pixel_size_mm[0], tuple(without))


def radius_by_slopes_px(normal_map: Floats, press: Press, inner: float, outer: float) -> float:
    """Return R by least squares of sin(slope) = distance / R between two shares of the contact radius, px.

    Slopes of the (H, W, 3) normals count along the radius only: where the gel rises the normal leans outwards.
    """
    distance = distance_px(press, (normal_map.shape[0], normal_map.shape[1])) / press.contact_radius_px
    rows, columns = np.nonzero((distance >= inner) & (distance < outer))
    normal = normal_map[rows, columns].astype(np.float64)
    x, y = columns - press.center_x_px, rows - press.center_y_px
    with np.errstate(divide="ignore"):
        return float((x * x + y * y).sum() / (normal[:, 0] * x + normal[:, 1] * y).sum())
