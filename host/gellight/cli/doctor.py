"""`gellight doctor`: what stands between a sensor and good frames, each finding with its remedy."""

from collections.abc import Iterator
from pathlib import Path
from typing import Annotated

import typer

from gellight.cli.ending import Ending
from gellight.cli.options import AsJson
from gellight.cli.showing import show
from gellight.sensor.findings import Finding, Level


def command(
    sensor: Annotated[
        str | None, typer.Argument(help="URL, serial number, USB port, or /dev/video0.", show_default="every sensor")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Check computer, USB, camera, ring, frames and training.

    The exit status is 1 when something prevents use.
    """
    findings = []
    for finding in _findings(sensor):
        findings.append(finding)
        if not as_json:
            print(line(finding), flush=True)
    if as_json:
        show({"findings": findings}, as_json)
    if any(finding.level is Level.PROBLEM for finding in findings):
        raise typer.Exit(Ending.JUDGED_BAD)


def _findings(sensor: str | None) -> Iterator[Finding]:
    from gellight.lab.doctor.examination import examine  # not for the help: a second
    from gellight.lab.training.training import check_trainer
    from gellight.sensor.connection import Surroundings
    from gellight.sensor.v4l2.errors import LINUX

    yield from examine(sensor, surroundings=Surroundings(kernel=LINUX), folder=Path.cwd())
    yield check_trainer()


def line(finding: Finding) -> str:
    """Return one finding for people, its remedy below it."""
    text = f"{finding.level:8} {finding.check:11} {finding.text}"
    return text + (f"\n{'':21}-> {finding.remedy}" if finding.remedy else "")
