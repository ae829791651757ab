"""The contact circle of a ball press, to a fraction of a pixel, or the reason why there is none."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import InputError
from gellight.lab.training.labelling.pattern import (
    LEAST_GREY,
    LEAST_QUALITY,
    SIMPLE,
    STEEPEST,
    PixelSample,
    PressShape,
    Residual,
    background,
    cost,
    difference_image,
    fitted,
    free_response,
    sampled_around,
    standard_errors,
    starts,
    without,
)
from gellight.lab.training.labelling.search import Candidate, best_candidate
from gellight.lab.training.presses import Ball
from gellight.reconstruction.light_drift import light_drift

Array = NDArray[np.float64]
_LEAST_SHARE = 0.2  # chosen: of the ball's radius; smaller contacts are flatter than 12 degrees
_LEAST_RADIUS_PX = 6.0  # chosen: some 110 pixels of contact are the least
WHOLE, ARC = 0.95, 0.25
"""of the circle that has to be seen: all but a sliver; an arc of 90 degrees"""
_BEYOND = 0.7
"""in ball radii: how far off the picture the centre of an arc may lie"""
_LARGEST = 3.0
"""radius of the ball in longer sides of the picture"""
_RIVAL = 0.3  # chosen: of what the best place explains; one that is as good is another press
_MOST_CLIPPED = 0.2
"""of the values in the contact: one channel of three may lose half of its slopes, and the contact is still known"""
_MOST_ERROR_OF_ARC, _MOST_ERROR = 0.07, 0.4
"""of the ball's radius, of the centre: 4 degrees of slope for an arc; whole circles of real gels are told to 0.33 at
worst, and one beside its contact to 0.67: folds do not decide it (docs/figures.md)"""


@dataclass(frozen=True, kw_only=True)
class PressCircle:
    """Where the ball touches the gel."""

    center_x_px: float
    center_y_px: float
    contact_radius_px: float
    quality: float
    """share of the difference image around the circle that the pattern of a ball explains, 0 to 1"""
    contrast_grey: float
    """root mean square of that pattern inside the circle, grey levels"""
    center_error_px: float = 0.0
    """standard error of the centre, and"""
    radius_error_px: float = 0.0
    """of the contact radius, as far as the picture tells them"""

    def record(self) -> dict[str, float]:
        """Return what the csv and JSON hold, rounded."""
        names = ("center_x_px", "center_y_px", "contact_radius_px", "center_error_px", "radius_error_px")
        return {**{name: round(getattr(self, name), 2) for name in names}, "quality": round(self.quality, 3)}


def find_circle(
    image: NDArray[np.uint8], reference: NDArray[np.number], *, ball: Ball, least_view: float = WHOLE
) -> PressCircle:
    """Find the contact circle of the ball in one image, without any calibration of the light.

    image: (H, W, 3) uint8 RGB of the press; reference: (H, W, 3) of the untouched gel, grey levels. The pattern of a
    ball of known radius (`pattern`) is fitted to the difference image together with the unknown response of the light.
    least_view: share of the circle that has to be seen, `WHOLE` or `ARC`.

    Raises InputError with the reason when there is no press, it is too shallow, off the image, clipped or dark, is
    no ball of this size, or there are several.
    """
    try:
        return _found(image, reference, ball, least_view)
    except InputError as error:
        if image.shape == reference.shape and (refusal := light_drift(image, reference).refusal):
            raise InputError(f"{refusal} ({error})") from error
        raise


def _found(image: NDArray[np.uint8], reference: NDArray[np.number], ball: Ball, least_view: float) -> PressCircle:
    difference = difference_image(image, reference)
    _check_size(ball, image)
    candidate = best_candidate(difference, ball.radius_px, _BEYOND if least_view < WHOLE else 0.0)
    shape, circle = fit_circle(
        difference, (candidate.center_x, candidate.center_y), candidate.contact_radius, ball.radius_px
    )
    _check_press(circle, ball)
    _check_view(circle, ball, image.shape[:2], least_view)
    _check_clipped(circle, image, reference)
    _check_error(circle, _MOST_ERROR * ball.radius_px)
    _check_rivals(difference, candidate, shape, ball.radius_px)
    return circle


def _check_size(ball: Ball, image: NDArray[np.uint8]) -> None:
    if ball.radius_px < 2 * _LEAST_RADIUS_PX or ball.radius_px > _LARGEST * max(image.shape[:2]):
        raise InputError(
            f"the ball is {ball.radius_px:.1f} px in radius in an image of {image.shape[1]} x {image.shape[0]} px: "
            "check the ball radius and the pixel size"
        )


def fit_circle(
    difference: Array, center: tuple[float, float], contact_radius: float, ball_radius: float
) -> tuple[PressShape, PressCircle]:
    """Fit the pattern to the (H, W, 3) difference image around a first guess of the circle, px, with free response."""
    pixels = sampled_around(difference, center, contact_radius, ball_radius)
    residual, few = free_response(pixels, ball_radius), free_response(pixels.few(), ball_radius)
    guesses = [fitted(few, begin, ball_radius) for begin in starts(center, contact_radius, ball_radius)]
    shape = fitted(residual, min(guesses, key=lambda guess: cost(residual(guess.vector()))), ball_radius)
    return shape, _judged(shape, pixels, residual, ball_radius)


def _judged(shape: PressShape, pixels: PixelSample, residual: Residual, ball_radius: float) -> PressCircle:
    """Say how well the pattern explains the colours, and how well the circle is known."""
    left, errors = residual(shape.vector()), _errors(shape, pixels, residual, ball_radius)
    changed = without(background(pixels.x, pixels.y, shape, ball_radius), pixels.colour)
    pattern = changed - left
    inside = np.hypot(pixels.x - shape.center_x, pixels.y - shape.center_y) < shape.contact_radius
    return PressCircle(
        center_x_px=shape.center_x,
        center_y_px=shape.center_y,
        contact_radius_px=shape.contact_radius,
        quality=float(1 - (left**2).sum() / max((changed**2).sum(), 1e-12)),
        contrast_grey=float(np.sqrt((pattern[inside] ** 2).mean())) if inside.any() else 0.0,
        center_error_px=float(np.hypot(*errors[:2])),
        radius_error_px=float(errors[2]),
    )


def _errors(shape: PressShape, pixels: PixelSample, residual: Residual, ball_radius: float) -> Array:
    """(3,) standard errors of centre and contact radius, px.

    Where the border cuts the circle, what the light is taken to do decides more than noise: so how far the circle moves
    under a simpler response is an error too.
    """
    scatter = standard_errors(residual, shape.vector(), pixels.parts())
    other = fitted(free_response(pixels, ball_radius, SIMPLE), shape, ball_radius)
    return np.hypot(scatter, other.vector() - shape.vector())[:3]


def _check_press(circle: PressCircle, ball: Ball) -> None:
    radius = circle.contact_radius_px
    if circle.contrast_grey < LEAST_GREY:
        raise InputError(
            f"no press: the strongest pattern of a ball changes the colours by {circle.contrast_grey:.1f} grey levels, "
            f"at least {LEAST_GREY:g} are needed: press the ball into the gel"
        )
    if circle.quality < LEAST_QUALITY:
        raise InputError(
            f"no single ball of {ball.radius_mm:g} mm: its pattern explains {100 * circle.quality:.0f} % of what "
            f"changed, at least {100 * LEAST_QUALITY:.0f} % are needed: press one clean and smooth ball, check its "
            "radius and the size of a pixel"
        )
    least = max(_LEAST_SHARE * ball.radius_px, _LEAST_RADIUS_PX)
    if radius < least:
        raise InputError(
            f"the press is too shallow: contact radius {radius:.1f} px, at least {least:.1f} px are needed: "
            "press deeper"
        )
    if radius > 0.995 * STEEPEST * ball.radius_px:
        raise InputError(
            f"the contact is as wide as the ball itself ({ball.radius_px:.1f} px): "
            "check the ball radius and the pixel size, or press less deep"
        )


def _check_view(circle: PressCircle, ball: Ball, image_shape: tuple[int, ...], least_view: float) -> None:
    """Refuse a circle of which the border of the image leaves too little."""
    height, width = image_shape[:2]
    angle = np.linspace(0, 2 * np.pi, 360, endpoint=False)
    x = circle.center_x_px + circle.contact_radius_px * np.cos(angle)
    y = circle.center_y_px + circle.contact_radius_px * np.sin(angle)
    seen = float(((x >= 0) & (x <= width - 1) & (y >= 0) & (y <= height - 1)).mean())
    if seen < least_view:
        raise InputError(
            f"the press is off the image: {100 * seen:.0f} % of the circle around ({circle.center_x_px:.0f}, "
            f"{circle.center_y_px:.0f}) px is seen, at least {100 * least_view:.0f} % are needed: press nearer to the "
            "middle"
        )
    if seen < WHOLE:
        _check_error(circle, _MOST_ERROR_OF_ARC * ball.radius_px, f"{100 * seen:.0f} % of it is seen, and ")


def _check_error(circle: PressCircle, most_px: float, why: str = "") -> None:
    """Refuse a circle whose centre is not known to `most_px`."""
    if circle.center_error_px > most_px:
        raise InputError(
            f"the circle is uncertain: {why}its centre is known to {circle.center_error_px:.1f} px, at most "
            f"{most_px:.1f} px may be: press one clean ball, nearer to the middle, on gel as in the reference"
        )


def _check_clipped(circle: PressCircle, image: NDArray[np.uint8], reference: NDArray[np.number]) -> None:
    rows, columns = np.indices(image.shape[:2])
    inside = np.hypot(columns - circle.center_x_px, rows - circle.center_y_px) < circle.contact_radius_px
    clipped = ((image[inside] == 255) | ((image[inside] == 0) & (reference[inside] > 0))).mean()
    if clipped > _MOST_CLIPPED:
        raise InputError(
            f"the image is clipped: {100 * clipped:.0f} % of the values in the circle are at 0 or 255 grey levels, "
            f"at most {100 * _MOST_CLIPPED:.0f} % may be: change the exposure or the brightness of the light"
        )


def _check_rivals(difference: Array, first: Candidate, shape: PressShape, ball_radius: float) -> None:
    """Look for a second press in what is left when everything around the first is blanked."""
    rows, columns = np.indices(difference.shape[:2])
    distance = np.hypot(columns - shape.center_x, rows - shape.center_y)
    # The skirt of the first press fades towards its surroundings, so that the cut makes no edge to be found.
    kept = np.clip(distance / (2 * shape.contact_radius) - 0.75, 0, 1)
    second = best_candidate(difference * kept[..., None], ball_radius)
    if second.gain > _RIVAL * first.gain:
        raise InputError(
            f"several presses: at ({first.center_x:.0f}, {first.center_y:.0f}) and near ({second.center_x:.0f}, "
            f"{second.center_y:.0f}) px: press one ball at a time, and take the reference without a touch"
        )
