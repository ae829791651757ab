"""`gellight calibrate force`: find what turns depth into newtons, and add it to a bundle."""

from pathlib import Path
from typing import Annotated

import typer

from gellight.base.errors import InputError
from gellight.base.settings import load_settings
from gellight.bundle.bundle import extend_bundle, load_bundle
from gellight.cli.calibrate.told_ball import told_layer
from gellight.cli.options import AsJson, NewBundle, with_options
from gellight.cli.showing import show
from gellight.lab.calibration.force.fit import measure_force
from gellight.reconstruction.force_file import ForceRecord


@with_options
def command(
    forces: Annotated[
        Path,
        typer.Argument(
            help="CSV: image,force_n of weights, or unix_s,force_n of a load cell; object where several press"
        ),
    ],
    calibration: Annotated[str, typer.Option(help="bundle that the force is added to")],
    new: NewBundle,
    recording: Annotated[
        Path | None, typer.Option(help="recording of `gellight record`, of the same time as the load cell's readings")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Find what turns depth into newtons, with weights or a load cell.

    The pictures show the gel pressed by known weights, or the recording runs while a load cell is read. Frames then
    carry the normal force and a pressure map. The gel is that of the settings, else that of the bundle.
    """
    bundle = load_bundle(calibration)
    layer = told_layer(bundle)
    if layer is None:
        raise InputError(
            "nobody told how thick the gel is: give gel_thickness_mm under [geometry] in gellight.toml, and "
            "poisson_ratio where it is no silicone"
        )
    record = measure_force(bundle, forces, recording, layer, load_settings().geometry.camera_height_mm)
    written = extend_bundle(bundle, new.out, record.files(), overwrite=new.overwrite)
    found = {"calibration": str(new.out), "identity": written.identity, **record.model_dump(mode="json")}
    show(found, as_json, _text(record, new.out))


def _text(record: ForceRecord, out: Path) -> str:
    return "\n".join(
        [
            f"{record.readings} readings in contact, {record.lightest_n:g} to {record.heaviest_n:g} N",
            f"modulus   {record.youngs_modulus_mpa:.4g} MPa of a layer of {record.gel_thickness_mm:g} mm",
            f"error     {100 * record.error_share:.1f} % of a force, and {record.error_floor_n:.3g} N",
            *_others(record),
            f"the load cell came {record.lag_s:g} s after the pictures",
            f"wrote {out}",
        ]
    )


def _others(record: ForceRecord) -> list[str]:
    if record.other_objects_share is None:
        return ["objects   one: how well others are weighed nobody knows (name them in a column `object`)"]
    return [f"objects   {100 * record.other_objects_share:.1f} % of a force off on each one that was left out, rms"]
