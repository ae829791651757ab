"""GelNet trained on balls under one light after the other, a channel for each light, and the bundle that holds it.

The vectors of any lights from balls of known radius: there every normal is known.

With the normals known, I_k / R_k = v_k . n is linear in v_k (see `photometric.directions`): least
squares, repeated without what is far darker than the answer, which lies in shadow. From the flat gel alone a light
cannot be found: how it falls off there hardly tells a low light from a high one.
"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from gellight.base.errors import InputError
from gellight.bundle.bundle import Bundle, write_bundle
from gellight.lab.optics.lights.ball_series import (
    LEAST_BALLS,
    BallSeries,
    HeldOutBalls,
    LitBalls,
    count,
    divided,
    held_out,
)
from gellight.lab.training.child import Progress, silent
from gellight.lab.training.presses import Ball
from gellight.lab.training.table import PressTable, TableOptions, labelled_rows
from gellight.lab.training.training import TrainingOptions, train
from gellight.photometric.directions import FILE_NAME, LightDirections, view_places
from gellight.photometric.solver import LEAST_LIGHTS
from gellight.series.single_light_path import ChannelNetwork, change_percent
from gellight.series.summary import as_rgb

Array = NDArray[np.float64]
Floats = NDArray[np.float32]
NEAR_BALLS = 6
"""with fewer a light has one vector for the whole view"""
_INNER = 0.9
"""of the contact radius: what is fitted to"""
_ROUNDS = 4
_SHADOW = 0.12
"""a pixel that is darker by this share of the untouched gel than its normal says is shadowed"""
_WORST_DEG = 12.0
_LEAST_LEAN = 0.1
"""length of a light's sideways part: with less for all of them, slopes change nothing"""


def smoothed(untouched: Floats, ball: Ball) -> Floats:
    """Return (K, H, W) the light on the untouched gel without noise and dirt; InputError where it is dark."""
    smooth: Floats = ndimage.gaussian_filter(untouched, (0, *[0.4 * ball.radius_px] * 2), mode="nearest")
    if smooth.min() < 1:
        raise InputError("the untouched gel is dark somewhere: every light has to reach all of the view; crop it")
    return smooth


def lights_from_balls(
    series: Sequence[BallSeries], untouched: Floats, ball: Ball, noise_grey: float
) -> LightDirections:
    """Find the lights from pictures of balls, and (K, H, W) of the untouched gel, one a light, grey levels.

    Raises InputError for fewer than three lights or four balls, and where the lights do not explain the balls.
    """
    shape = (untouched.shape[1], untouched.shape[2])
    if len(untouched) < LEAST_LIGHTS or any(one.levels.shape != untouched.shape for one in series):
        raise InputError(
            f"{len(untouched)} pictures of the untouched gel: give one each, at least {LEAST_LIGHTS} lights, and "
            "pictures of balls under the same lights, of the same size"
        )
    if count(series) < LEAST_BALLS:
        raise InputError(f"{count(series)} balls are too few to find lights by: give at least {LEAST_BALLS}")
    smooth = smoothed(untouched, ball)
    known = [(one, *one.inside(ball, _INNER)) for one in series]
    places = [view_places(shape, pixels)[: 3 if count(series) >= NEAR_BALLS else 1] for _, pixels, _ in known]
    columns = np.concatenate(
        [
            (normal.T[:, :, None] * place.T[:, None, :]).reshape(len(pixels), -1)
            for (_, pixels, normal), place in zip(known, places, strict=True)
        ]
    )
    vectors = np.zeros((len(untouched), 3, 3))
    for light, rest in enumerate(smooth):
        share = [one.levels[light].ravel()[pixels] / rest.ravel()[pixels] for one, pixels, _ in known]
        vectors[light, :, : len(places[0])] = _lit_fit(columns, np.concatenate(share).astype(np.float64)).reshape(3, -1)
    if np.hypot(*vectors[:, :2, 0].T).max() < _LEAST_LEAN:
        raise InputError("all lights come from straight above: slopes change nothing; light the gel from the sides")
    return LightDirections(
        vectors=vectors,
        untouched=smooth,
        noise_grey=noise_grey,
        pixel_size_mm=ball.pixel_size_mm,
        camera_height_mm=ball.told_height_mm,
    )


def check_lights(lights: LightDirections, series: Sequence[BallSeries], ball: Ball) -> HeldOutBalls:
    """Feel balls that the lights were not found from; InputError where they are felt badly."""
    found = held_out(lambda levels: lights.gradient_map(levels)[0], series, ball)
    if found.normal_deg > _WORST_DEG:
        raise InputError(
            f"balls that were held out are felt {found.normal_deg:.1f} degrees off, {_WORST_DEG:g} are allowed: check "
            "the circles, the radius of the ball, and that the pictures are of one press and in the order of the lights"
        )
    return found


def _lit_fit(columns: Array, share: Array) -> Array:
    lit = share > 0.15
    amounts = np.zeros(columns.shape[1])
    for _ in range(_ROUNDS):
        amounts = np.asarray(np.linalg.lstsq(columns[lit], share[lit], rcond=None)[0], np.float64)
        lit = share > np.maximum(columns @ amounts - _SHADOW, 0.15)
    return amounts


OPTIONS = TableOptions(inset_px=1.0, flat_distance=1.9, flat_share=0.3)


def fit_channels(
    balls: LitBalls,
    out: Path,
    *,
    options: TrainingOptions | None = None,
    overwrite: bool = False,
    progress: Progress = silent,
) -> Bundle:
    """Find the lights, train GelNet on their channels, and write a bundle of both; returns it as it will be loaded.

    The recipe `thorough` learns few balls by heart, for it hardly moves the places of pixels: `fast` is the default. A
    quarter of the balls judges both ways, after which all are used; the errors are in the metrics. A bundle without
    light groups is for recorded pictures. Raises InputError, TrainingError or BundleError; then `out` is as it was.
    """
    ball, wanted = balls.ball, options or TrainingOptions()
    training, judging = divided(balls.series)
    fair = lights_from_balls(training, balls.untouched, ball, balls.noise_grey)
    solved = check_lights(fair, judging, ball)
    network, _ = train(channel_table(training, fair.untouched, ball), wanted, progress=progress)
    felt = _judged(network, fair, judging, ball)
    lights = lights_from_balls(balls.series, balls.untouched, ball, balls.noise_grey)
    if balls.groups is not None:
        lights = replace(lights, groups=balls.groups)
    table = channel_table(balls.series, lights.untouched, ball)
    network, record = train(table, wanted, progress=progress)
    return write_bundle(
        out,
        sensor=balls.sensor,
        reference=np.clip(as_rgb(lights.untouched), 0, 255),
        reference_frames=1,
        noise_grey=balls.noise_grey,
        pixel_size_mm=(ball.pixel_size_mm, ball.pixel_size_mm),
        camera_height_mm=ball.told_height_mm,
        network=network,
        presses=shown(table, lights.untouched).arrays(),
        metrics={
            "ball_radius_mm": ball.radius_mm,
            "held_out": {"network": felt.as_json(), "least_squares": solved.as_json()},
            "training": record,
        },
        extra_files={FILE_NAME: lights.content()},
        overwrite=overwrite,
        camera=balls.camera,
    )


def shown(table: PressTable, untouched: Floats) -> PressTable:
    """Return the rows in contact as the picture of a frame shows them: changes of red, green, blue, grey levels."""
    touched = np.flatnonzero(table.rows[:, -2:].any(axis=1))
    rows = table.rows[touched]
    x, y = rows[:, -4].astype(int), rows[:, -3].astype(int)
    change = np.asarray(rows[:, :-4].T / 100 * untouched[:, y, x], np.float32)
    colours = as_rgb(change[:, None])[0]
    return PressTable(
        rows=np.concatenate([colours, rows[:, -4:]], axis=1).astype(np.float32),
        image=table.image[touched],
        image_size=table.image_size,
    )


def _judged(network: bytes, lights: LightDirections, judging: Sequence[BallSeries], ball: Ball) -> HeldOutBalls:
    trained = ChannelNetwork(network, lights.untouched, source="the new network")
    return held_out(trained.gradient_map, judging, ball)


def channel_table(
    series: Sequence[BallSeries], untouched: Floats, ball: Ball, options: TableOptions = OPTIONS
) -> PressTable:
    """Build the table of all balls; untouched: (K, H, W) grey levels. Each ball counts as an image."""
    random = np.random.default_rng(options.seed)
    parts = []
    for one in series:
        change = change_percent(one.levels, untouched).reshape(*one.shape, -1)
        parts += [labelled_rows(press, one.presses, change, ball, options, random) for press in one.presses]
    return PressTable.joined(parts, np.arange(len(parts), dtype=np.int32), series[0].shape)
