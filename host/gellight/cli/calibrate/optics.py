"""`gellight calibrate lens` and `lights`: measure the camera's distortion or the light of each LED for a bundle."""

from pathlib import Path
from typing import Annotated

import typer

from gellight.base.settings import load_settings
from gellight.bundle.bundle import load_bundle
from gellight.cli.options import AsJson, NewBundle, Sensor, with_options
from gellight.cli.showing import show
from gellight.daemon.assembly import chosen_bundle
from gellight.frames.image_files import image_files
from gellight.lab.optics.lens.measuring import LensFigures, add_lens, figures, measure_lens, write_overlay
from gellight.lab.optics.lights.adding import add_lights

FRAMES = 8
"""averaged under each light"""


@with_options
def lens(
    images: Annotated[list[str], typer.Argument(metavar="IMAGE...", help="pictures of the grid: files or folders")],
    pitch_mm: Annotated[float, typer.Option(help="distance of two neighbouring pins of the square grid, mm")],
    calibration: Annotated[str, typer.Option(help="bundle that the lens is added to")],
    new: NewBundle,
    reference: Annotated[
        str | None,
        typer.Option(
            help="image of the untouched gel, or a folder of them: for pins that press into it, felt by the bundle"
        ),
    ] = None,
    overlay: Annotated[Path | None, typer.Option(help="PNG file to draw the pins of the first picture into")] = None,
    as_json: AsJson = False,
) -> None:
    """Measure the distortion of the lens and write the bundle with it.

    The pictures show a grid of pins. Depth, contact and slopes are then over the undistorted gel. Without such a file
    in its bundle nothing changes.
    """
    bundle = load_bundle(calibration)
    paths = [path for text in images for path in image_files(text)]
    fit = measure_lens(bundle, paths, pitch_mm, reference)
    if overlay is not None:
        write_overlay(overlay, paths[0], fit)
    written = add_lens(bundle, fit, paths, new.out, overwrite=new.overwrite)
    found = figures(fit, bundle)
    result = {"calibration": str(new.out), "identity": written.identity, **found.as_json()}
    show(result, as_json, _text(found, new.out))


def _text(lens: LensFigures, out: Path) -> str:
    x, y = lens.middle_mm_per_px
    bundle_x, bundle_y = lens.bundle_mm_per_px
    return "\n".join(
        [
            f"{lens.pins} pins in {lens.pictures} picture(s)",
            f"off a straight grid   {lens.rms_before_px:.3f} px, {1000 * lens.rms_before_mm:.1f} um rms",
            f"off this lens         {lens.rms_after_px:.3f} px, {1000 * lens.rms_after_mm:.1f} um rms",
            f"the lens moves a corner of the picture by {lens.corner_moves_px:.1f} px",
            f"pixels in the middle  {x:.5f} x {y:.5f} mm; undistorted ones, by the bundle, {bundle_x:g} x {bundle_y:g}",
            f"not seen by the camera: {100 * lens.not_seen_share:.1f} % of the undistorted view",
            f"wrote {out}",
        ]
    )


@with_options
def lights(
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
