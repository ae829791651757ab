"""The contact circle of one ball press: found by itself, or as the user corrects it."""

import math
from dataclasses import asdict, dataclass

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import InputError
from gellight.calibration.bulletin import Picture
from gellight.training.labelling import find_circle
from gellight.training.presses import Ball, Press

LEAST_SHARE = 0.15
"""of the ball's radius: a smaller contact shows too few slopes"""
_NAMES = ("center_x_px", "center_y_px", "contact_radius_px")


@dataclass(frozen=True, kw_only=True)
class Circle:
    """A contact circle in pixels."""

    center_x_px: float
    center_y_px: float
    contact_radius_px: float

    def as_json(self) -> dict[str, float]:
        """Return the three numbers by name."""
        return asdict(self)

    @classmethod
    def of(cls, press: Press) -> "Circle":
        """Return the circle of a press."""
        return cls(
            center_x_px=press.center_x_px, center_y_px=press.center_y_px, contact_radius_px=press.contact_radius_px
        )

    @classmethod
    def checked(cls, values: dict[str, float], ball: Ball, image_shape: tuple[int, int]) -> "Circle":
        """Return a circle from the user's numbers; InputError unless this ball can have made it in this picture."""
        if set(values) != set(_NAMES) or not all(math.isfinite(value) for value in values.values()):
            raise InputError(f"a circle is {', '.join(_NAMES)}, not {values}: give three numbers in px")
        circle = cls(**values)
        circle.check(ball, image_shape)
        return circle

    def check(self, ball: Ball, image_shape: tuple[int, int]) -> None:
        """Refuse a press that is too shallow, too far out, or wider than the ball."""
        height, width = image_shape
        radius, share = self.contact_radius_px, self.contact_radius_px / ball.radius_px
        if share >= 1:
            raise InputError(
                f"the contact has a radius of {radius:.0f} px, the ball only {ball.radius_px:.0f} px: is it a ball of "
                f"{ball.radius_mm:g} mm radius?"
            )
        if share < LEAST_SHARE:
            raise InputError(f"the press is too shallow: its contact is {radius:.0f} px in radius; press deeper")
        x, y = self.center_x_px, self.center_y_px
        if not (0 <= x <= width - 1 and 0 <= y <= height - 1):
            raise InputError(f"the press at ({x:.0f}, {y:.0f}) px is off the picture: press nearer to the middle")


def circle_of(image: NDArray[np.uint8], reference: NDArray[np.float32], ball: Ball) -> Circle:
    """Find the contact circle of a (H, W, 3) picture; InputError says why a press is refused."""
    found = find_circle(image, reference, ball=ball)
    circle = Circle(
        center_x_px=float(found.center_x_px),
        center_y_px=float(found.center_y_px),
        contact_radius_px=float(found.contact_radius_px),
    )
    circle.check(ball, (image.shape[0], image.shape[1]))
    return circle


def drawn(image: Picture, circle: Circle) -> Picture:
    """Draw a circle and its centre on a picture."""
    picture = image.copy()
    rows, columns = np.indices(image.shape[:2])
    distance = np.hypot(columns - circle.center_x_px, rows - circle.center_y_px)
    picture[np.abs(distance - circle.contact_radius_px) < 0.8] = (255, 240, 80)
    picture[distance < 1.6] = (255, 240, 80)
    return picture
