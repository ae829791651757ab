"""`gellight calibrate objects`: the ten benchmark objects, which no calibration has seen."""

import json
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from gellight.evaluation.object_errors import ObjectError

Sensor = Annotated[str | None, typer.Option(help="URL of the sensor.", show_default="as in the settings, or sim://")]
AsJson = Annotated[bool, typer.Option("--json", help="print one JSON object instead of text")]


def command(
    calibration: Annotated[str, typer.Option(help="bundle: folder, .gelcal file or 'synthetic'")],
    sensor: Sensor = None,
    press_depth_mm: Annotated[float, typer.Option(min=0.05, help="how deep the objects are pressed, mm")] = 0.3,
    rezero: Annotated[
        bool, typer.Option("--rezero", help="record the untouched gel anew before, nothing else")
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Press the ten benchmark objects into the simulated sensor and measure the error of a bundle on each."""
    from gellight.base.settings import load_settings
    from gellight.evaluation.object_errors import object_errors, summary

    settings = load_settings({"sensor.url": sensor})
    geometry = settings.geometry.overrides()
    errors = object_errors(calibration, settings.sensor.url, geometry, press_depth_mm, rezero=rezero)
    result = {"calibration": calibration, "sensor": settings.sensor.url, "press_depth_mm": press_depth_mm}
    rows = [*errors, summary(errors)]
    typer.echo(json.dumps({**result, "objects": [vars(e) for e in rows]}, indent=2) if as_json else _object_text(rows))


def _object_text(rows: "list[ObjectError]") -> str:
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
