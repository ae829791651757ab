"""The radius of the ball that was pressed, measured by an earlier calibration of the same sensor.

The colours of a press alone do not give the radius R of the ball. In the contact sin(slope) = distance / R, so another
R is the same pattern under a stronger or weaker response of the light, which is what is being calibrated. An earlier
calibration knows the response: the slope that it measures at a known distance gives R.
"""

from collections.abc import Sequence

import numpy as np

from gellight.base.errors import InputError
from gellight.bundle.bundle import Bundle
from gellight.frame_path.pipeline import Reconstructor
from gellight.lab.training.presses import Floats, Press, distance_px
from gellight.lab.training.validation import frame_of

_INNER, _OUTER = 0.3, 0.85
"""in contact radii: where slopes are steep enough to measure, and clear of the rim"""


def felt_radius_mm(bundle: Bundle, presses: Sequence[Press]) -> float:
    """Return the radius of the ball, mm, that fits the slopes inside the circles best: median over the presses.

    Needs square pixels. Raises InputError without presses, or for images of another size.
    """
    if not presses:
        raise InputError("there are no presses to measure the ball by: give at least one")
    reconstructor = Reconstructor(bundle, masked=False, undistorted=False)
    return float(np.median([_radius_px(reconstructor, press) for press in presses])) * bundle.pixel_size_mm[0]


def _radius_px(reconstructor: Reconstructor, press: Press) -> float:
    radius = radius_by_slopes_px(reconstructor.reconstruct(frame_of(press)).normal_map, press, _INNER, _OUTER)
    if not 0 < radius < np.inf:
        raise InputError(f"{press.image}: no ball is felt inside the circle: check the circle and the calibration")
    return radius


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
