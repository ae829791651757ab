"""`gellight simulate`: what the simulator computes, as files."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from gellight.base.errors import InputError
from gellight.cli.lazy import MARKUP
from gellight.cli.options import AsJson, Overwrite, check_out
from gellight.cli.showing import progress, show
from gellight_design.cli.sweeping import GeometryFile, Workers, many, simulation_option
from gellight_design.simulating.choices import GelKind, LightKind

if TYPE_CHECKING:
    from sim_reference.fem.newton import Step

TAKES = "about a minute by finite elements 0.3 mm apart, longer with finer ones"
app = typer.Typer(rich_markup_mode=MARKUP, no_args_is_help=True)
Gel = Annotated[GelKind, simulation_option("--gel", help="Elastic layer, or finite elements.")]
Resolution = Annotated[float, simulation_option("--resolution-mm", min=0.05, help="Of the finite elements.")]
Noise = Annotated[float, simulation_option("--noise", min=0, max=50, help="Noise of the camera, grey levels.")]
Seed = Annotated[int, simulation_option("--seed", min=0, help="Other noise, and other presses of a data set.")]


@app.callback()
def simulate() -> None:
    """Press objects into the simulated gel, as files."""


@app.command()
def press(
    object_name: Annotated[str, typer.Option("--object", help="An object of the simulator, or a closed .stl in mm.")],
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Write surface, pressure and report here.")],
    depth: Annotated[float | None, typer.Option("--depth-mm", help="How deep, mm.")] = None,
    force: Annotated[float | None, typer.Option("--force-n", help="With which force, N, instead of a depth.")] = None,
    gel: Gel = "fem",
    resolution: Annotated[
        float, simulation_option("--resolution-mm", min=0.001, help="Between vertices of the surface.")
    ] = 0.3,
    friction: Annotated[
        float, simulation_option("--friction", min=0, max=2, help="Coefficient; in finite elements, to a depth.")
    ] = 0.0,
    geometry: GeometryFile = None,
    overwrite: Overwrite = False,
    as_json: AsJson = False,
) -> None:
    """Press one object into the gel, to a depth or with a force."""
    from gellight_design.simulating.geometry_file import (
        read_geometry,  # this and what is below: not for the help, a second
    )
    from gellight_design.simulating.one_press import PressRequest, press_once

    if (depth is None) == (force is None):
        raise InputError("give --depth-mm or --force-n, one of the two")
    check_out(out / "press.npz", overwrite)
    request = PressRequest(object_name=object_name, depth_mm=depth, force_n=force, gel=gel, resolution_mm=resolution,
                     friction=friction)  # fmt: skip
    with progress(request.object_name, TAKES if request.gel == "fem" else "") as tell:
        report = press_once(request, out, read_geometry(geometry), lambda step: tell(None, None, in_words(step)))
    show(report, as_json)


@app.command()
def dataset(
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Write the data set here, or go on with it.")],
    presses: Annotated[int, typer.Option("--presses", min=1, max=1_000_000, help="How many presses in all.")] = 100,
    objects: Annotated[
        list[str] | None, typer.Option("--object", help="An object; may be repeated.", show_default="all")
    ] = None,
    shallowest: Annotated[float, simulation_option("--shallowest-mm", help="Least depth of a press.")] = 0.2,
    deepest: Annotated[float, simulation_option("--deepest-mm", help="Largest depth of a press.")] = 1.0,
    light: Annotated[LightKind, typer.Option("--light", help="One picture a press, or one a LED.")] = "ring",
    gel: Gel = "layer",
    resolution: Resolution = 0.3,
    noise: Noise = 1.0,
    seed: Seed = 0,
    geometry: GeometryFile = None,
    workers: Workers = 0,
    as_json: AsJson = False,
) -> None:
    """Press many objects: images, depth, normals, pressure and force, for training other networks.

    The same command goes on where it was interrupted; with more --presses it adds to what is there.
    """
    from gellight_design.simulating.dataset import DatasetRequest, make_dataset
    from gellight_design.simulating.geometry_file import read_geometry
    from gellight_design.simulating.processes import available_cores
    from sim_reference.objects import OBJECT_NAMES

    request = DatasetRequest(
        presses=presses,
        objects=tuple(name.upper() for name in objects or OBJECT_NAMES),
        shallowest_mm=shallowest,
        deepest_mm=deepest,
        light=light,
        gel=gel,
        resolution_mm=resolution,
        noise_grey=noise,
        seed=seed,
        geometry=read_geometry(geometry),
    )
    with many("presses", out) as tell:
        report = make_dataset(request, out, workers or available_cores(), tell)
    show(report, as_json, f"{report.presses} presses, {report.megabytes:.1f} MB, in {report.folder}: see its index.csv")


@app.command()
def sequence(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="What moves how: JSON, see docs/tracking.md.")],
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Write the pictures and the true poses here.")],
    gel: Gel = "layer",
    resolution: Resolution = 0.3,
    noise: Noise = 1.0,
    seed: Seed = 0,
    geometry: GeometryFile = None,
    overwrite: Overwrite = False,
    as_json: AsJson = False,
) -> None:
    """Move one object through the gel as a file says: a picture a step, and poses.csv with the true pose of each."""
    from gellight.lab.simulator.sequence import read_sequence
    from gellight_design.simulating.geometry_file import read_geometry
    from gellight_design.simulating.written_sequence import write_sequence

    check_out(out / "poses.csv", overwrite)
    sensor = read_geometry(geometry)
    report = write_sequence(
        read_sequence(file, sensor), out, sensor, gel=gel, resolution_mm=resolution, noise_grey=noise, seed=seed
    )
    show(report, as_json, f"{report.frames} pictures and poses.csv are in {report.folder}")


def in_words(step: "Step") -> str:
    """Return how Newton's iteration goes, for people."""
    figures = f"gap {step.min_gap_mm * 1e3:.1f} um, det F {step.min_det_f:.2f}"
    return f"step {step.number}, {step.longest_mm:.1e} mm, {figures}"
