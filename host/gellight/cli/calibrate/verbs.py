"""`gellight calibrate`: its verbs; without one it is the guided routine."""

from typing import Annotated

import typer

from gellight.cli.calibrate.routine_options import Presses, Target, Tools
from gellight.cli.calibrate.training_options import Training
from gellight.cli.lazy import lazy_group
from gellight.cli.options import AsJson, with_options


@with_options
def command(
    context: typer.Context,
    target: Target,
    tools: Tools,
    wanted: Presses,
    how: Training,
    auto: Annotated[bool, typer.Option("--auto", help="A virtual hand presses: with --sensor sim://.")] = False,
    as_json: AsJson = False,
) -> None:
    """Calibrate a sensor, and keep its bundles.

    Without a verb you are guided step by step, or with --auto a virtual hand presses. The verbs work on recorded
    images and on bundles.
    """
    if context.invoked_subcommand:
        return
    from gellight.cli.calibrate.guided import calibrate  # not for the help

    calibrate(target, tools, wanted, how, auto=auto, as_json=as_json)


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
        "lens": ("calibrate.optics:lens", "Measure the distortion of the lens and write the bundle with it."),
        "lights": ("calibrate.optics:lights", "Measure the light of each LED on the untouched gel."),
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
        "directions": "is part of `channels`, whose bundle has the lights: `reconstruct --least-squares` uses them",
        "starter": "is no more: `fit --like` begins with the presses of another unit",
        "synthetic": "is `python -m tests.helpers.simulated_bundle` in a checkout now",
    },
)
app = typer.Typer(cls=VERBS)
app.callback(invoke_without_command=True)(command)
