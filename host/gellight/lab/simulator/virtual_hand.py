"""A virtual hand: presses cylinder and ball into the simulated gel, at places all over the view."""

from math import sqrt

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import InputError
from gellight.frames.camera import Camera, PressStage

# Chosen: five, as many as the routine asks for, with the whole probe in view.
CYLINDER_PLACES_MM = ((0.0, 0.0), (-4.0, 2.5), (4.5, -2.0), (3.0, 3.0), (-3.5, -3.0))
CYLINDER_DEPTH_MM = 0.3  # chosen: some tenths, as docs/calibration.md asks
BALL_DEPTHS_MM = (0.2, 2.0)
"""From a light touch to a deep press: where the gel is deep it is nearer to the LEDs and brighter, so that deep presses
alone would teach that brightness means slope."""
DEPTH_POWER = 1.5
"""more light presses than deep ones: a deep one shows ten times the pixels"""
MARGIN = 1.1
"""in contact radii: a circle that the border of the picture cuts would be refused"""
CHECK_MARGIN = 1.2  # chosen: verification presses keep clear of the border
STRETCH = 0.08
"""this share of the places, on each side, falls beyond the border of the view and is moved onto it, since a network
learns worst where no press reaches"""
BALL_RADIUS_MM = 4.0  # the paper's section 3.2.3: a ball of 8 mm diameter
CHECK_SEED = 1000  # chosen: other places than those that were learnt from


class VirtualHand:
    """Presses what the routine asks for; the same seed presses the same places."""

    def __init__(self, stage: PressStage, *, seed: int = 0) -> None:
        """Use the stage of a simulated sensor."""
        self._stage = stage
        self._seed = seed

    def cylinder(self, number: int) -> None:
        """Press the cylinder probe, each time elsewhere."""
        self._stage.press("CYLINDER", CYLINDER_DEPTH_MM, *CYLINDER_PLACES_MM[number % len(CYLINDER_PLACES_MM)])

    def ball(self, number: int, pixel_size_mm: float, image_shape: tuple[int, int]) -> None:
        """Press the ball at one place of a sequence that fills the view evenly."""
        self._press(self._seed, number, MARGIN, pixel_size_mm, image_shape)

    def check(self, number: int, pixel_size_mm: float, image_shape: tuple[int, int]) -> None:
        """Press the ball at a place and a depth of another sequence."""
        self._press(self._seed + CHECK_SEED, number, CHECK_MARGIN, pixel_size_mm, image_shape)

    def lift(self) -> None:
        """Take the tool off the gel."""
        self._stage.release()

    def _press(self, seed: int, number: int, margin: float, size_mm: float, shape: tuple[int, int]) -> None:
        u, v, w = spread(seed, number)
        u, v = (min(max((1 + 2 * STRETCH) * share - STRETCH, 0.0), 1.0) for share in (u, v))
        low, high = BALL_DEPTHS_MM
        depth = round(min(low + (high - low) * w**DEPTH_POWER, self._stage.max_depth_mm), 1)
        inside_mm = margin * sqrt(BALL_RADIUS_MM * depth)  # Hertz: the radius of the contact is sqrt(R d)
        nearer = 1 - depth / self._stage.camera_height_mm  # what lies deeper is seen further from the middle
        half_x, half_y = (nearer * count * size_mm / 2 - inside_mm for count in shape[::-1])
        self._stage.press("BALL", depth, half_x * (2 * u - 1), half_y * (2 * v - 1))


def spread(seed: int, number: int) -> tuple[float, float, float]:
    """Return the `number`-th point in the unit cube of a sequence that fills it evenly, shifted by the seed.

    Additive recurrences: that of Roberts (2018) in two dimensions, with the real root g of g^3 = g + 1, and the golden
    ratio in the third. Every stretch of them is even.
    """
    g, golden = 1.324717957244746, (1 + 5**0.5) / 2
    steps = np.array([1 / g, 1 / g**2, 1 / golden])
    shift: NDArray[np.float64] = np.random.default_rng(seed).random(3)
    u, v, w = ((shift + steps * number) % 1.0).tolist()
    return u, v, w


def hand_of(camera: Camera, *, seed: int = 0) -> VirtualHand:
    """Return a hand for a simulated sensor; InputError for a camera into which nothing can be pressed."""
    if camera.stage is None:
        raise InputError(
            f"{camera.url} has no virtual hand: press by hand, or take the simulated sensor (--sensor sim://)"
        )
    return VirtualHand(camera.stage, seed=seed)
