"""The radius of the ball that was pressed, measured by an earlier calibration of the same sensor.

The colours of a press alone do not give the radius R of the ball. In the contact sin(slope) = distance / R, so another
R is the same pattern under a stronger or weaker response of the light, which is what is being calibrated. An earlier
calibration knows the response: the slope that it measures at a known distance gives R.
"""

from collections.abc import Sequence

import numpy as np

from gellight.base.errors import InputError
from gellight.bundle.bundle import Bundle
from gellight.lab.training.presses import Ball, Press, distance_px
from gellight.lab.training.validation import frame_of
from gellight.reconstruction.pipeline import Reconstructor

TOLERANCE = 0.12
"""relative difference of radii from which a ball counts as another one"""
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


def check_ball(bundle: Bundle, presses: Sequence[Press], ball: Ball) -> float:
    """Return `felt_radius_mm`, and raise InputError if it is not the radius of the ball that was named."""
    measured = felt_radius_mm(bundle, presses)
    if abs(measured / ball.radius_mm - 1) > TOLERANCE:
        raise InputError(
            f"the ball is said to have a radius of {ball.radius_mm:g} mm, but to {bundle.source} the presses look "
            f"like a ball of {measured:.3g} mm: give that radius, press the right ball, or check the pixel size"
        )
    return measured


def _radius_px(reconstructor: Reconstructor, press: Press) -> float:
    """Least squares of sin(slope) = distance / R over a ring of the contact; slopes count along the radius only."""
    normal = reconstructor.reconstruct(frame_of(press)).normal_map
    distance = distance_px(press, (normal.shape[0], normal.shape[1])).astype(np.float64)
    ring = (distance > _INNER * press.contact_radius_px) & (distance < _OUTER * press.contact_radius_px)
    rows, columns = np.nonzero(ring)
    r = distance[ring]
    # The normal leans outwards where the gel rises: its radial part is the sine of the slope.
    sine = (normal[ring, 0] * (columns - press.center_x_px) + normal[ring, 1] * (rows - press.center_y_px)) / r
    strength = float((sine * r).sum() / (r * r).sum())
    if strength <= 0:
        raise InputError(f"{press.image}: no ball is felt inside the circle: check the circle and the calibration")
    return 1 / strength
