"""`gellight calibrate fit` and `evaluate`: train GelNet, and measure what it is worth."""

from pathlib import Path
from typing import Annotated

import typer

from gellight.cli.calibrate.training_options import Labels, Recorded, SizedTraining, training_option
from gellight.cli.options import AsJson, Calibration, NewBundle, rare_option, with_options

LARGEST_ERROR_DEG = 14.0
"""mean of the normals: real sensors say up to 11.2 with all presses and 12.7 of two, wrong labels 15.2 and more; half
way between, as all sets but one would choose it (docs/figures.md)"""


@with_options
def fit(
    recorded: Recorded,
    bundle: NewBundle,
    how: SizedTraining,
    sensor: Annotated[str, rare_option(help="serial number or name of the sensor")] = "unnamed",
    view: Annotated[Path | None, rare_option(help="view.json that `calibrate view` wrote with these images")] = None,
    largest_normal_error_deg: Annotated[
        float, rare_option(min=0, help="exit with 1 where the mean error of the normals is beyond, degrees")
    ] = LARGEST_ERROR_DEG,
    keep: Annotated[
        bool,
        training_option("--keep", help="learn also from presses whose label the others and its picture contradict"),
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Train on presses of a ball, and write a calibration bundle.

    Presses whose circle is contradicted, by the other presses and its picture, are named and left out. The exit status
    is 1 where presses that were kept apart say that the bundle is no good; it is written all the same.
    """
    from gellight.cli.running import training  # not for the help, as below

    training.fit(recorded, bundle, how, sensor=sensor, view=view, largest_deg=largest_normal_error_deg, keep=keep,
                 as_json=as_json)  # fmt: skip


def evaluate(
    presses: Labels,
    calibration: Calibration,
    ball_radius_mm: Annotated[
        float | None, typer.Option(help="radius of the pressed ball, mm; as in the bundle where not given")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Measure the error of a bundle on labelled presses.

    It is the angle between the normals inside the contact circles. The size of the ball that the bundle feels is
    measured too.
    """
    from gellight.cli.running import training

    training.evaluate(presses, calibration, ball_radius_mm, as_json)
