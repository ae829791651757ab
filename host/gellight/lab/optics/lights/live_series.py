"""Pictures of balls under the light groups of a ring, taken from a sensor that is plugged in."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import CameraError, InputError
from gellight.frames.camera import Camera, controls_of
from gellight.lab.optics.lights.ball_series import BallSeries, LitBalls
from gellight.lab.simulator.virtual_hand import hand_of
from gellight.lab.training.labelling import find_circle
from gellight.lab.training.presses import Ball, Press
from gellight.photometric.directions import levels_of
from gellight.reconstruction.image_noise import noise_of_one
from gellight.sensor.lighting.hold import Hold

Floats = NDArray[np.float32]
Say = Callable[[str], object]
UNTOUCHED_FRAMES = 8
MOST_REFUSED = 20
"""presses of a virtual hand that are refused before it gives up"""


def take_series(
    camera: Camera, groups: NDArray[np.uint8], ball: Ball, presses: int, *, sensor: str, ask: Say, tell: Say,
    frames: int = 2,
) -> LitBalls:  # fmt: skip
    """Take the untouched gel and `presses` presses under `groups` (G, n, 3), each in a series of its own.

    sensor: what it is known by. ask: says what to do, and returns when it is done; nobody is asked where a virtual
    hand presses. tell: says why a press was refused; it is pressed again. frames: averaged in each exposure of a press.
    Raises CameraError without a ring, and what camera and board raise.
    """
    if camera.ring is None:
        raise CameraError(f"{camera.url} has no light ring whose groups could be shown: give recorded pictures")
    hand = hand_of(camera) if camera.stage else None
    if camera.stage is not None:
        camera.stage.take_over()
    else:
        ask("Take everything off the gel")
    untouched = _exposed(camera, groups, UNTOUCHED_FRAMES)
    found: list[BallSeries] = []
    refused = 0
    while len(found) < presses:
        try:
            if hand:
                hand.ball(len(found) + refused, ball.pixel_size_mm, camera.image_shape)
            else:
                ask(f"Press the ball at a new place and hold it still ({len(found) + 1} of {presses})")
            found.append(_series(_exposed(camera, groups, frames), untouched, ball, len(found)))
        except InputError as error:
            refused += 1
            if hand and refused > MOST_REFUSED:
                raise
            tell(f"not used: {error}")
        finally:
            if hand:
                hand.lift()
    noise = noise_of_one(untouched[0][..., None]) * UNTOUCHED_FRAMES**0.5
    return LitBalls(
        series=tuple(found), untouched=untouched, ball=ball, noise_grey=noise, groups=groups, sensor=sensor,
        camera=controls_of(camera),
    )  # fmt: skip


def _exposed(camera: Camera, groups: NDArray[np.uint8], frames: int) -> Floats:
    with Hold(camera) as hold:
        taken = [hold.expose(group, index, frames) for index, group in enumerate(groups)]
    return levels_of([[frame.image for frame in shown] for shown in taken], groups)


def _series(levels: Floats, untouched: Floats, ball: Ball, number: int) -> BallSeries:
    """Find the ball where three lights far apart make a colour picture; InputError says why it is not used."""
    far_apart = [light * len(levels) // 3 for light in range(3)]
    shown, flat = (np.moveaxis(pictures[far_apart], 0, 2) for pictures in (levels, untouched))
    circle = find_circle(np.clip(np.rint(shown), 0, 255).astype(np.uint8), flat, ball=ball)
    x, y, radius = circle.center_x_px, circle.center_y_px, circle.contact_radius_px
    name = Path(f"press {number + 1}")
    press = Press(image=name, center_x_px=x, center_y_px=y, contact_radius_px=radius, found=True)
    return BallSeries(levels=levels, presses=(press,))
