"""`gellight calibrate lights`: teach a calibration bundle the light of each LED, for photometric stereo."""

import json
from pathlib import Path
from typing import Annotated

import typer


def command(
    out: Annotated[Path, typer.Option(help="folder of the calibration bundle to write")],
    sensor: Annotated[str | None, typer.Option(help="URL of the camera.", show_default="sim://")] = None,
    calibration: Annotated[
        str | None, typer.Option(help="bundle that the lights are added to.", show_default="synthetic")
    ] = None,
    frames: Annotated[int, typer.Option(min=1, max=256, help="frames averaged for each LED")] = 8,
    ring_from_light: Annotated[
        bool,
        typer.Option("--ring-from-light", help="take the places of the LEDs from the pictures, not from the settings"),
    ] = False,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="replace an existing bundle")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="print one JSON object instead of text")] = False,
) -> None:
    """Measure the light of each LED on the untouched gel. Lift everything off the gel before."""
    from gellight.base.settings import load_settings
    from gellight.calibration.lights.adding import add_lights

    if out.exists() and not overwrite:
        # Said before the lights are taken, not after.
        raise typer.BadParameter(f"{out} exists: choose another name or give --overwrite", param_hint="--out")
    settings = load_settings({"sensor.url": sensor, "sensor.calibration": calibration})
    result = add_lights(settings, out, frames=frames, ring_from_light=ring_from_light, overwrite=overwrite)
    typer.echo(json.dumps(result, indent=2) if as_json else "\n".join(f"{k:20} {v}" for k, v in result.items()))
