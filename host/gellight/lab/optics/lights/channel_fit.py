"""GelNet trained on balls under one light after the other, a channel for each light, and the bundle that holds it."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gellight.bundle.bundle import Bundle, write_bundle
from gellight.lab.optics.lights.ball_lights import check_lights, lights_from_balls
from gellight.lab.optics.lights.ball_series import BallSeries, HeldOutBalls, LitBalls, divided, held_out
from gellight.lab.training.child import Check, Progress, go_on, silent
from gellight.lab.training.presses import Ball, PressTable, TableOptions, distance_px, sphere_gradient
from gellight.lab.training.training import TrainingOptions, train
from gellight.photometric.directions import FILE_NAME, LightDirections
from gellight.series.channel_network import ChannelNetwork, change_percent
from gellight.series.recorded import as_rgb

Floats = NDArray[np.float32]
OPTIONS = TableOptions(inset_px=1.0, flat_distance=1.9, flat_share=0.3)


def fit_channels(
    balls: LitBalls,
    out: Path,
    *,
    options: TrainingOptions | None = None,
    overwrite: bool = False,
    progress: Progress = silent,
    check: Check = go_on,
) -> Bundle:
    """Find the lights, train GelNet on their channels, and write a bundle of both; returns it as it will be loaded.

    The recipe `thorough` learns few balls by heart, for it hardly moves the places of pixels: `fast` is the default. A
    quarter of the balls judges both ways, after which all are used; the errors are in the metrics. A bundle without
    light groups is for recorded pictures. Raises InputError, TrainingError or BundleError; then `out` is as it was.
    """
    ball, wanted = balls.ball, options or TrainingOptions()
    learnt, judging = divided(balls.series)
    fair = lights_from_balls(learnt, balls.untouched, ball, balls.noise_grey)
    solved = check_lights(fair, judging, ball)
    network, _ = train(channel_table(learnt, fair.untouched, ball), wanted, progress=progress, check=check)
    felt = _judged(network, fair, judging, ball)
    lights = lights_from_balls(balls.series, balls.untouched, ball, balls.noise_grey)
    if balls.groups is not None:
        lights = replace(lights, groups=balls.groups)
    network, record = train(channel_table(balls.series, lights.untouched, ball), wanted, progress=progress, check=check)
    return write_bundle(
        out,
        sensor=balls.sensor,
        reference=np.clip(as_rgb(lights.untouched), 0, 255),
        reference_frames=1,
        noise_grey=balls.noise_grey,
        pixel_size_mm=(ball.pixel_size_mm, ball.pixel_size_mm),
        network=network,
        metrics={
            "ball_radius_mm": ball.radius_mm,
            "held_out": {"network": felt.as_json(), "least_squares": solved.as_json()},
            "training": record,
        },
        extra_files={FILE_NAME: lights.content()},
        overwrite=overwrite,
        camera=balls.camera,
    )


def _judged(network: bytes, lights: LightDirections, judging: Sequence[BallSeries], ball: Ball) -> HeldOutBalls:
    trained = ChannelNetwork(network, lights.untouched, source="the new network")
    return held_out(trained.gradient_map, judging, ball)


def channel_table(
    series: Sequence[BallSeries], untouched: Floats, ball: Ball, options: TableOptions = OPTIONS
) -> PressTable:
    """Build the table of all balls; untouched: (K, H, W) grey levels. Each ball counts as an image."""
    random = np.random.default_rng(options.seed)
    parts = [rows for one in series for rows in _rows(one, untouched, ball, options, random)]
    return PressTable(
        rows=np.concatenate(parts),
        image=np.repeat(np.arange(len(parts), dtype=np.int32), [len(rows) for rows in parts]),
        image_size=(untouched.shape[2], untouched.shape[1]),
    )


def _rows(
    one: BallSeries, untouched: Floats, ball: Ball, options: TableOptions, random: np.random.Generator
) -> list[Floats]:
    """Return the rows of each ball of a series; flat are pixels that are far from all of them."""
    change, width = change_percent(one.levels, untouched), one.shape[1]
    distances = [distance_px(press, one.shape).ravel() for press in one.presses]
    reach = [options.flat_distance * press.contact_radius_px for press in one.presses]
    far = np.flatnonzero(np.all([away > limit for away, limit in zip(distances, reach, strict=True)], axis=0))
    tables = []
    for press, distance in zip(one.presses, distances, strict=True):
        contact = np.flatnonzero(distance < press.contact_radius_px - options.inset_px)
        flat = random.choice(far, min(len(far), round(options.flat_share * len(contact))), replace=False)
        chosen = np.concatenate([contact, flat])
        slopes = np.zeros((len(chosen), 2), np.float32)
        slopes[: len(contact)] = sphere_gradient(press, ball, one.shape).reshape(-1, 2)[contact]
        places = np.stack([chosen % width, chosen // width], axis=1).astype(np.float32)
        tables.append(np.concatenate([change[chosen], places, slopes], axis=1).astype(np.float32))
    return tables
