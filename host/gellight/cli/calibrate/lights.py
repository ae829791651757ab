"""`gellight calibrate lights`: measure the light of each LED, for photometric stereo, and add it to a bundle."""

import json
from typing import Annotated

import typer

from gellight.base.settings import load_settings
from gellight.calibration.lights.adding import add_lights
from gellight.cli.options import AsJson, NewBundle, Sensor, with_options
from gellight.daemon.assembly import chosen_bundle


@with_options
def command(
    new: NewBundle,
    sensor: Sensor = None,
    calibration: Annotated[
        str | None, typer.Option(help="bundle that the lights are added to.", show_default="that of the sensor")
    ] = None,
    frames: Annotated[int, typer.Option(min=1, max=256, help="frames averaged for each LED")] = 8,
    ring_from_light: Annotated[
        bool,
        typer.Option("--ring-from-light", help="take the places of the LEDs from the pictures, not from the settings"),
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Measure the light of each LED on the untouched gel.

    Lift everything off the gel before.
    """
    settings = load_settings({"sensor.url": sensor, "sensor.calibration": calibration})
    found = add_lights(
        chosen_bundle(settings),
        settings,
        new.out,
        frames=frames,
        ring_from_light=ring_from_light,
        overwrite=new.overwrite,
    )
    typer.echo(json.dumps(found, indent=2) if as_json else "\n".join(f"{k:20} {v}" for k, v in found.items()))
