"""`gellight`: the verbs, and the one place where an error becomes a message and an exit status."""

import importlib.metadata
import os
import sys
from typing import Annotated

import typer

from gellight.base.errors import GellightError
from gellight.cli import (
    bench,
    calibrate,
    calibrate_bundles,
    calibrate_lens,
    calibrate_lights,
    calibrate_routine,
    config,
    demo,
    doctor,
    find,
    firmware,
    install_udev,
    optimize,
    reconstruct,
    ring,
    selfcheck,
    sim,
    virtual_sensor,
)
from gellight.cli import run as run_verb

app = typer.Typer(
    name="gellight",
    rich_markup_mode="markdown",  # the other mode takes "[default: ...]" for markup and leaves it out
    help="Camera-based tactile sensing: from light to depth.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)


def _print_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"gellight {importlib.metadata.version('gellight')}")
        raise typer.Exit


@app.callback()
def gellight(
    version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version and exit.")
    ] = False,
) -> None:
    """Camera-based tactile sensing: from light to depth."""


app.command("demo")(demo.command)
app.command("run")(run_verb.command)
app.command("find")(find.command)
app.command("doctor")(doctor.command)
app.command("install-udev")(install_udev.command)
app.command("reconstruct")(reconstruct.command)
app.command("selfcheck")(selfcheck.command)
calibrate.app.command("lens")(calibrate_lens.command)
calibrate.app.command("lights")(calibrate_lights.command)
calibrate_routine.attach(calibrate.app)
calibrate_bundles.attach(calibrate.app)
app.add_typer(calibrate.app)
app.command("bench")(bench.command)
app.add_typer(config.app, name="config")
app.add_typer(optimize.app, name="optimize")
app.add_typer(ring.app)
app.add_typer(firmware.app)
app.command("sim")(sim.command)
app.command("virtual-sensor")(virtual_sensor.command)


def run() -> None:
    """Run the command line; a `GellightError` is printed in one line and exits with status 2."""
    # NumPy's BLAS would keep a second thread spinning between our small products, and take a core from the frame path:
    # 22 instead of 28 frames a second on two cores. It must be told before NumPy is first imported.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    try:
        app()
    except GellightError as error:
        print(f"gellight: {error}", file=sys.stderr)
        sys.exit(2)
