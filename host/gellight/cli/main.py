"""`gellight`: the verbs; `ending.py` turns an error into a message, and every end into an exit status."""

import importlib.metadata
import io
import os
import sys
from typing import Annotated

import typer

from gellight.cli.ending import MEANINGS, end
from gellight.cli.lazy import MARKUP, open_group

ELSEWHERE = {"optimize": "gellight_design", "scan": "gellight_scan", "surface": "gellight_scan"}
"""verbs of distributions beside this one"""
VERBS = open_group(
    {
        "demo": ("demo:command", "Press objects into a simulated sensor and see what it feels."),
        "run": ("run:command", "Stream depth from a sensor, also after it was unplugged for a while."),
        "status": ("status:command", "Show the daemons that run on this computer, and how they are."),
        "service": ("service:app", "Let systemd run the sensor of this user."),
        "record": ("record:command", "Record what a sensor gives in a file that ROS 2 tools open too."),
        "replay": ("replay:command", "Play a recording as if it were a sensor."),
        "export": ("export:command", "Turn a recording into arrays, pictures, surfaces or a video."),
        "find": ("find:command", "List the sensors, cameras and light rings that are plugged in."),
        "doctor": ("doctor:command", "Check computer, USB, camera, light ring, frames and training."),
        "install-udev": ("install_udev:command", "Let users who are not root use the sensor; needs root."),
        "reconstruct": ("reconstruct:command", "Reconstruct depth, normals and contact from images of the gel."),
        "selfcheck": ("selfcheck:command", "Compare the simulated sensor with the reference simulator."),
        "calibrate": ("calibrate.verbs:app", "Calibrate a sensor, and keep its bundles."),
        "config": ("config:app", "Show the settings, their schema, and the files they are read from."),
        "simulate": ("simulate:app", "Press objects into the simulated gel, as files."),
        "ring": ("ring:app", "The light ring by hand."),
        "firmware": ("firmware:app", "The firmware of the light ring: what it is, build it, flash it."),
        "sim": (
            "simulated_board:command",
            "Run a simulated board behind a pseudo-terminal.",
        ),
    },
    ELSEWHERE,
)

app = typer.Typer(
    name="gellight",
    cls=VERBS,
    rich_markup_mode=MARKUP,
    epilog="\n\n".join(["Exit status:", *(f"{status}: {meaning}" for status, meaning in MEANINGS.items())]),
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
