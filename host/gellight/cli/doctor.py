"""`gellight doctor`: what stands between a sensor and good frames, each finding with its remedy."""

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from gellight.sensor.findings import Finding


def command(
    sensor: Annotated[
        str | None, typer.Argument(help="Serial number, USB port, or /dev/video0.", show_default="every sensor")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Check computer, USB, camera, light ring and frames; exits with 1 when something prevents use."""
    from gellight.sensor.connection import Surroundings
    from gellight.sensor.doctor import examine
    from gellight.sensor.findings import Level
    from gellight.sensor.v4l2.kernel import LINUX

    findings = []
    for finding in examine(sensor, surroundings=Surroundings(kernel=LINUX), folder=Path.cwd()):
        findings.append(finding)
        if not as_json:
            print(line(finding), flush=True)
    if as_json:
        print(json.dumps({"findings": [finding.as_json() for finding in findings]}))
    if any(finding.level is Level.PROBLEM for finding in findings):
        raise typer.Exit(1)


def line(finding: "Finding") -> str:
    """Return one finding for people, its remedy below it."""
    text = f"{finding.level:8} {finding.check:11} {finding.text}"
    return text + (f"\n{'':21}-> {finding.remedy}" if finding.remedy else "")
