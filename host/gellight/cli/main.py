"""`gellight`: the verbs; `ending.py` turns an error into a message, and every end into an exit status."""

import importlib.metadata
import io
import os
import sys
from typing import Annotated

import typer

from gellight.base.beside import comes_with
from gellight.cli.ending import MEANINGS, end
from gellight.cli.lazy import MARKUP, open_group

ELSEWHERE = {
    verb: comes_with(f"gellight_{extra}", extra)
    for extra, verbs in {"design": ("optimize", "simulate"), "scan": ("scan", "surface")}.items()
    for verb in verbs
}
"""verbs of distributions beside this one"""
MOVED = {
    "replay": "is `gellight run FILE` now",
    "virtual-sensor": "is an instrument of the tests now: tests/virtual_usb",
    "sim": "is an instrument of the tests now: tests/helpers/terminal_board.py; verbs of the ring take --url sim://",
    "selfcheck": "is `python -m tests.benchmarks.selfcheck` in a checkout now",
}
"""what to type instead of verbs of before 2.0"""
VERBS = open_group(
    {
        "Try": {
            "demo": ("demo:command", "Press objects into a simulated sensor, and see what it feels."),
        },
        "Run": {
            "run": ("run:command", "Stream depth from a sensor, or from a recording."),
            "record": ("record:command", "Record what a sensor gives, in an MCAP file."),
            "export": ("export:command", "Turn a recording into arrays, pictures or a video."),
            "reconstruct": ("reconstruct:command", "Reconstruct depth and contact from pictures of the gel."),
        },
        "Calibrate": {
            "calibrate": ("calibrate.verbs:app", "Calibrate a sensor, and keep its bundles."),
        },
        "Look after": {
            "find": ("find:command", "List the sensors, cameras and light rings that are there."),
            "doctor": ("doctor:command", "Check computer, USB, camera, ring, frames and training."),
            "status": ("status:command", "Show the daemons of this computer, and how they are."),
            "config": ("config:app", "Show the settings, and what could be set."),
            "service": ("service:app", "Let systemd run the sensor of this user."),
            "install-udev": ("install_udev:command", "Let users who are not root use the sensor; needs root."),
            "ring": ("ring:app", "The light ring by hand."),
            "firmware": ("firmware:app", "The firmware of the light ring: see it, flash it."),
        },
    },
    ELSEWHERE | MOVED,
)

app = typer.Typer(
    name="gellight",
    cls=VERBS,
    rich_markup_mode=MARKUP,
    epilog="Exit status: " + "; ".join(f"{status:d} {meaning}" for status, meaning in MEANINGS.items()),
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


def run() -> None:
    """Run the command line and exit with its status."""
    # NumPy's BLAS would keep a second thread spinning between our small products, and take a core from the frame path:
    # 22 instead of 28 frames a second on two cores. NumPy reads the variable when it is first imported.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")  # as stderr has it: names of files need not be UTF-8
    end(app)
