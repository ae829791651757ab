"""Circles that a hand drew, moved to where the picture of each shows the edge.

Circles drawn by hand are some pixels off, and lie outside the contact, on the first fall of the skirt. The picture of a
press shows its circle by itself; the drawn one says where to begin. So no press has a part in the circle of another,
and one that is held out stays unknown to what it judges.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gellight.lab.training.labelling.circle import PressCircle, fit_circle
from gellight.lab.training.labelling.pattern import LEAST_QUALITY, difference_image
from gellight.lab.training.presses import Ball, Press

_FARTHEST = 0.35
"""in ball radii: a circle that would move farther keeps its label, and is named"""


@dataclass(frozen=True, kw_only=True, eq=False)
class Refined:
    """Presses before and after."""

    labelled: Sequence[Press]
    presses: list[Press]
    """in the same order"""

    @property
    def kept(self) -> list[str]:
        """Names of images whose circle stayed as labelled: they show no clear ball near it."""
        return [old.image.name for old, new in zip(self.labelled, self.presses, strict=True) if new is old]

    def record(self) -> dict[str, object]:
        """Return what a bundle says of it; shifts of centres, px, and of radii as a ratio."""
        before, after = _circles(self.labelled), _circles(self.presses)
        shift = after[:, :2] - before[:, :2]
        return {
            "rms_shift_px": round(float(np.sqrt((shift**2).sum(axis=1).mean())), 3),
            "mean_shift_px": [round(float(value), 3) for value in shift.mean(axis=0)],
            "radius_of_light_over_label": round(float(after[:, 2].sum() / before[:, 2].sum()), 4),
            "kept_images": self.kept,
        }


def refine(presses: Sequence[Press], reference: NDArray[np.number], ball: Ball) -> Refined:
    """Refit each circle from where it was drawn; reference is (H, W, 3), grey levels.

    Raises InputError for an image that is none of this sensor.
    """
    return Refined(labelled=presses, presses=[_refined(press, reference, ball) for press in presses])


def shown_circle(press: Press, reference: NDArray[np.number], ball: Ball) -> PressCircle:
    """Return the circle that the picture of a press shows near its label; InputError as `difference_image`."""
    difference, center = difference_image(press.picture(), reference), (press.center_x_px, press.center_y_px)
    return fit_circle(difference, center, press.contact_radius_px, ball.radius_px)[1]


def _refined(press: Press, reference: NDArray[np.number], ball: Ball) -> Press:
    shown = shown_circle(press, reference, ball)
    far_px = np.hypot(shown.center_x_px - press.center_x_px, shown.center_y_px - press.center_y_px)
    if shown.quality < LEAST_QUALITY or far_px > _FARTHEST * ball.radius_px:
        return press
    return replace(
        press,
        center_x_px=shown.center_x_px,
        center_y_px=shown.center_y_px,
        contact_radius_px=shown.contact_radius_px,
        found=True,
    )


def _circles(presses: Sequence[Press]) -> NDArray[np.float64]:
    """(n, 3) centre and radius of each, px"""
    return np.array([(press.center_x_px, press.center_y_px, press.contact_radius_px) for press in presses])
