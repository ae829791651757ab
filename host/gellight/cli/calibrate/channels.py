"""`gellight calibrate channels`: GelNet over three or more lights, shown one after the other."""

from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from gellight.base.errors import InputError
from gellight.base.settings import load_settings
from gellight.cli.calibrate.told_ball import told_ball
from gellight.cli.calibrate.training_options import Training, training_option
from gellight.cli.options import AsJson, NewBundle, with_options
from gellight.cli.showing import progress, show
from gellight.daemon.bundle_choice import sensor_name
from gellight.frames.image_files import image_files, read_grey
from gellight.lab.optics.lights.ball_series import LitBalls, read_series, take_series
from gellight.lab.optics.lights.channel_fit import fit_channels
from gellight.lab.training.label_file import read_presses
from gellight.opening import open_camera
from gellight.photometric.ring_geometry import RingGeometry
from gellight.reconstruction.image_noise import noise_of_one
from gellight.sensor.lighting.sequence_choice import chosen_groups

picture_option = partial(typer.Option, rich_help_panel="From pictures")
sensor_option = partial(typer.Option, rich_help_panel="From a sensor")


@dataclass(frozen=True)
class ChannelInput:
    """Recorded pictures, or a sensor that shows the lights."""

    ball_radius_mm: Annotated[float, typer.Option(help="radius of the balls, mm")]
    pixel_size_mm: Annotated[float, typer.Option(help="mm per pixel on the gel")]
    balls: Annotated[
        str | None, picture_option(help="folder or quoted pattern: balls, one picture a light; or several such series")
    ] = None
    untouched: Annotated[
        str | None, picture_option(help="folder or quoted pattern: the untouched gel, in the same order")
    ] = None
    presses: Annotated[
        Path | None, picture_option(help="csv of the circles, as `detect` writes it; they hold in all pictures")
    ] = None
    white: Annotated[
        float | None, picture_option(min=1, help="level that is white", show_default="255, or 65535 of 16 bit")
    ] = None
    sensor: Annotated[
        str | None, sensor_option(help="URL of the sensor.", show_default="as in the settings, or auto")
    ] = None
    sequence: Annotated[
        str | None, sensor_option(help="with a sensor: its light groups, rgb, single or a JSON file")
    ] = None
    balls_to_press: Annotated[int, sensor_option(min=6, help="with a sensor: presses, a fourth of which judges")] = 16

    def taken(self) -> LitBalls:
        """Return the pictures, read or taken now; InputError for what cannot be used."""
        recorded = [self.balls, self.untouched, self.presses]
        wrong = any(recorded) if self.sequence is not None else None in recorded
        if wrong:
            raise InputError(
                "give either --balls, --untouched and --presses of recorded pictures, or --sequence of a sensor"
            )
        if self.sequence is not None:
            return self._from_sensor(self.sequence)
        assert self.balls is not None
        assert self.untouched is not None
        assert self.presses is not None
        return self._from_pictures(self.balls, self.untouched, self.presses)

    def _from_pictures(self, balls: str, untouched: str, presses: Path) -> LitBalls:
        ball = told_ball(self.ball_radius_mm, self.pixel_size_mm)
        of_balls, flat = (same_size(image_files(text), self.white) for text in (balls, untouched))
        levels = np.stack([read_grey(path, self.white) for path in flat])
        labelled = read_presses(presses, ball=ball, image_shape=(levels.shape[1], levels.shape[2]))
        series = read_series(of_balls, labelled, len(levels), self.white)
        return LitBalls(series=series, untouched=levels, ball=ball, noise_grey=noise_of_one(levels[0][..., None]))

    def _from_sensor(self, sequence: str) -> LitBalls:
        ball = told_ball(self.ball_radius_mm, self.pixel_size_mm)
        settings = load_settings({"sensor.url": self.sensor})
        with open_camera(settings.sensor.url, geometry=settings.geometry.overrides()) as camera:
            if camera.stage:
                ball = replace(ball, camera_height_mm=camera.stage.camera_height_mm)
            groups = chosen_groups(sequence, RingGeometry.from_overrides(settings.geometry.overrides()).colours)
            name = sensor_name(camera)
            return take_series(
                camera, groups, ball, self.balls_to_press, sensor=name, ask=_ask, tell=partial(typer.echo, err=True)
            )


@dataclass(frozen=True)
class FewBalls(Training):
    """How a network of few balls is trained."""

    recipe: Annotated[str, training_option(help="fast; thorough learns few balls by heart")] = "fast"


@with_options
def command(given: ChannelInput, how: FewBalls, new: NewBundle, as_json: AsJson = False) -> None:
    """Train GelNet on balls under three or more lights, a channel for each.

    From recorded pictures, of any lights and of one channel and 16 bit too; a pattern is expanded in natural order, and
    several series follow each other. `reconstruct --calibration` then takes one picture a light. Or from a sensor with
    a ring, which shows the groups of --sequence: you are asked for one press after the other, on a simulated sensor a
    virtual hand presses; `run --calibration` then shows these groups in turn. A quarter of the balls is held out and
    judges GelNet beside least squares.
    """
    taken = given.taken()
    with progress("training") as report:
        bundle = fit_channels(taken, new.out, options=how.options(), overwrite=new.overwrite, progress=report)
    judged = bundle.metrics["held_out"]
    lines = [f"wrote {new.out}; on {judged['network']['balls']} balls that were held out:"]
    for name, way in (("network", "GelNet"), ("least_squares", "least squares")):
        near, wide, felt = (judged[name][key] for key in ("normal_deg", "wide_normal_deg", "felt_radius_mm"))
        lines.append(
            f"{way:14} normals {near:.2f} and {wide:.2f} deg within 0.8 and 0.95 of the contact, radius {felt:.4g} mm"
        )
    show({"calibration": str(new.out), "held_out": judged}, as_json, "\n".join(lines))


def same_size(paths: list[Path], white: float | None) -> list[Path]:
    """Return the paths; InputError where their pictures differ in size."""
    shapes = {read_grey(path, white).shape for path in paths}
    if len(shapes) > 1:
        raise InputError(f"the pictures beside {paths[0]} have several sizes: give those of one camera setting")
    return paths


def _ask(words: str) -> None:
    typer.prompt(f"{words}; then Enter", default="", show_default=False, err=True)
