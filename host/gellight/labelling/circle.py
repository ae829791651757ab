"""The contact circle of a ball press, to a fraction of a pixel, or the reason why there is none."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage, optimize

from gellight.errors import InputError
from gellight.labelling.pattern import STEEPEST, PressShape, background, response
from gellight.labelling.search import Candidate, best_candidate
from gellight.light_drift import light_drift
from gellight.presses import Ball

Array = NDArray[np.float64]
_BLUR_PX = 0.8
_FITTED_PIXELS = 1200
"""chosen at random from the window: a thousand pixels know the circle to a tenth of a pixel"""
_WINDOW = 1.6
"""in contact radii"""
_ROBUST_GREY = 4.0
"""residuals beyond it count by their size, not its square: scratches, shadows, dust"""
_STARTS = (0.35, 0.65, 1.0)
"""of the candidate's contact radius"""
_LEAST_GREY = 3.0
_LEAST_QUALITY = 0.8
_LEAST_SHARE = 0.2
_LEAST_RADIUS_PX = 6.0
_LEAST_VIEW = 0.95
_MOST_CLIPPED = 0.2
"""of the values in the circle: one channel of three may lose half of its slopes, and the circle is still known"""
_RIVAL = 0.3
_DARK_GREY = 8.0


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
    residual_grey: float
    """root mean square of what it leaves, grey levels"""


def find_circle(image: NDArray[np.uint8], reference: NDArray[np.number], *, ball: Ball) -> PressCircle:
    """Find the contact circle of the ball in one image, without any calibration of the light.

    image: (H, W, 3) uint8 RGB of the press; reference: (H, W, 3) of the untouched gel, grey levels. The pattern of a
    ball of known radius (`pattern`) is fitted to the difference image together with the unknown response of the light.

    Raises InputError with the reason when there is no press, it is too shallow, off the image, clipped or dark, is
    no ball of this size, or there are several.
    """
    difference = _difference(image, reference)
    if ball.radius_px < 2 * _LEAST_RADIUS_PX or ball.radius_px > max(image.shape[:2]):
        raise InputError(
            f"the ball is {ball.radius_px:.1f} px in radius in an image of {image.shape[1]} x {image.shape[0]} px: "
            "check the ball radius and the pixel size"
        )
    candidate = best_candidate(difference, ball.radius_px)
    shape, circle = _fitted(difference, candidate, ball.radius_px)
    _check_press(circle, ball)
    _check_view(circle, image.shape[:2])
    _check_clipped(circle, image, reference)
    _check_rivals(difference, candidate, shape, ball.radius_px)
    return circle


def _difference(image: NDArray[np.uint8], reference: NDArray[np.number]) -> Array:
    """The (H, W, 3) difference image, slightly blurred, without the drift of the light."""
    if image.shape != reference.shape or image.ndim != 3 or image.shape[2] != 3:
        raise InputError(
            f"the image is {image.shape}, the reference {reference.shape}: give (H, W, 3) images of one camera setting"
        )
    if image.mean() < _DARK_GREY:
        raise InputError(f"the image is dark (mean {image.mean():.1f} grey levels): light the gel, open the camera")
    difference = image.astype(np.float32) - reference.astype(np.float32)
    difference -= light_drift(difference)
    blurred: Array = ndimage.gaussian_filter(difference.astype(np.float64), (_BLUR_PX, _BLUR_PX, 0))
    return blurred


def _fitted(difference: Array, candidate: Candidate, ball_radius: float) -> tuple[PressShape, PressCircle]:
    """Refine a candidate by robust least squares; the linear response is eliminated (variable projection)."""
    x, y, colour = _window(difference, candidate, ball_radius)

    def left(vector: Array) -> Array:
        shape = PressShape.of(vector)
        columns = np.concatenate(
            [background(x, y, shape, ball_radius), response(x, y, shape, ball_radius)],
            axis=1,
        )
        orthogonal, _ = np.linalg.qr(columns)
        rest: Array = colour - orthogonal @ (orthogonal.T @ colour)
        return rest

    starts = [_start(candidate, share, ball_radius) for share in _STARTS]
    solutions = [
        optimize.least_squares(
            lambda vector: left(vector).ravel(),
            start.vector(),
            x_scale=[1, 1, 1, 0.1, 1, 5],
            bounds=_bounds(start, ball_radius),
            loss="soft_l1",
            f_scale=_ROBUST_GREY,
            diff_step=1e-3,
            ftol=1e-6,
            max_nfev=30,
        )
        for start in starts
    ]
    solution = min(solutions, key=lambda found: float(found.cost))
    shape = PressShape.of(solution.x)
    return shape, _judged(shape, x, y, colour, left(solution.x), ball_radius)


def _start(candidate: Candidate, share: float, ball_radius: float) -> PressShape:
    """A first guess; a wide flat skirt looks like contact, so it is tried from smaller circles too."""
    return PressShape(
        center_x=candidate.center_x,
        center_y=candidate.center_y,
        contact_radius=min(share * candidate.contact_radius, 0.85 * ball_radius),
        step_length=0.15 * ball_radius,
        skirt_length=1.2 * ball_radius,
    )


def _window(difference: Array, candidate: Candidate, ball_radius: float) -> tuple[Array, Array, Array]:
    """Pixels around the candidate: x (N,), y (N,), colour (N, 3)."""
    rows, columns = np.indices(difference.shape[:2])
    distance = np.hypot(columns - candidate.center_x, rows - candidate.center_y)
    near = np.flatnonzero(distance < _WINDOW * max(candidate.contact_radius, 0.6 * ball_radius))
    chosen = np.random.default_rng(0).choice(near, min(len(near), _FITTED_PIXELS), replace=False)
    x, y = chosen % difference.shape[1], chosen // difference.shape[1]
    return x.astype(np.float64), y.astype(np.float64), difference[y, x]


def _bounds(start: PressShape, ball_radius: float) -> tuple[list[float], list[float]]:
    r = ball_radius
    low = [start.center_x - r, start.center_y - r, 0.05 * r, 0.0, 0.02 * r, 0.3 * r]
    high = [start.center_x + r, start.center_y + r, STEEPEST * r, 1.0, 0.5 * r, 5 * r]
    return low, high


def _judged(shape: PressShape, x: Array, y: Array, colour: Array, left: Array, ball_radius: float) -> PressCircle:
    """Say how well the pattern explains the colours."""
    orthogonal, _ = np.linalg.qr(background(x, y, shape, ball_radius))
    changed = colour - orthogonal @ (orthogonal.T @ colour)
    pattern = changed - left
    inside = np.hypot(x - shape.center_x, y - shape.center_y) < shape.contact_radius
    return PressCircle(
        center_x_px=shape.center_x,
        center_y_px=shape.center_y,
        contact_radius_px=shape.contact_radius,
        quality=float(1 - (left**2).sum() / max((changed**2).sum(), 1e-12)),
        contrast_grey=float(np.sqrt((pattern[inside] ** 2).mean())) if inside.any() else 0.0,
        residual_grey=float(np.sqrt((left**2).mean())),
    )


def _check_press(circle: PressCircle, ball: Ball) -> None:
    radius = circle.contact_radius_px
    if circle.contrast_grey < _LEAST_GREY:
        raise InputError(
            f"no press: the strongest pattern of a ball changes the colours by {circle.contrast_grey:.1f} grey levels, "
            f"at least {_LEAST_GREY:g} are needed: press the ball into the gel"
        )
    if circle.quality < _LEAST_QUALITY:
        raise InputError(
            f"no single ball of {ball.radius_mm:g} mm: its pattern explains {100 * circle.quality:.0f} % of what "
            f"changed, at least {100 * _LEAST_QUALITY:.0f} % are needed: press one clean ball, check its radius"
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


def _check_view(circle: PressCircle, image_shape: tuple[int, ...]) -> None:
    """Refuse a circle that is cut by the border of the image."""
    height, width = image_shape[:2]
    angle = np.linspace(0, 2 * np.pi, 360, endpoint=False)
    x = circle.center_x_px + circle.contact_radius_px * np.cos(angle)
    y = circle.center_y_px + circle.contact_radius_px * np.sin(angle)
    seen = float(((x >= 0) & (x <= width - 1) & (y >= 0) & (y <= height - 1)).mean())
    if seen < _LEAST_VIEW:
        raise InputError(
            f"the press is off the image: {100 * seen:.0f} % of the circle around ({circle.center_x_px:.0f}, "
            f"{circle.center_y_px:.0f}) px is seen: press nearer to the middle"
        )


def _check_clipped(circle: PressCircle, image: NDArray[np.uint8], reference: NDArray[np.number]) -> None:
    rows, columns = np.indices(image.shape[:2])
    distance = np.hypot(columns - circle.center_x_px, rows - circle.center_y_px)
    inside = image[distance < circle.contact_radius_px]
    at_rest = reference[distance < circle.contact_radius_px]
    clipped = ((inside == 255) | ((inside == 0) & (at_rest > 0))).mean()
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
