"""What a pressed ball does to the colours of the gel: a pattern of few parameters, linear in the response of the light.

Inside the contact the gel has the shape of the ball, so at a distance r from the centre its normal leans by an angle
phi with sin(phi) = r / R (section 3.2.3 of the paper); R is known. Outside, the gel leaves the ball: the slope falls in
a sharp step at the rim and a long skirt, here two exponentials. Which colour a normal has is not known before the
first calibration; it is taken to be a low polynomial of the normal (Lambert's law is its linear part) and of the
depth (a gel that is lit white darkens with it), with unknown coefficients for each channel. The fit is
robust least squares, with these coefficients eliminated.
"""

from collections.abc import Callable, Sequence
from dataclasses import astuple, dataclass, fields
from typing import Self

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage, optimize

from gellight.base.errors import InputError
from gellight.reconstruction.light_drift import difference_of

Array = NDArray[np.float64]
Residual = Callable[[Array], Array]
"""from the numbers of a shape to the (N, 3) grey levels that it leaves unexplained"""
STEEPEST = 0.985
"""largest contact radius over ball radius: 80 degrees, steeper than any gel stays in touch"""
_BLUR_PX = 0.8  # chosen: takes the noise between neighbours
_FITTED_PIXELS = 1200
"""chosen at random from the window: a thousand pixels give the circle to a tenth of a pixel"""
_WINDOW = 1.6
"""in contact radii"""
_STARTS = (0.35, 0.65, 1.0)
"""of the radius first guessed: a wide flat skirt looks like contact, so smaller circles are tried too"""
_FIELDS = 6
"""to each side, whose pixels count as one when errors are told: more or less what one leaves alike"""
SIMPLE = (0, 1, 2, 8)
"""columns of the response, enough to find the place: what is linear in the normal, and the depth"""
_ROBUST_GREY = 4.0
"""residuals beyond it count by their size, not its square: scratches, shadows, dust"""
_ALIKE = 3.0  # chosen: times the errors, as parts that touch are alike; see `standard_errors`
_STEP = 1e-6  # measured: circles of 58 pictures are within 0.0005 px of those by exact derivatives
DARK_GREY = 8.0  # chosen: a picture that is darker has LEDs off, or a cap on its lens
LEAST_GREY = 3.0  # measured: with it, 33 of 33 real presses were found
LEAST_QUALITY = 0.8
"""share of what changed that the pattern of an object must explain to be believed"""


@dataclass(frozen=True, kw_only=True)
class PressShape:
    """Where and how a ball is pressed; lengths in px."""

    center_x: float
    center_y: float
    contact_radius: float
    step_share: float = 0.4
    """of the slope at the rim, what falls off within `step_length`"""
    step_length: float = 7.0
    skirt_length: float = 50.0

    def vector(self) -> Array:
        """The numbers in their order."""
        return np.array(astuple(self))

    @classmethod
    def of(cls, vector: Array) -> Self:
        """Take the numbers."""
        return cls(**dict(zip((field.name for field in fields(cls)), vector.tolist(), strict=True)))


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


def free_response(pixels: PixelSample, ball_radius: float, terms: Sequence[int] = range(9)) -> Residual:
    """Return what a press leaves of the colours around it when the response of the light is free in these columns."""

    def left(vector: Array) -> Array:
        at = pixels.x, pixels.y, PressShape.of(vector), ball_radius
        return without(np.concatenate([background(*at), response(*at)[:, terms]], axis=1), pixels.colour)

    return left


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


def fitted(residual: Residual, begin: PressShape, ball_radius: float) -> PressShape:
    """Return the shape that leaves least, by robust least squares from one beginning; ball_radius in px."""
    r = ball_radius
    low = [begin.center_x - r, begin.center_y - r, 0.05 * r, 0.0, 0.02 * r, 0.3 * r]
    high = [begin.center_x + r, begin.center_y + r, STEEPEST * r, 1.0, 0.5 * r, 5 * r]
    found = optimize.least_squares(
        lambda vector: residual(vector).ravel(),
        np.clip(begin.vector(), low, high),
        x_scale=(1, 1, 1, 0.1, 1, 5),
        bounds=(low, high),
        loss="soft_l1",
        f_scale=_ROBUST_GREY,
        ftol=1e-6,
        max_nfev=30,
    )
    return PressShape.of(found.x)


def without(columns: Array, values: Array) -> Array:
    """Return what is left of (N, K) values when their best combination of (N, M) columns, M < N, is taken off."""
    base, _ = np.linalg.qr(columns)
    return np.asarray(values - base @ (base.T @ values))


def jacobian(residual: Residual, at: Array) -> Array:
    """(P, N, 3) the derivative of what is left to each of P numbers, by finite differences."""
    here, steps = residual(at), _STEP * np.maximum(np.abs(at), 1)
    return np.stack([(residual(at + step) - here) / step.sum() for step in np.diag(steps)])


def standard_errors(residual: Residual, at: Array, part: NDArray[np.intp]) -> Array:
    """Return the (P,) errors of numbers that were fitted; part: (N,) number of the part of each pixel.

    What a pattern leaves unexplained is alike in neighbours, so the parts, not the pixels, count as independent (Liang
    and Zeger 1986): with the weights w of the robust loss, and sums over the pixels of a part in the middle, the
    covariance is

        (J' w J)^-1  sum_parts (J' w r)(J' w r)'  (J' w J)^-1

    and, as parts that touch are alike too, three times its standard deviations are returned.
    """
    left, derivatives = residual(at), jacobian(residual, at)
    weighted = derivatives * robust_weights(left)
    pulls = np.einsum("pnc,nc->np", weighted, left)
    square = np.einsum("pnc,qnc->pq", weighted, derivatives)
    size = np.sqrt(np.maximum(np.diag(square), 1e-12))
    inverse = np.linalg.pinv(square / np.outer(size, size), rcond=1e-6) / np.outer(size, size)
    sums = np.zeros((int(part.max()) + 1, len(square)))
    np.add.at(sums, part, pulls)
    return np.asarray(_ALIKE * np.sqrt(((sums @ inverse) ** 2).sum(axis=0)))


def robust_weights(left: Array) -> Array:
    """Return how much each of (N, 3) residuals counts in what `fitted` makes least."""
    return np.asarray(1 / np.sqrt(1 + (left / _ROBUST_GREY) ** 2))


def cost(left: Array) -> float:
    """Return what `fitted` makes least of what is left, grey levels: squares of small values, sizes of large ones."""
    return float((np.sqrt(1 + (left / _ROBUST_GREY) ** 2) - 1).sum())
