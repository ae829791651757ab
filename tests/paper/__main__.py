"""`python -m tests.paper`: the paper's statements about light, judged by the numbers."""

from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from gellight.cli.ending import end
from gellight.cli.optimize import Study
from gellight.cli.options import with_options
from gellight.cli.showing import show
from gellight.lab.design import output
from gellight.lab.simulator.memory import check_memory
from gellight.lab.simulator.sweep import available_cores, run_study
from sim_reference.optimizer.exposing import LightGroups
from tests.paper import heights, report
from tests.paper.all_studies import run_all_studies
from tests.paper.gel_comparison import resolution_of
from tests.paper.timing import time_sweep

app = typer.Typer(help="Judge the statements of the paper by the numbers.", no_args_is_help=True)


@app.command("report")
@with_options
def write_report(
    study: Study,
    timed: Annotated[bool, typer.Option("--timing/--no-timing", help="Also time the sweep against plain code.")] = True,
    gels: Annotated[
        bool,
        typer.Option("--gel-table/--no-gel-table", help="Also the layer against finite elements: ten minutes, once."),
    ] = True,
) -> None:
    """All studies on one page that holds everything, beside the statements of the paper.

    It is written to --out, by default to the folder gellight-optimize.
    """
    folder = study.out or Path("gellight-optimize")
    output.check_writable(folder)
    setup = study.setup()
    if gels and study.scheduler is None:
        check_memory(resolution_of(setup), setup.geometry, study.workers or available_cores())
    with study.sweep("studies") as options:
        results = run_all_studies(setup, options, timed=timed, gels=gels)
        path = report.write_report(results, folder)
    study.answer("report", report.report_json(results, path), report.report_text(results, path), {})


@app.command()
@with_options
def fine(
    study: Study, step: Annotated[float, typer.Option("--step", min=0.5, max=18, help="Between the heights, mm.")] = 4.0
) -> None:
    """Mounting height: uniformity, saturation and the error of reconstruction from 0 to 36 mm."""
    setup = study.setup()
    # 0 to 36 mm as in the paper, or less where the gel is nearer to the camera.
    highest = min(36.0, 0.9 * setup.geometry.camera_height_mm)
    steps = tuple(step * at for at in range(int(highest / step) + 1))
    with study.sweep("heights") as options:
        result = run_study(heights.fine_study(setup, steps), options)
    study.answer("fine", heights.fine_json(result), heights.fine_text(result), heights.fine_charts(result))


@app.command()
@with_options
def timing(study: Study) -> None:
    """Time the coarse sweep against plain code that computes one configuration at a time."""
    with study.sweep("timing") as options:
        times = time_sweep(study.setup(), options, LightGroups())
    show({**asdict(times), "ratio": times.ratio}, study.as_json, times.in_words())


if __name__ == "__main__":
    end(app)
