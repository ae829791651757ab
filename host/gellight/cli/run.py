"""`gellight run`: a sensor or a recording with its dashboard, through unplugging and plugging in."""

from pathlib import Path
from typing import Annotated
from urllib.parse import quote

import typer

from gellight.base.errors import InputError
from gellight.base.settings import load_settings
from gellight.cli.options import AsJson, RunOptions, with_options


@with_options
def command(
    options: RunOptions,
    file: Annotated[
        Path | None, typer.Argument(metavar="[FILE]", help="A recording of `gellight record`, instead of a sensor.")
    ] = None,
    sensor: Annotated[
        list[str] | None,
        typer.Option(
            help="auto, sensor://NAME, v4l2:///dev/... or sim://",
            show_default="as in the settings, or auto",
        ),
    ] = None,
    dashboard: Annotated[bool, typer.Option(help="Serve the dashboard.")] = True,
    as_json: AsJson = False,
) -> None:
    """Stream depth from a sensor, or from a recording.

    A sensor may be unplugged: then the status is served, and the sensor is looked for. Of a recording depth is computed
    anew, with its bundle or that of --calibration. --json: the status every second, or once after --frames.
    """
    from gellight.cli.one_sensor import run_sensor  # not for the help

    flags = options.flags()
    given = sensor or []
    if file is not None:
        given = [f"replay://{quote(str(file.resolve()))}", *given]
        flags["sensor.calibration"] = flags["sensor.calibration"] or "auto"
    if len(given) > 1:
        raise InputError(f"`gellight run` runs one of {', '.join(given)}: start it for each, their pages list all")
    settings = load_settings({"sensor.url": given[0] if given else None, **flags})
    run_sensor(settings, options, dashboard=dashboard, as_json=as_json)
