"""`gellight calibrate starter`: a rough bundle for a unit that nobody calibrated, from bundles of its kind."""

from typing import Annotated

import typer

from gellight.bundle.bundle import load_bundle
from gellight.cli.calibrate.training_options import Training
from gellight.cli.options import AsJson, NewBundle, with_options
from gellight.cli.showing import progress, show
from gellight.lab.training.starter import make_starter
from gellight.lab.training.training import read_reference
from gellight.watch.possible import learnt_elsewhere


@with_options
def command(
    bundles: Annotated[list[str], typer.Argument(metavar="BUNDLE...", help="Bundles of other units of the same kind.")],
    bundle: NewBundle,
    how: Training,
    reference: Annotated[str, typer.Option(help="image of the untouched gel of your unit, or a folder, averaged")],
    pixel_size_mm: Annotated[float, typer.Option(min=0.0001, help="mm per pixel on the gel of your unit")],
    as_json: AsJson = False,
) -> None:
    """Learn on other units, for one that nobody calibrated: rough.

    Contact and shape are there at once; depth and normals are rough, and the page, `reconstruct` and each frame say
    that the bundle is not of this unit. Pictures of all units have to lie alike.
    """
    with progress("training") as report:
        written = make_starter(
            [load_bundle(name) for name in bundles],
            read_reference(reference),
            pixel_size_mm,
            bundle.out,
            options=how.options(),
            overwrite=bundle.overwrite,
            progress=report,
        )
    (finding,) = learnt_elsewhere(written)
    show({"bundle": str(bundle.out), **finding.figures}, as_json, f"{bundle.out} is written; {finding.text}")
