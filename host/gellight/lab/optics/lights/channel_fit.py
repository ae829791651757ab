"""GelNet trained on balls under one light after the other, a channel for each light, and the bundle that holds it."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gellight.bundle.bundle import Bundle, write_bundle
from gellight.lab.optics.lights.ball_lights import check_lights, lights_from_balls
from gellight.lab.optics.lights.ball_series import BallSeries, HeldOutBalls, LitBalls, divided, held_out
from gellight.lab.training.child import Progress, silent
from gellight.lab.training.level_light import TrainingData
from gellight.lab.training.presses import Ball
from gellight.lab.training.table import PressTable, TableOptions, labelled_rows
from gellight.lab.training.training import TrainingOptions, train
from gellight.photometric.directions import FILE_NAME, LightDirections
from gellight.series.single_light_path import ChannelNetwork, change_percent
from gellight.series.summary import as_rgb

Floats = NDArray[np.float32]


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
    network, _ = train(TrainingData(channel_table(training, fair.untouched, ball)), wanted, progress=progress)
    felt = _judged(network, fair, judging, ball)
    lights = lights_from_balls(balls.series, balls.untouched, ball, balls.noise_grey)
    if balls.groups is not None:
        lights = replace(lights, groups=balls.groups)
    table = channel_table(balls.series, lights.untouched, ball)
    network, record = train(TrainingData(table), wanted, progress=progress)
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
    random = np.random.default_rng(0)
    parts = []
    for one in series:
        change = change_percent(one.levels, untouched).reshape(*one.shape, -1)
        parts += [labelled_rows(press, one.presses, change, ball, options, random) for press in one.presses]
    return PressTable.joined(parts, np.arange(len(parts), dtype=np.int32), series[0].shape)
