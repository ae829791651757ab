"""`gellight calibrate directions`: find the lights of any sensor from pictures of balls, one a light."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from gellight.base.errors import InputError
from gellight.cli.calibrate.told_ball import told_ball
from gellight.cli.options import AsJson, Overwrite, check_out, with_options
from gellight.cli.showing import show
from gellight.frames.image_files import image_files, read_grey
from gellight.lab.optics.lights.ball_lights import check_lights, lights_from_balls
from gellight.lab.optics.lights.ball_series import LitBalls, divided, read_series
from gellight.lab.training.label_file import read_presses
from gellight.reconstruction.image_noise import noise_of_one


@dataclass(frozen=True)
class Pictures:
    """One picture a light, in the same order everywhere."""

    balls: Annotated[
        str, typer.Option(help="folder or quoted pattern: balls, one picture a light; or several such series")
    ]
    untouched: Annotated[str, typer.Option(help="folder or quoted pattern: the untouched gel, in the same order")]
    presses: Annotated[Path, typer.Option(help="csv of the circles, as `detect` writes it; they hold in all pictures")]
    ball_radius_mm: Annotated[float, typer.Option(help="radius of the balls, mm")]
    pixel_size_mm: Annotated[float, typer.Option(help="mm per pixel on the gel")]
    white: Annotated[
        float | None, typer.Option(min=1, help="level that is white", show_default="255, or 65535 of 16 bit")
    ] = None

    def read(self) -> LitBalls:
        """Read all of it; InputError for what is wrong."""
        ball = told_ball(self.ball_radius_mm, self.pixel_size_mm)
        balls, flat = (same_size(image_files(text), self.white) for text in (self.balls, self.untouched))
        untouched = np.stack([read_grey(path, self.white) for path in flat])
        presses = read_presses(self.presses, ball=ball, image_shape=(untouched.shape[1], untouched.shape[2]))
        series = read_series(balls, presses, len(untouched), self.white)
        noise = noise_of_one(untouched[0][..., None])
        return LitBalls(series=series, untouched=untouched, ball=ball, noise_grey=noise)


@with_options
def command(
    pictures: Pictures,
    out: Annotated[Path, typer.Option(help="file to write: .npz")],
    overwrite: Overwrite = False,
    as_json: AsJson = False,
) -> None:
    """Find the direction of each light on balls of known radius.

    Every fourth ball is held out and judges; then all balls are used. The pictures may have one channel and 16 bit. A
    pattern is expanded in natural order. Several series, one after the other, are divided by series. `gellight
    reconstruct --lights` uses the file.
    """
    check_out(out, overwrite)
    given = pictures.read()
    training, judging = divided(given.series)
    same = given.untouched, given.ball, given.noise_grey
    judged = check_lights(lights_from_balls(training, *same), judging, given.ball)
    lights = lights_from_balls(given.series, *same)
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        lights.write(out)
    except OSError as error:
        raise InputError(f"{out} cannot be written ({error.strerror or error}): choose another place") from error
    middles = lights.vectors[:, :, 0]
    elevation = np.degrees(np.arctan2(middles[:, 2], np.hypot(middles[:, 0], middles[:, 1])))
    azimuth = np.degrees(np.arctan2(-middles[:, 1], middles[:, 0])) % 360
    found = {"azimuth_deg": azimuth.round(1).tolist(), "elevation_deg": elevation.round(1).tolist()}
    result = {"lights": str(out), **found, "held_out": judged.as_json()}
    show(result, as_json)


def same_size(paths: list[Path], white: float | None) -> list[Path]:
    """Return the paths; InputError where their pictures differ in size."""
    shapes = {read_grey(path, white).shape for path in paths}
    if len(shapes) > 1:
        raise InputError(f"the pictures beside {paths[0]} have several sizes: give those of one camera setting")
    return paths
