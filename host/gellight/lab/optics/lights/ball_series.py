"""Pictures of balls under one light after the other: what lights are found from, and what their networks learn."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import CameraError, InputError
from gellight.frames.camera import Camera, controls_of
from gellight.frames.image_files import read_grey
from gellight.lab.simulator.virtual_hand import hand_of
from gellight.lab.training.labelling.circle import find_circle
from gellight.lab.training.presses import Ball, Press, distance_px, sphere_gradient
from gellight.lab.training.validation import radius_by_slopes_px
from gellight.photometric.directions import levels_of
from gellight.reconstruction.image_noise import noise_of_one
from gellight.reconstruction.integration import angle_deg, normals
from gellight.sensor.lighting.hold import expose, ring_in_hand

Array = NDArray[np.float64]
Floats = NDArray[np.float32]
INNER = 0.8
"""of the contact radius: what is surely in contact"""
HELD_OUT = 4
"""every fourth ball, or series where there are several, judges and is not trained on"""
LEAST_BALLS = 4
"""to train on"""


@dataclass(frozen=True, kw_only=True, eq=False)
class BallSeries:
    """The same balls under each light."""

    levels: Floats
    """(K, H, W) grey levels, one picture a light"""
    presses: tuple[Press, ...]
    """circles that hold in all of them"""

    @property
    def shape(self) -> tuple[int, int]:
        """(H, W)"""
        return self.levels.shape[1], self.levels.shape[2]

    def inside(self, ball: Ball, share: float) -> tuple[NDArray[np.intp], Array]:
        """Return the pixels inside a share of the circles, counted row by row, and their normals (3, N)."""
        pixels, found = [np.zeros(0, np.intp)], [np.zeros((0, 3), np.float32)]
        for press in self.presses:
            within = np.flatnonzero(distance_px(press, self.shape) < share * press.contact_radius_px)
            pixels.append(within)
            found.append(normals(sphere_gradient(press, ball, self.shape, within)[np.newaxis])[0])
        return np.concatenate(pixels), np.concatenate(found).T.astype(np.float64)


@dataclass(frozen=True, kw_only=True, eq=False)
class LitBalls:
    """All that lights are found from, and where it comes from."""

    series: tuple[BallSeries, ...]
    untouched: Floats
    """(K, H, W) of the untouched gel, one picture a light, grey levels"""
    ball: Ball
    noise_grey: float
    """of one pixel"""
    groups: NDArray[np.uint8] | None = None
    """(G, n, 3) of the ring that showed the lights; None for recorded pictures"""
    sensor: str = "unnamed"
    camera: Mapping[str, float] = field(default_factory=dict)
    """its controls by name"""


def read_series(
    balls: Sequence[Path], presses: Sequence[Press], lights: int, white: float | None
) -> tuple[BallSeries, ...]:
    """Read pictures of balls, `lights` of each series in turn; a press belongs to the series of its picture.

    Where there is one series, all presses are its own. white: see `read_grey`. Raises InputError for pictures that are
    no whole series, and presses of other pictures.
    """
    if not lights or len(balls) % lights:
        raise InputError(
            f"{len(balls)} pictures of balls and {lights} of the untouched gel: give one of each for every light, or "
            "several whole series of balls"
        )
    parts = [balls[start : start + lights] for start in range(0, len(balls), lights)]
    own: list[list[Press]] = [[] for _ in parts]
    for press in presses:
        places = [n for n, part in enumerate(parts) if len(parts) == 1 or press.image.name in {p.name for p in part}]
        if not places:
            raise InputError(f"{press.image.name} in the csv of circles is none of the pictures of balls: correct it")
        own[places[0]].append(press)
    return tuple(
        BallSeries(levels=np.stack([read_grey(path, white) for path in part]), presses=tuple(theirs))
        for part, theirs in zip(parts, own, strict=True)
        if theirs
    )


def divided(series: Sequence[BallSeries]) -> tuple[list[BallSeries], list[BallSeries]]:
    """Divide into what is trained on and what judges: by series, or by ball where there is one series.

    Raises InputError for too few balls.
    """
    if len(series) > 1:
        parts = [[one for n, one in enumerate(series) if (n % HELD_OUT == 0) is judging] for judging in (False, True)]
    else:
        balls = series[0].presses if series else ()
        chosen = [tuple(b for n, b in enumerate(balls) if (n % HELD_OUT == 0) is judging) for judging in (False, True)]
        parts = [[replace(series[0], presses=some)] if some else [] for some in chosen]
    training, judging = parts
    if count(training) < LEAST_BALLS or not count(judging):
        raise InputError(f"{count(series)} balls are too few: give at least 6, so that some can be held out")
    return training, judging


def count(series: Sequence[BallSeries]) -> int:
    """Return how many balls there are."""
    return sum(len(one.presses) for one in series)


@dataclass(frozen=True, kw_only=True)
class HeldOutBalls:
    """How balls are felt that were not trained on."""

    balls: int
    normal_deg: float
    """mean angle between the normals within 0.8 of the contact radius"""
    wide_normal_deg: float
    """the same within 0.95 of it"""
    felt_radius_mm: float
    """median over the balls"""

    def as_json(self) -> dict[str, object]:
        """Return the figures, rounded for people."""
        return {name: round(value, 4) for name, value in asdict(self).items()}


def held_out(feel: Callable[[Floats], Floats], series: Sequence[BallSeries], ball: Ball) -> HeldOutBalls:
    """Judge what turns (K, H, W) grey levels into (H, W, 2) slopes, on balls that it was not made from."""
    angles: dict[float, list[Floats]] = {INNER: [], 0.95: []}
    radii_px = []
    for one in series:
        gradient_map = feel(one.levels)
        felt = normals(gradient_map).reshape(-1, 3)
        for share, found in angles.items():
            pixels, normal = one.inside(ball, share)
            found.append(angle_deg(felt[pixels], normal.T.astype(np.float32)))
        radii_px += [radius_by_slopes_px(normals(gradient_map), press, 0.0, INNER) for press in one.presses]
    near, wide = (float(np.concatenate(found).mean()) for found in angles.values())
    felt_mm = float(np.median(radii_px)) * ball.pixel_size_mm
    return HeldOutBalls(balls=count(series), normal_deg=near, wide_normal_deg=wide, felt_radius_mm=felt_mm)


Say = Callable[[str], object]
UNTOUCHED_FRAMES, PRESS_FRAMES = 8, 2
"""averaged in each exposure"""
MOST_REFUSED = 60
"""presses of a virtual hand that are refused before it gives up: of `sim://`, whose single lights are dim, 33 light
ones of 49 show too little"""


def take_series(
    camera: Camera, groups: NDArray[np.uint8], ball: Ball, presses: int, *, sensor: str, ask: Say, tell: Say,
) -> LitBalls:  # fmt: skip
    """Take the untouched gel and `presses` presses under `groups` (G, n, 3), each in a series of its own.

    sensor: what it is known by. ask: says what to do, and returns when it is done; nobody is asked where a virtual
    hand presses. tell: says why a press was refused; it is pressed again.
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
            found.append(_series(_exposed(camera, groups, PRESS_FRAMES), untouched, ball, len(found)))
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
    with ring_in_hand(camera):
        taken = [expose(camera, group, index, frames=frames) for index, group in enumerate(groups)]
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
