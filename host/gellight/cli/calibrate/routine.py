"""`gellight calibrate` itself: the guided routine in the terminal, and by itself on the simulated sensor."""

from typing import Annotated

import typer

from gellight.cli.calibrate.routine_options import Presses, Target, Tools
from gellight.cli.calibrate.training_options import Training
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
