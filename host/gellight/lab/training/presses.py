"""Labelled ball presses, and the shape that the gel has under the ball.

A ball of known radius gives the slope of the gel at every pixel of its contact circle, because there the gel has the
shape of the ball (section 3.2.3 of the paper).
"""

import math
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Self

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import InputError
from gellight.bundle.bundle import Bundle
from gellight.frames.dots import Dots
from gellight.frames.image_files import read_image
from gellight.frames.view import View

Floats = NDArray[np.float32]
Array = NDArray[np.float64]
SUNKEN = 0.45
"""How deep the rim of a contact lies under the gel at rest, as a share of the height of what is inside it. A picture
does not tell. Of balls of 2 to 6 mm, 0.3 to 1.5 mm deep, it is 0.26 to 0.71 in the simulated gel, of 4 mm 0.28 to 0.62
by finite elements. That is 0.1 mm more or less, by which slopes look 0.5 % steeper or flatter."""


@dataclass(frozen=True, kw_only=True)
class Ball:
    """The ball that was pressed, as the camera sees it."""

    radius_mm: float
    pixel_size_mm: float
    camera_height_mm: float = math.inf
    """above the gel at rest, as high as it seems from within the gel; infinite: it looks along parallel rays"""

    def __post_init__(self) -> None:
        """Refuse what is no length."""
        for name in ("radius_mm", "pixel_size_mm"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0):
                raise InputError(f"{name} = {value}: give a length greater than 0")
        if not self.camera_height_mm > self.radius_mm:
            raise InputError(
                f"camera_height_mm = {self.camera_height_mm}: give a length greater than the ball's radius"
            )

    @property
    def told_height_mm(self) -> float:
        """The height of the camera as a manifest tells it: 0 where nobody told."""
        return self.camera_height_mm if math.isfinite(self.camera_height_mm) else 0.0

    def seen_from(self) -> str:
        """Return for people from where it is seen."""
        if height_mm := self.told_height_mm:
            return f"seen from {height_mm:.1f} mm above the gel"
        return (
            "taken to be seen from far away: tell geometry.camera_height_mm, or slopes are off the more the deeper a "
            "press is and the farther it lies from the axis"
        )

    @classmethod
    def seen_by(cls, bundle: Bundle, radius_mm: float) -> Self:
        """Return the ball as the camera of a bundle sees it; of pixels that are not square the mean."""
        size_mm, height_mm = math.sqrt(math.prod(bundle.pixel_size_mm)), bundle.manifest.camera_height_mm
        return cls(radius_mm=radius_mm, pixel_size_mm=size_mm, camera_height_mm=height_mm or math.inf)

    @property
    def radius_px(self) -> float:
        """Radius in px."""
        return self.radius_mm / self.pixel_size_mm


@dataclass(frozen=True, kw_only=True)
class Press:
    """One press of the ball: its image and its contact circle."""

    image: Path
    center_x_px: float
    center_y_px: float
    contact_radius_px: float
    dots: Dots | None = None
    """the marker dots of the gel, where it has some"""
    found: bool = False
    """whether `detect` found the circle; else a hand may have drawn it"""
    view: View | None = None
    """a smaller one of the image, which the circle lies in"""

    def picture(self) -> NDArray[np.uint8]:
        """Read its image, (H, W, 3) RGB with the dots filled; InputError where it cannot be read."""
        image = self._seen()
        return self.dots.filled(image) if self.dots else image

    def hidden(self) -> NDArray[np.bool_] | None:
        """Mark the (H, W) pixels that dots hide, None where there are none."""
        return self.dots.mask(self._seen()) if self.dots else None

    def within(self, view: View) -> "Press":
        """Return it in a smaller view of its image."""
        x, y = view.places(np.array([[self.center_x_px, self.center_y_px]]))[0].tolist()
        radius = self.contact_radius_px * view.scale
        return replace(self, center_x_px=x, center_y_px=y, contact_radius_px=radius, view=view)

    def _seen(self) -> NDArray[np.uint8]:
        if self.view is None:
            return read_image(self.image)
        changed_ns = self.image.stat().st_mtime_ns if self.image.is_file() else 0
        return _smaller(self.image, changed_ns, self.view).copy()


@lru_cache(maxsize=64)
def _smaller(path: Path, changed_ns: int, view: View) -> NDArray[np.uint8]:
    """Return a smaller view; kept, because to read the large picture takes long, and each is read some ten times."""
    return view.of(read_image(path), str(path))


def distance_px(press: Press, image_shape: tuple[int, int]) -> Floats:
    """Return the (H, W) distance of each pixel from the centre of the press, px."""
    rows, columns = np.indices(image_shape, dtype=np.float32)
    distance: Floats = np.hypot(columns - press.center_x_px, rows - press.center_y_px).astype(np.float32)
    return distance


@dataclass(frozen=True, eq=False)
class OnBall:
    """Points of the ball's surface, from its centre, px."""

    across: Array
    down: Array
    up: Array
    """towards the camera; NaN where the ray of the pixel passes the ball"""
    rim: float
    """`up` of the contact circle"""
    sunken: float
    """how deep the contact circle lies under the gel at rest, by `SUNKEN`"""


def on_ball(press: Press, ball: Ball, image_shape: tuple[int, int], columns: Array, rows: Array) -> OnBall:
    """Return the points of the ball that pixels see.

    A camera at the height H sees the gel that is d deep at x in the pixel p with x = p (1 - d / H), both from the
    middle of the picture. The contact circle lies `SUNKEN` of its cap deep, so it and its centre c are drawn together
    by that. With the height h of the ball's surface above its centre, which is z deep, x - x_0 = A - B h for
    A = p (1 - z / H) - x_0 and B = p / H, and |A - B h|^2 + h^2 = R^2 is solved by

        (1 + B^2) h = A . B + sqrt((A . B)^2 + (1 + B^2) (R^2 - A^2)).
    """
    height, radius = ball.camera_height_mm / ball.pixel_size_mm, ball.radius_px
    sunken = SUNKEN * (radius - _rim_px(press.contact_radius_px, radius))
    rim = _rim_px(press.contact_radius_px * (1 - sunken / height), radius)
    centre = sunken - rim
    (x, cx), (y, cy) = (
        (at - (side - 1) / 2, of - (side - 1) / 2)
        for at, of, side in ((columns, press.center_x_px, image_shape[1]), (rows, press.center_y_px, image_shape[0]))
    )
    ax = columns - press.center_x_px - (x * centre - cx * sunken) / height
    ay = rows - press.center_y_px - (y * centre - cy * sunken) / height
    along, square = (ax * x + ay * y) / height, 1 + (x**2 + y**2) / height**2
    under = along**2 + square * (radius**2 - ax**2 - ay**2)
    up = (along + np.sqrt(np.where(under > 0, under, np.nan))) / square
    return OnBall(ax - x * up / height, ay - y * up / height, up, rim, sunken)


def _rim_px(contact_radius_px: float, radius_px: float) -> float:
    return math.sqrt(max(radius_px**2 - contact_radius_px**2, 0.0))


def sphere_gradient(
    press: Press, ball: Ball, image_shape: tuple[int, int], pixels: NDArray[np.intp] | None = None
) -> Floats:
    """Return the (H, W, 2) gradient of a gel that has the shape of the ball; NaN beyond what is seen of the ball.

    pixels: (n,) of the flattened picture, if only the (n, 2) gradients there are needed.

    The ball is deepest in its centre: depth = sqrt(R^2 - r^2) + constant, so d(depth)/dx = -(x - cx) / sqrt(R^2 - r^2).
    """
    seen = on_ball(press, ball, image_shape, *_places(image_shape, pixels))
    return np.stack([-seen.across / seen.up, -seen.down / seen.up], axis=-1).astype(np.float32)


def cap_depth_mm(
    press: Press, ball: Ball, image_shape: tuple[int, int], pixels: NDArray[np.intp] | None = None
) -> Floats:
    """Return the (H, W) depth of the ball's cap below its contact circle, mm, negative outside, NaN beyond the ball.

    pixels: as in `sphere_gradient`; then (n,).
    """
    seen = on_ball(press, ball, image_shape, *_places(image_shape, pixels))
    return ((seen.up - seen.rim) * ball.pixel_size_mm).astype(np.float32)


def _places(image_shape: tuple[int, int], pixels: NDArray[np.intp] | None) -> tuple[Array, Array]:
    """Return columns and rows of some pixels of the flattened picture, or of all of it."""
    if pixels is None:
        rows, columns = np.indices(image_shape, dtype=np.float64)
        return columns, rows
    return (pixels % image_shape[1]).astype(np.float64), (pixels // image_shape[1]).astype(np.float64)


def contact_circle(press: Press, image_shape: tuple[int, int]) -> NDArray[np.bool_]:
    """Return the (H, W) pixels inside the labelled contact circle."""
    return distance_px(press, image_shape) < press.contact_radius_px
