"""`gellight calibrate lights`: measure the light of each LED, for photometric stereo, and add it to a bundle."""

from typing import Annotated

import typer

from gellight.base.settings import load_settings
from gellight.cli.options import AsJson, NewBundle, Sensor, with_options
from gellight.cli.showing import show
from gellight.daemon.assembly import chosen_bundle
from gellight.lab.optics.lights.adding import add_lights

FRAMES = 8
"""averaged under each light"""


@with_options
def command(
    new: NewBundle,
    sensor: Sensor = None,
    calibration: Annotated[
        str | None, typer.Option(help="bundle that the lights are added to.", show_default="that of the sensor")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Measure the light of each LED on the untouched gel.

    Lift everything off the gel before.
    """
    settings = load_settings({"sensor.url": sensor, "sensor.calibration": calibration})
    found = add_lights(chosen_bundle(settings), settings, new.out, frames=FRAMES, overwrite=new.overwrite)
    show(found, as_json)
