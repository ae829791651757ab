"""`gellight run`: one or several real sensors with their dashboard, through unplugging and plugging in."""

from typing import Annotated

import typer

from gellight.base.settings import load_settings
from gellight.cli.options import with_options
from gellight.cli.run_options import RunOptions


@with_options
def command(
    options: RunOptions,
    sensor: Annotated[
        list[str] | None,
        typer.Option(
            help="auto, sensor://NAME, v4l2:///dev/..., sim://; several times for several sensors",
            show_default="as in the settings, or auto",
        ),
    ] = None,
    dashboard: Annotated[bool, typer.Option(help="Serve the dashboard.")] = True,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print the status as JSON: every second, or once after --frames.")
    ] = False,
) -> None:
    """Stream depth from a sensor, also after it was unplugged for a while.

    While it is unplugged the status is served, and the sensor is looked for.
    """
    from gellight.cli.one_sensor import run_sensor  # not for the help
    from gellight.cli.several_sensors import run_several

    urls: list[str | None] = [*(sensor or [])] or [None]
    each = [load_settings({"sensor.url": url, **options.flags()}) for url in urls]
    if len(each) == 1:
        run_sensor(each[0], options, dashboard=dashboard, as_json=as_json)
    else:
        run_several(each, options, dashboard=dashboard, as_json=as_json)
