"""`gellight optimize`: the best illumination for a sensor, with the reasons, the pictures and the parts."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeVar

import typer

from gellight.cli.options import AsJson, check_out, with_options
from gellight.cli.showing import show
from gellight_design.boards.catalogue import CARRIERS, LAMPS
from gellight_design.cli.sweeping import GeometryFile, Workers, many, simulation_option
from gellight_design.simulating.choices import RESOLUTION_MM, GelKind

if TYPE_CHECKING:
    from gellight_design.studies import StudySetup
    from gellight_design.sweep import Study as ToRun

ResultT = TypeVar("ResultT")
app = typer.Typer(help="Find the best illumination and make its parts.", no_args_is_help=True)

OutFolder = Annotated[Path | None, typer.Option("--out", metavar="DIR", help="Write results and figures here.")]
Package = Annotated[str, typer.Option("--package", help=f"Package of the LEDs: {', '.join(LAMPS)}.")]
Size = Annotated[int, simulation_option("--size", min=32, max=2048, help="Pixels a side of the evaluated square.")]


@dataclass(frozen=True)
class OutputOptions:
    """Where the answer of a study goes."""

    out: OutFolder = None
    as_json: AsJson = False

    def answer(self, name: str, answer: Mapping[str, Any], text: str, files: Mapping[str, bytes | str]) -> None:
        """Write the answer and `files` to the folder, if there is one, and print it as JSON or as text."""
        from gellight_design import output  # this and what is below: not for the help, a second

        if self.out is not None:
            output.write_all(self.out, {f"{name}.json": json.dumps(answer, indent=2), **files})
        show(answer, self.as_json, text)


@dataclass(frozen=True)
class Study(OutputOptions):
    """The options that all studies share."""

    geometry: GeometryFile = None
    press: Annotated[float, simulation_option("--press", help="How deep the objects are pressed, mm.")] = 0.9
    relief: Annotated[float, simulation_option("--relief", help="Relief of the objects, mm.")] = 1.0
    noise: Annotated[float, simulation_option("--noise", min=0, max=100, help="Noise of the camera, grey levels.")] = (
        1.0
    )
    size: Size = 256
    gel: Annotated[
        GelKind, simulation_option("--gel", help="Elastic layer, or finite elements: a minute for each press, once.")
    ] = "layer"
    resolution: Annotated[float, simulation_option("--resolution-mm", min=0.001, help="Of the finite elements.")] = (
        RESOLUTION_MM
    )
    workers: Workers = 0

    def setup(self) -> "StudySetup":
        """Return what is studied; raises ConfigError or InputError for what cannot be, or cannot be written."""
        from gellight_design import output
        from gellight_design.simulating.gel_models import check_memory
        from gellight_design.simulating.geometry_file import read_geometry
        from gellight_design.simulating.processes import available_cores
        from gellight_design.studies import study_setup

        if self.out is not None:
            output.check_writable(self.out)
        sensor = read_geometry(self.geometry, as_built=False)
        if self.gel == "fem":
            check_memory(self.resolution, sensor, self.workers or available_cores())
        setup = study_setup(sensor, self.press, self.relief, self.size, self.noise)
        return replace(setup, gel=self.gel, resolution_mm=self.resolution)

    def run(self, title: str, study: "ToRun[ResultT]") -> "ResultT":
        """Return the result of a study."""
        from gellight_design.simulating.processes import available_cores
        from gellight_design.sweep import kept_in, run_study

        with many(title, kept_in()) as tell:
            return run_study(study, self.workers or available_cores(), tell)


@app.command()
@with_options
def coarse(study: Study) -> None:
    """Number of lights and incident angle: 77 light groups on the ten objects."""
    from gellight_design import output, studies
    from sim_reference.optimizer.exposing import LightGroups

    setup = study.setup()
    result = study.run("light groups", studies.coarse_study(setup, setup.with_noise(LightGroups())))
    study.answer("coarse", output.coarse_json(result), output.coarse_text(result), output.coarse_charts(result))


@app.command()
@with_options
def fine(
    answering: OutputOptions,
    geometry: GeometryFile = None,
    diameter: Annotated[float, typer.Option("--diameter-mm", min=1, help="Of the disc that is judged.")] = 35.0,
    gamma: Annotated[float, typer.Option("--gamma", min=1, max=3, help="Of the camera's picture; 1: linear.")] = 1.0,
) -> None:
    """Mounting height, as the paper has it: how even and how coloured the gel is lit (equations 6 and 7)."""
    from gellight_design import output
    from gellight_design.simulating.geometry_file import read_geometry

    result = output.fine_study(read_geometry(geometry, as_built=False), diameter, gamma)
    answering.answer(
        "fine", output.fine_json(result), output.fine_text(result), {"fine.svg": output.fine_chart(result)}
    )


@app.command()
@with_options
def design(
    study: Study,
    lights: Annotated[
        list[int] | None, typer.Option("--lights", help="A number of LEDs; may be repeated.", show_default="12")
    ] = None,
    one_shot: Annotated[bool, typer.Option("--one-shot", help="Reconstruct from one exposure in colour.")] = False,
    exposure_limit: Annotated[
        float, typer.Option("--exposure-limit", min=0.01, help="Longest exposure, in those of the given sensor.")
    ] = 1.0,
) -> None:
    """Angle, height, number of LEDs and exposure at once, by the error; with --out, the sensor as gellight.toml."""
    from gellight_design import designs
    from gellight_design.simulating.geometry_file import design_file

    setup = study.setup()
    sensor, numbers = setup.geometry, tuple(lights or (12,))
    requirements = designs.requirements(
        numbers, sensor, one_shot=one_shot, noise_grey=study.noise, exposure_limit=exposure_limit
    )
    result = study.run("designs", designs.full_design_study(setup, requirements))
    files = {"gellight.toml": design_file(designs.designed(result.chosen, sensor))}
    study.answer("design", designs.design_json(result, sensor), designs.design_text(result, sensor), files)


@app.command()
@with_options
def ball(
    answering: OutputOptions,
    geometry: GeometryFile = None,
    press: Annotated[float, typer.Option("--press", help="How deep the ball is pressed, mm.")] = 2.0,
    radius: Annotated[
        list[float] | None, typer.Option("--radius", help="A ball at hand, mm; may be repeated.", show_default="2 to 8")
    ] = None,
) -> None:
    """Calibration ball: which radius and press record slopes of 60 degrees."""
    from gellight_design import output
    from gellight_design.simulating.geometry_file import read_geometry

    result = output.ball_study(read_geometry(geometry, as_built=False), press, radius)
    charts = {"ball.svg": output.ball_chart(result)}
    answering.answer("ball", output.ball_json(result), output.ball_text(result.choice), charts)


@app.command()
def make(
    kind: Annotated[
        Literal["boards", "housing", "benchmark"],
        typer.Argument(help="Circuit boards to order; a housing and its mould; the ten objects."),
    ],
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Write the files here.")],
    geometry: GeometryFile = None,
    board: Annotated[str, typer.Option("--board", help=f"Controller on the carrier: {', '.join(CARRIERS)}.")] = "pico",
    package: Package = "5050",
    lens: Annotated[
        float,
        typer.Option(
            "--lens-mm", min=3, max=100, help="Of the housing: from the lens's entrance pupil to behind the board."
        ),
    ] = 15.0,
) -> None:
    """Make parts: boards to order, a housing to print (STL, STEP), the objects as height maps and solids to print."""
    from gellight_design import output
    from gellight_design.simulating.geometry_file import read_geometry

    check_out(out / "any", overwrite=True)
    sensor = read_geometry(geometry, as_built=False)
    if kind == "boards":
        from gellight_design.boards.files import board_files

        files = board_files(sensor, board, package)
    elif kind == "housing":
        from gellight_design.housing.parts import housing_files

        files = housing_files(sensor, package, lens)
    else:
        from gellight_design.benchmark_files import benchmark_files

        files = benchmark_files()
    for path in output.write_all(out, files):
        typer.echo(path)
