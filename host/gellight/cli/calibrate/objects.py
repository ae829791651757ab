"""`gellight calibrate objects`: the ten benchmark objects, which no calibration has seen."""

import json
from dataclasses import asdict
from typing import Annotated

import typer

from gellight.cli.options import AsJson, Calibration, simulated_settings
from gellight.lab.evaluation.object_errors import ObjectError, object_errors, summary


def command(
    calibration: Calibration,
    sensor: Annotated[str | None, typer.Option(help="URL of a simulated sensor.", show_default="sim://")] = None,
    press_depth_mm: Annotated[float, typer.Option(min=0.05, help="how deep the objects are pressed, mm")] = 0.3,
    rezero: Annotated[
        bool, typer.Option("--rezero", help="record the untouched gel anew before, nothing else")
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Measure the error of a bundle on the ten benchmark objects.

    They are pressed into the simulated sensor.
    """
    settings = simulated_settings({"sensor.url": sensor})
    geometry = settings.geometry.overrides()
    errors = object_errors(calibration, settings.sensor.url, geometry, press_depth_mm, rezero=rezero)
    result = {"calibration": calibration, "sensor": settings.sensor.url, "press_depth_mm": press_depth_mm}
    rows = [*errors, summary(errors)]
    typer.echo(json.dumps({**result, "objects": [asdict(row) for row in rows]}, indent=2) if as_json else _table(rows))


def _table(rows: list[ObjectError]) -> str:
    lines = [
        f"{'':10}{'normals °':>20}{'depth mm':>22}",
        f"{'object':10}{'whole':>10}{'contact':>10}{'whole':>11}{'contact':>11}",
    ]
    for row in rows:
        lines.append(
            f"{row.object_name:10}{row.normal_deg:10.3f}{row.contact_normal_deg:10.3f}{row.depth_mm:11.4f}"
            f"{row.contact_depth_mm:11.4f}"
        )
    return "\n".join(lines)
