"""What a pressed ball does to the colours of the gel: a pattern of few parameters, linear in the response of the light.

Inside the contact the gel has the shape of the ball, so at a distance r from the centre its normal leans by an angle
phi with sin(phi) = r / R (section 3.2.3 of the paper); R is known. Outside, the gel leaves the ball: the slope falls in
a sharp step at the rim and a long skirt, here two exponentials. Which colour a normal has is not known before the
first calibration; it is taken to be a low polynomial of the normal (Lambert's law is its linear part) and of the
depth (a gel that is lit white darkens with it), with unknown coefficients for each channel. The fit is
robust least squares, with these coefficients eliminated.
"""

from collections.abc import Sequence
from dataclasses import astuple, dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from gellight.base.errors import InputError
from gellight.lab.training.labelling.fitting import Bounds, FittedShape, FreeResponse, Residual, least
from gellight.reconstruction.light_drift import difference_of

Array = NDArray[np.float64]
STEEPEST = 0.985
"""largest contact radius over ball radius: 80 degrees, steeper than any gel stays in touch"""
_BLUR_PX = 0.8
_FITTED_PIXELS = 1200
"""chosen at random from the window: a thousand pixels give the circle to a tenth of a pixel"""
_WINDOW = 1.6
"""in contact radii"""
_STARTS = (0.35, 0.65, 1.0)
"""of the radius first guessed: a wide flat skirt looks like contact, so smaller circles are tried too"""
_FIELDS = 6
"""to each side, whose pixels count as one when errors are told: more or less what one leaves alike"""
SIMPLE = (0, 1, 2, 8)
"""columns of the response: what is linear in the normal, and the depth"""
DARK_GREY = 8.0
LEAST_GREY = 3.0
LEAST_QUALITY = 0.8
"""share of what changed that the pattern of an object must explain to be believed"""
_MOST_CLIPPED = 0.2
"""of the values in the contact: one channel of three may lose half of its slopes, and the contact is still known"""


@dataclass(frozen=True, kw_only=True)
class PressShape(FittedShape):
    """Where and how a ball is pressed; lengths in px."""

    center_x: float
    center_y: float
    contact_radius: float
    step_share: float = 0.4
    """of the slope at the rim, what falls off within `step_length`"""
    step_length: float = 7.0
    skirt_length: float = 50.0


def profile(r: Array, shape: PressShape, ball_radius: float) -> tuple[Array, Array]:
    """Return slope (dimensionless, falling from the centre counts positive) and depth (px) at distances r from it."""
    a, share = shape.contact_radius, shape.step_share
    height = np.sqrt(ball_radius**2 - np.minimum(r, a) ** 2)
    beyond = np.maximum(r - a, 0)
    step, skirt = share * np.exp(-beyond / shape.step_length), (1 - share) * np.exp(-beyond / shape.skirt_length)
    rim_height = np.sqrt(ball_radius**2 - a**2)
    rim_slope = a / rim_height
    slope = np.where(r <= a, r / height, rim_slope * (step + skirt))
    depth = height - rim_height + rim_slope * (shape.step_length * step + shape.skirt_length * skirt)
    return slope, depth


def _profile_derivatives(dx: Array, dy: Array, shape: PressShape, ball_radius: float) -> tuple[Array, Array]:
    """Return the (6, N) derivatives of slope and depth to each number of the shape, at pixels from its centre."""
    r = np.maximum(np.hypot(dx, dy), 1e-9)
    a, share, step_length, skirt_length = astuple(shape)[2:]
    inside, beyond = r <= a, np.maximum(r - a, 0)
    fast, slow = np.exp(-beyond / step_length), np.exp(-beyond / skirt_length)
    step, skirt = share * fast, (1 - share) * slow
    rim_height = np.sqrt(ball_radius**2 - a**2)
    rim_slope, steeper = a / rim_height, ball_radius**2 / rim_height**3
    slope, _ = profile(r, shape, ball_radius)
    falling = rim_slope * (step / step_length + skirt / skirt_length)
    outwards = np.where(inside, ball_radius**2 / (ball_radius**2 - np.minimum(r, a) ** 2) ** 1.5, -falling)
    slopes = np.where(inside, 0.0, [
        steeper * (step + skirt) + falling,
        rim_slope * (fast - slow),
        rim_slope * step * beyond / step_length**2,
        rim_slope * skirt * beyond / skirt_length**2,
    ])  # fmt: skip
    depths = [
        steeper * (step_length * step + skirt_length * skirt) + rim_slope * np.where(inside, 1.0, step + skirt),
        rim_slope * (step_length * fast - skirt_length * slow),
        rim_slope * step * (1 + beyond / step_length),
        rim_slope * skirt * (1 + beyond / skirt_length),
    ]
    away = -np.stack([dx, dy]) / r
    return np.concatenate([outwards * away, slopes]), np.concatenate([-slope * away, depths])


def background(x: Array, y: Array, shape: PressShape, ball_radius: float) -> Array:
    """(N, 3) light that drifted since the reference: a constant and a slow change over the view."""
    return np.stack([np.ones_like(x), (x - shape.center_x) / ball_radius, (y - shape.center_y) / ball_radius], axis=1)


def response(x: Array, y: Array, shape: PressShape, ball_radius: float) -> Array:
    """(N, 9) pattern of the press at the pixels (x, y): products of the normal's components, and the depth."""
    dx, dy = x - shape.center_x, y - shape.center_y
    r = np.hypot(dx, dy)
    slope, depth = profile(r, shape, ball_radius)
    cosine = 1 / np.sqrt(1 + slope**2)
    lean = slope * cosine / np.maximum(r, 1e-9)
    nx, ny, bent = lean * dx, lean * dy, 1 - cosine
    columns = [nx, ny, bent, bent * nx, bent * ny, bent**2, nx**2 - ny**2, nx * ny, depth / ball_radius]
    return np.stack(columns, axis=1)


def response_derivatives(x: Array, y: Array, shape: PressShape, ball_radius: float) -> Array:
    """(6, 9, N) derivative of `response` to each number of the shape."""
    dx, dy = x - shape.center_x, y - shape.center_y
    r = np.maximum(np.hypot(dx, dy), 1e-9)
    slope, _ = profile(r, shape, ball_radius)
    slopes, depths = _profile_derivatives(dx, dy, shape, ball_radius)
    cosine = 1 / np.sqrt(1 + slope**2)
    lean, bent = slope * cosine / r, 1 - cosine
    nx, ny = lean * dx, lean * dy
    # Of a centre: r changes by -dx / r, and the direction of the lean turns.
    leans, bents = cosine**3 * slopes / r, slope * cosine**3 * slopes
    leans[:2] += lean * np.stack([dx, dy]) / r**2
    nxs, nys = leans * dx, leans * dy
    nxs[0] -= lean
    nys[1] -= lean
    products = [bents * nx + bent * nxs, bents * ny + bent * nys, 2 * bent * bents]
    squares = [2 * (nx * nxs - ny * nys), nxs * ny + nx * nys]
    return np.stack([nxs, nys, bents, *products, *squares, depths / ball_radius], axis=1)


@dataclass(frozen=True, kw_only=True, eq=False)
class PixelSample:
    """Pixels around a press."""

    x: Array
    """(N,) px"""
    y: Array
    """(N,) px"""
    colour: Array
    """(N, 3) of the difference image, grey levels"""

    def few(self) -> "PixelSample":
        """Return a quarter of the pixels, in random order: it tells which beginning leads to the object."""
        few = len(self.x) // 4
        return PixelSample(x=self.x[:few], y=self.y[:few], colour=self.colour[:few])

    def parts(self) -> NDArray[np.intp]:
        """(N,) number of the field that each pixel lies in, of 6 x 6 over all of them."""
        places = np.stack([self.x, self.y])
        low, high = places.min(axis=1, keepdims=True), places.max(axis=1, keepdims=True) + 1
        column, row = (_FIELDS * (places - low) / (high - low)).astype(np.intp)
        return np.asarray(_FIELDS * row + column)


def difference_image(image: NDArray[np.uint8], reference: NDArray[np.number]) -> Array:
    """Return the (H, W, 3) difference image, slightly blurred, without the drift of the light; raises InputError."""
    if image.shape != reference.shape or image.ndim != 3 or image.shape[2] != 3:
        sizes = [f"{shape[1]} x {shape[0]} px" for shape in (image.shape, reference.shape)]
        raise InputError(
            f"the image is {sizes[0]}, the reference {sizes[1]}: give (H, W, 3) images of one camera setting"
        )
    if image.mean() < DARK_GREY:
        raise InputError(f"the image is dark (mean {image.mean():.1f} grey levels): light the gel, open the camera")
    if (image == reference).all():
        raise InputError("no press: nothing has changed from the reference: give another image of the untouched gel")
    untouched = reference.astype(np.float32)
    difference = difference_of(image, untouched, follow_light=True)
    blurred: Array = ndimage.gaussian_filter(difference.astype(np.float64), (_BLUR_PX, _BLUR_PX, 0))
    return blurred


def check_clipped(
    image: NDArray[np.uint8], reference: NDArray[np.number], inside: NDArray[np.bool_], where: str
) -> None:
    """Refuse (H, W, 3) images with too many values at their ends inside a (H, W) mask; InputError."""
    clipped = ((image[inside] == 255) | ((image[inside] == 0) & (reference[inside] > 0))).mean()
    if clipped > _MOST_CLIPPED:
        raise InputError(
            f"the image is clipped: {100 * clipped:.0f} % of the values {where} are at 0 or 255 grey levels, "
            f"at most {100 * _MOST_CLIPPED:.0f} % may be: change the exposure or the brightness of the light"
        )


def sampled_around(
    difference: Array, center: tuple[float, float], contact_radius: float, ball_radius: float
) -> PixelSample:
    """Choose pixels of the (H, W, 3) difference image around a circle, px; the same ones each time."""
    rows, columns = np.indices(difference.shape[:2])
    distance = np.hypot(columns - center[0], rows - center[1])
    near = np.flatnonzero(distance < _WINDOW * max(contact_radius, 0.6 * ball_radius))
    chosen = np.random.default_rng(0).choice(near, min(len(near), _FITTED_PIXELS), replace=False)
    x, y = chosen % difference.shape[1], chosen // difference.shape[1]
    return PixelSample(x=x.astype(np.float64), y=y.astype(np.float64), colour=difference[y, x])


def free_response(pixels: PixelSample, ball_radius: float, terms: Sequence[int] = range(9)) -> FreeResponse[PressShape]:
    """Return what a press leaves of the colours around it when the response of the light is free in these columns."""

    def columns(shape: PressShape) -> Array:
        at = pixels.x, pixels.y, shape, ball_radius
        return np.concatenate([background(*at), response(*at)[:, terms]], axis=1)

    return FreeResponse(
        pixels.colour, columns, lambda shape: response_derivatives(pixels.x, pixels.y, shape, ball_radius)[:, terms]
    )


def starts(center: tuple[float, float], contact_radius: float, ball_radius: float) -> list[PressShape]:
    """First guesses from a circle, px."""
    return [
        PressShape(
            center_x=center[0],
            center_y=center[1],
            contact_radius=min(share * contact_radius, 0.85 * ball_radius),
            step_length=0.15 * ball_radius,
            skirt_length=1.2 * ball_radius,
        )
        for share in _STARTS
    ]


def fitted(residual: Residual[PressShape], begin: PressShape, ball_radius: float) -> PressShape:
    """Return the shape that leaves least, from one beginning; ball_radius in px."""
    r = ball_radius
    low = [begin.center_x - r, begin.center_y - r, 0.05 * r, 0.0, 0.02 * r, 0.3 * r]
    high = [begin.center_x + r, begin.center_y + r, STEEPEST * r, 1.0, 0.5 * r, 5 * r]
    inside = PressShape.of(np.clip(begin.vector(), low, high))
    return least(residual, inside, Bounds(low=low, high=high, scale=(1, 1, 1, 0.1, 1, 5), evaluations=30))
