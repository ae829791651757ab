"""`gellight optimize`: the best illumination for a sensor, with the reasons, the pictures and the parts."""

import json
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from gellight.optimize.studies import Subject
    from gellight.optimize.sweep import Way

app = typer.Typer(help="Find the best illumination and make its parts.", no_args_is_help=True)

GeometryFile = Annotated[
    Path | None,
    typer.Option(
        "--geometry", metavar="FILE", help="Settings file with a section `geometry`.", show_default="the paper"
    ),
]
OutFolder = Annotated[Path | None, typer.Option("--out", metavar="DIR", help="Write results, figures and parts here.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print one JSON object.")]
Press = Annotated[float, typer.Option("--press", help="How deep the objects are pressed, mm.")]
Relief = Annotated[float, typer.Option("--relief", min=0.05, help="Relief of the objects, mm.")]
Noise = Annotated[float, typer.Option("--noise", min=0, help="Noise of the camera, grey levels.")]
Size = Annotated[int, typer.Option("--size", min=32, max=2048, help="Pixels a side of the evaluated square.")]
Workers = Annotated[int, typer.Option("--workers", min=0, help="Processes; 0: one for each core.")]
ShardText = Annotated[str, typer.Option("--shard", metavar="I/N", help="Compute only this part of the sweep.")]
Scheduler = Annotated[str | None, typer.Option("--scheduler", metavar="URL", help="Dask scheduler, tcp://...")]
Keep = Annotated[
    Path | None, typer.Option("--store", metavar="DIR", help="Where results are kept.", show_default="cache")
]


@app.command()
def coarse(
    geometry: GeometryFile = None,
    out: OutFolder = None,
    as_json: AsJson = False,
    press: Press = 0.9,
    relief: Relief = 1.0,
    noise: Noise = 1.0,
    size: Size = 256,
    workers: Workers = 0,
    shard: ShardText = "1/1",
    scheduler: Scheduler = None,
    store: Keep = None,
) -> None:
    """Number of lights and incident angle: 77 light groups on the ten objects."""
    from gellight.optimize import answers, studies
    from sim_reference.optimizer.exposing import LightGroups

    subject = _subject(geometry, press, relief, size)
    with _way("light groups", workers, shard, scheduler, store) as way:
        result = studies.coarse_study(subject, LightGroups(noise_grey=noise), way)
    if result is None:
        _partial(way, as_json)
        return
    answer = answers.coarse_answer(result)
    _answer(answer, as_json, out, "coarse", [answers.coarse_text(result)], answers.coarse_drawings(result))


@app.command()
def fine(
    geometry: GeometryFile = None,
    out: OutFolder = None,
    as_json: AsJson = False,
    press: Press = 0.9,
    relief: Relief = 1.0,
    step: Annotated[float, typer.Option("--step", min=0.5, max=18, help="Between the heights, mm.")] = 4.0,
    size: Size = 256,
    workers: Workers = 0,
    shard: ShardText = "1/1",
    scheduler: Scheduler = None,
    store: Keep = None,
) -> None:
    """Mounting height: uniformity, saturation and the error of reconstruction from 0 to 36 mm."""
    from gellight.optimize import answers, studies

    subject = _subject(geometry, press, relief, size)
    heights = _heights(step, subject)
    with _way("heights", workers, shard, scheduler, store) as way:
        result = studies.fine_study(subject, heights, way)
    if result is None:
        _partial(way, as_json)
        return
    answer = answers.fine_answer(result)
    _answer(answer, as_json, out, "fine", [answers.fine_text(result)], answers.fine_drawings(result))


@app.command()
def ball(
    geometry: GeometryFile = None,
    out: OutFolder = None,
    as_json: AsJson = False,
    press: Annotated[float, typer.Option("--press", help="How deep the ball is pressed, mm.")] = 2.0,
    radius: Annotated[
        list[float] | None, typer.Option("--radius", help="A ball at hand, mm; may be repeated.", show_default="2 to 8")
    ] = None,
) -> None:
    """Calibration ball: which radius and press record slopes of 60 degrees."""
    from gellight.optimize import answers
    from gellight.optimize.geometry import read_geometry

    choice, table = answers.ball_choice(read_geometry(geometry), press, radius)
    answer = answers.ball_answer(choice, table)
    _answer(answer, as_json, out, "ball", [answers.ball_text(choice)], {"ball.svg": answers.ball_drawing(table)})


@app.command()
def design(
    geometry: GeometryFile = None,
    out: OutFolder = None,
    as_json: AsJson = False,
    press: Press = 0.9,
    relief: Relief = 1.0,
    noise: Noise = 1.0,
    lights: Annotated[
        list[int] | None, typer.Option("--lights", help="A number of LEDs; may be repeated.", show_default="12")
    ] = None,
    one_shot: Annotated[bool, typer.Option("--one-shot", help="Reconstruct from one exposure in colour.")] = False,
    exposure_limit: Annotated[
        float, typer.Option("--exposure-limit", min=0.01, help="Longest exposure, in those of the given sensor.")
    ] = 1.0,
    workers: Workers = 0,
    shard: ShardText = "1/1",
    scheduler: Scheduler = None,
    store: Keep = None,
) -> None:
    """Angle, height, number of LEDs and exposure at once, by the error; with --out, the parts to make."""
    from gellight.optimize import answers, studies

    subject = _subject(geometry, press, relief, 256)
    wishes = answers.wishes(tuple(lights or (12,)), one_shot, noise, exposure_limit)
    with _way("designs", workers, shard, scheduler, store) as way:
        candidates = studies.design_study(subject, wishes, way)
    if candidates is None:
        _partial(way, as_json)
        return
    answer = answers.design_answer(candidates, subject.geometry)
    drawings = answers.design_parts(candidates, subject.geometry)
    _answer(answer, as_json, out, "design", [answers.design_text(candidates)], drawings)


@app.command()
def report(
    geometry: GeometryFile = None,
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Write report.html and the parts here.")] = Path(
        "gellight-optimize"
    ),
    size: Size = 256,
    workers: Workers = 0,
    store: Keep = None,
    timed: Annotated[bool, typer.Option("--timing/--no-timing", help="Also time the sweep against plain code.")] = True,
) -> None:
    """All studies on one page that holds everything, beside the statements of the paper."""
    from gellight.optimize import report as page

    subject = _subject(geometry, 0.9, 1.0, size)
    with _way("studies", workers, "1/1", None, store) as way:
        path = page.write_report(subject, way, out, timed=timed)
    typer.echo(path)


@app.command()
def timing(size: Size = 256, workers: Workers = 0, as_json: AsJson = False) -> None:
    """Time the coarse sweep against plain code that computes one configuration at a time."""
    from gellight.optimize.timing import time_sweep
    from sim_reference.optimizer.exposing import LightGroups

    subject = _subject(None, 0.9, 1.0, size)
    with _way("timing", workers, "1/1", None, None) as way:
        times = time_sweep(subject, way, LightGroups())
    typer.echo(json.dumps({**times.__dict__, "ratio": times.ratio}) if as_json else times.in_words())


@app.command()
def benchmark(
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Write the objects here.")],
    relief: Relief = 1.0,
    size: Annotated[int, typer.Option("--size", min=32, max=1024, help="Points a side of the height maps.")] = 512,
) -> None:
    """Write the ten objects as height maps (.npy, mm) and as solids to print (.stl)."""
    from gellight.optimize.solids import write_benchmark

    for path in write_benchmark(out, relief, size):
        typer.echo(path)


def _subject(geometry: Path | None, press: float, relief: float, size: int) -> "Subject":
    from gellight.optimize.answers import subject_of
    from gellight.optimize.geometry import read_geometry

    return subject_of(read_geometry(geometry), press, relief, size)


def _heights(step: float, subject: "Subject") -> tuple[float, ...]:
    """Return 0 to 36 mm as the paper does, or less where the gel is nearer to the camera."""
    highest = min(36.0, 0.9 * subject.geometry.camera_height_mm)
    return tuple(step * at for at in range(int(highest / step) + 1))


@contextmanager
def _way(title: str, workers: int, shard: str, scheduler: str | None, store: Path | None) -> "Iterator[Way]":
    """Yield how to compute, with a progress bar while a person is looking."""
    from rich.console import Console
    from rich.progress import Progress

    from gellight.optimize.store import ResultStore, default_folder
    from gellight.optimize.sweep import Way, available_cores, parse_shard

    with Progress(console=Console(stderr=True), transient=True, disable=not sys.stderr.isatty()) as bar:
        line = bar.add_task(title, total=None)

        def show(done: int, total: int, label: str) -> None:
            bar.update(line, completed=done, total=total, description=f"{title}: {label}")

        yield Way(
            store=ResultStore(store or default_folder()),
            workers=workers or available_cores(),
            shard=parse_shard(shard),
            scheduler=scheduler,
            progress=show,
        )


def _partial(way: "Way", as_json: bool) -> None:
    part = {"shard": f"{way.shard.number}/{way.shard.count}", "complete": False, "store": str(way.store.folder)}
    text = f"shard {part['shard']} is done; the others are still missing in {part['store']}"
    typer.echo(json.dumps(part) if as_json else text)


def _answer(
    answer: dict[str, Any], as_json: bool, out: Path | None, name: str, text: list[str], files: dict[str, bytes | str]
) -> None:
    if out is not None:
        from gellight.optimize.answers import write_all

        write_all(out, {f"{name}.json": json.dumps(answer, indent=2), **files})
    typer.echo(json.dumps(answer) if as_json else "\n".join(text))
