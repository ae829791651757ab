"""`gellight calibrate`: its verbs; without one it is the guided routine."""

import typer

from gellight.cli.calibrate import routine
from gellight.cli.lazy import lazy_group

VERBS = lazy_group(
    {
        "detect": (
            "calibrate.detect:command",
            "Find the contact circle of each ball in pictures of presses.",
        ),
        "view": ("calibrate.view:command", "Take the view of the gel out of pictures, and write it."),
        "fit": ("calibrate.training:fit", "Train on presses of a ball, and write a calibration bundle."),
        "evaluate": ("calibrate.training:evaluate", "Measure the error of a bundle on labelled presses."),
        "adapt": ("calibrate.adapt:command", "Adapt a bundle to light that has changed, without a press."),
        "lens": ("calibrate.lens:command", "Measure the distortion of the lens and write the bundle with it."),
        "lights": ("calibrate.lights:command", "Measure the light of each LED on the untouched gel."),
        "directions": ("calibrate.directions:command", "Find the direction of each light on balls of known radius."),
        "channels": (
            "calibrate.channels:command",
            "Train GelNet on balls under three or more lights, a channel for each.",
        ),
        "force": ("calibrate.force:command", "Find what turns depth into newtons, with weights or a load cell."),
        "list": (
            "calibrate.bundles:list_bundles",
            "Show the bundles kept on this computer; an asterisk marks those in service.",
        ),
        "install": (
            "calibrate.bundles:install_bundle",
            "Put a bundle that passed its verification into service; the board of the sensor remembers it.",
        ),
        "restore": (
            "calibrate.bundles:restore_bundle",
            "Put an earlier bundle of the sensor into service again; its board remembers it.",
        ),
    },
    gone={
        "starter": "is no more: `fit --like` begins with the presses of another unit",
        "synthetic": "is `python -m tests.helpers.simulated_bundle` in a checkout now",
    },
)
app = typer.Typer(cls=VERBS)
app.callback(invoke_without_command=True)(routine.command)
