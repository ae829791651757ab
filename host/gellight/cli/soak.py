"""`gellight soak`: hours of faults on a simulated sensor."""

import json
import logging
from dataclasses import asdict
from typing import Annotated

import typer

from gellight.cli.options import AsJson
from gellight.soak.run import Report, soak


def command(
    hours: Annotated[float, typer.Option(min=0.01, max=1000.0, help="Simulated hours.")] = 8.0,
    faults: Annotated[int, typer.Option(min=0, metavar="SEED", help="Seed that the faults are drawn from.")] = 1,
    as_json: AsJson = False,
) -> None:
    """Run a simulated sensor through hours of faults, and check what it gives.

    About a fault a simulated minute; quiet time between them is cut short. Exit status 1 where something did not hold.
    """
    logging.getLogger("gellight").setLevel(logging.CRITICAL)  # faults are what is made here
    report = soak(faults, hours, lambda line: typer.echo(line, err=True))
    typer.echo(json.dumps(asdict(report), indent=2) if as_json else table(report))
    if not report.passed:
        raise typer.Exit(1)


def table(report: Report) -> str:
    """Return what was found as lines for people."""
    lines = [
        f"{report.simulated_s / 3600:.2f} simulated hours in {report.wall_s / 60:.1f} min, seed {report.seed}: "
        f"{report.frames} frames, {report.labels} light labels judged ({report.unjudged_labels} not: emulator late)",
        f"memory: {report.memory_growth_mb:+.1f} MB from the third to the last quarter",
        f"{'fault':20}{'count':>6}{'worst recovery':>17}",
    ]
    lines += [f"{kind:20}{one.count:6d}{one.worst_recovery_s:15.2f} s" for kind, one in sorted(report.faults.items())]
    lines += [f"broken after {one.at_s:.1f} s: {one.invariant}: {one.text}" for one in report.violations]
    return "\n".join([*lines, "everything held" if report.passed else f"{len(report.violations)} violations"])
