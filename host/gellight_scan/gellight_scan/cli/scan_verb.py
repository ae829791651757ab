"""`gellight scan`: presses side by side become one map of a surface larger than the view, touches of a body a mesh."""

from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from gellight.base.errors import InputError
from gellight.base.settings import load_settings
from gellight.cli.options import AsJson, RunOptions, rare_option, with_options

shape_option = partial(typer.Option, rich_help_panel="Shape of the part")


@with_options
def command(
    options: RunOptions,
    folder: Annotated[Path, typer.Argument(metavar="FOLDER", help="Of the scan; one that is there goes on.")],
    recording: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Take the presses of a recording, not of a sensor.")
    ] = None,
    sensor: Annotated[
        str | None, typer.Option(help="As `gellight run` has it.", show_default="auto, or the settings")
    ] = None,
    presses: Annotated[
        int, typer.Option(min=0, help="End after this number of presses, or touches of a body; 0: at Ctrl-C.")
    ] = 0,
    curved: Annotated[
        bool, shape_option("--curved", help="The part is not flat as a whole: take only its plane off.")
    ] = False,
    body: Annotated[
        bool, shape_option("--body", help="The part is round: it is rolled in the gel, and becomes a mesh.")
    ] = False,
    dashboard: Annotated[bool, rare_option(help="Serve the dashboard.")] = False,
    as_json: AsJson = False,
) -> None:
    """Scan a surface larger than the view, press by press.

    Press, lift, press beside, over half of a press that was.

    After each press it is said to which ones it could be joined and where no press has been. FOLDER has map.npz, the
    heights with their errors where the gel reached the part, and map.png, a picture of it; both grow with every press.
    --body: press it and roll it slowly, without lifting it; what was lifted is found again where it was touched before.
    FOLDER has body.ply, the surface with its errors, body.stl and body.png.
    Ends with status 1 where presses could not be joined.
    """
    from gellight_scan.cli.scanning import scan_live, scan_recording  # not for the help

    if recording is not None and sensor is not None:
        raise InputError("give --recording or --sensor, one of the two")
    if body and curved:
        raise InputError("--curved is of flat parts: a body keeps its shape in any case; leave it out")
    if recording is not None:
        scan_recording(recording, folder, options.calibration, presses, curved=curved, body=body, as_json=as_json)
    else:
        settings = load_settings({"sensor.url": sensor, **options.flags()})
        scan_live(settings, folder, options.frames, presses, curved=curved, body=body, dashboard=dashboard,
                  as_json=as_json)  # fmt: skip
