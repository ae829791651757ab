"""The contact circle of one ball press: found by itself, or as the user corrects it."""

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from gellight.base.errors import InputError
from gellight.lab.calibration.display import Picture
from gellight.lab.calibration.records import Circle
from gellight.lab.training.labelling import find_circle
from gellight.lab.training.presses import Ball, Press

LEAST_SHARE = 0.15
"""of the ball's radius: a smaller contact shows too few slopes"""


def circle_of(image: NDArray[np.uint8], reference: NDArray[np.float32], ball: Ball) -> Circle:
    """Find the contact circle of a (H, W, 3) picture; InputError says why a press is refused."""
    return Circle.model_validate(find_circle(image, reference, ball=ball), from_attributes=True)


def corrected_circle(numbers: dict[str, float], ball: Ball, image_shape: tuple[int, int]) -> Circle:
    """Return the user's circle; InputError unless this ball can have made it in a (H, W) picture."""
    try:
        circle = Circle.model_validate(numbers)
    except ValidationError as error:
        names = ", ".join(Circle.model_fields)
        raise InputError(f"a circle is {names}, not {numbers}: give three numbers in px") from error
    radius, share = circle.contact_radius_px, circle.contact_radius_px / ball.radius_px
    if share >= 1:
        raise InputError(
            f"the contact has a radius of {radius:.0f} px, the ball only {ball.radius_px:.0f} px: is it a ball of "
            f"{ball.radius_mm:g} mm radius?"
        )
    if share < LEAST_SHARE:
        raise InputError(f"the press is too shallow: its contact is {radius:.0f} px in radius; press deeper")
    x, y = circle.center_x_px, circle.center_y_px
    if not (0 <= x <= image_shape[1] - 1 and 0 <= y <= image_shape[0] - 1):
        raise InputError(f"the press at ({x:.0f}, {y:.0f}) px is off the picture: press nearer to the middle")
    return circle


def drawn(image: Picture, circle: Circle | Press) -> Picture:
    """Draw a circle and its centre on a picture."""
    picture = image.copy()
    rows, columns = np.indices(image.shape[:2])
    distance = np.hypot(columns - circle.center_x_px, rows - circle.center_y_px)
    picture[np.abs(distance - circle.contact_radius_px) < 0.8] = (255, 240, 80)
    picture[distance < 1.6] = (255, 240, 80)
    return picture
