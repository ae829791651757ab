"""`gellight replay`: a recording as if it were a sensor."""

from pathlib import Path
from typing import Annotated
from urllib.parse import quote

import typer

from gellight.base.settings import load_settings
from gellight.cli.options import with_options
from gellight.cli.run_options import RunOptions


@with_options
def command(
    options: RunOptions,
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A recording of `gellight record`.")],
    speed: Annotated[
        float, typer.Option(min=0, max=1000, help="2: twice as fast; 0: as fast as depth is computed.")
    ] = 1,
    start: Annotated[float, typer.Option(min=0, help="Begin this number of seconds after the first frame.")] = 0,
    loop: Annotated[bool, typer.Option("--loop", help="Begin again at the end.")] = False,
    dashboard: Annotated[bool, typer.Option(help="Serve the dashboard.")] = True,
    as_json: Annotated[bool, typer.Option("--json", help="Print the status as JSON.")] = False,
) -> None:
    """Play a recording as if it were a sensor.

    Depth is computed anew, with the calibration bundle of the recording, or that of --calibration.
    """
    from gellight.cli.one_sensor import run_sensor  # not for the help

    url = f"replay://{quote(str(file.resolve()))}?speed={speed:g}&start={start:g}&loop={int(loop)}"
    flags = options.flags()
    flags["sensor.calibration"] = flags["sensor.calibration"] or "auto"
    run_sensor(load_settings({"sensor.url": url, **flags}), options, dashboard=dashboard, as_json=as_json)
