"""Whether a ring that was fitted to the light on the flat gel is the right one: a ball of known radius tells.

How light falls off over the flat gel hardly tells a low ring from a high one: on real pictures a fit with a misfit of
0.4 % was 24 degrees off, and depth 61 % too low. The slopes of a ball are all too steep or too gentle then, so that it
feels like another ball.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import BundleError
from gellight.bundle.bundle import Bundle
from gellight.lab.optics.lights.ball_series import INNER
from gellight.lab.training.labelling import find_circle
from gellight.lab.training.labelling.ball_size import radius_by_slopes_px
from gellight.lab.training.presses import Ball, Press
from gellight.photometric.light_model import LightGroups, LightModel, signals_of, without_shadows
from gellight.photometric.solver import flat_gel, light_rows, slopes, solve_robustly
from gellight.reconstruction.integration import normals

TOLERANCE = 0.1
"""relative difference of the radius felt from the ball's"""


def confirm_ring(
    model: LightModel, bundle: Bundle, pictures: Sequence[Sequence[NDArray[np.uint8]]], radius_mm: float
) -> float:
    """Return the radius that a pressed ball feels like by the ring of `model`, mm.

    pictures: of the press, under each LED alone, each (H, W, 3) uint8. Raises BundleError where it is not the radius
    of the ball, and InputError where no ball is found in the pictures.
    """
    ball = Ball.seen_by(bundle, radius_mm)
    signals = signals_of(pictures, model.groups(LightGroups.SINGLES), model, bundle.manifest.noise_grey)
    references = model.references(LightGroups.SINGLES).astype(np.float32).reshape(len(model.colours), -1)
    signals = without_shadows(signals, references)
    circle = find_circle(model.grey(signals.light, model.image_shape), bundle.reference, ball=ball)
    rows = light_rows(flat_gel(model.image_shape, bundle.pixel_size_mm), references, model.ring)
    scaled, _ = solve_robustly(signals.grey, rows, signals.valid, signals.deviation.astype(np.float32))
    gradient_map = np.moveaxis(slopes(scaled).reshape(2, *model.image_shape), 0, 2)
    x, y, radius = circle.center_x_px, circle.center_y_px, circle.contact_radius_px
    press = Press(image=Path("the ball"), center_x_px=x, center_y_px=y, contact_radius_px=radius)
    felt_mm = radius_by_slopes_px(normals(gradient_map), press, 0.0, INNER) * ball.pixel_size_mm
    if not abs(felt_mm / radius_mm - 1) <= TOLERANCE:
        raise BundleError(
            f"the ring that fits the light on the flat gel feels the ball of {radius_mm:g} mm as one of {felt_mm:.3g} "
            "mm, so its LEDs are elsewhere: measure the ring, set [geometry], and leave --ring-from-light out"
        )
    return felt_mm
