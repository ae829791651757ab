"""`gellight bench`: the figures of the README, measured on this machine."""

import json
from collections.abc import Sequence
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from gellight.bundle.bundle import load_bundle
from gellight.cli.options import AsJson
from gellight.frames.image_files import read_image
from gellight.lab.evaluation import bench
from gellight.lab.evaluation.bench import DepthScale
from gellight.lab.evaluation.frame_bench import FrameTimes, frame_times
from gellight.lab.evaluation.simulated_presses import Figures, compare_ways
from gellight.lab.evaluation.synthetic import DEPTHS_MM, SimulatedError, evaluate_simulated


class Subject(StrEnum):
    """What is measured."""

    FRAMES = "frames"
    INTEGRATOR = "integrator"
    PRESSES = "presses"
    PHOTOMETRIC = "photometric"


def command(
    subject: Annotated[
        Subject, typer.Argument(help="frames: time; integrator: depth scale; presses, photometric: accuracy.")
    ] = Subject.FRAMES,
    calibration: Annotated[str, typer.Option(help="Bundle whose network is timed.")] = "synthetic",
    rounds: Annotated[int, typer.Option(min=3, help="Frames and plain runs, alternating.")] = 15,
    threads: Annotated[int, typer.Option(min=1, help="Threads of the network, both ways.")] = 1,
    press: Annotated[Path | None, typer.Option(help="Picture of a press, timed too.")] = None,
    untouched: Annotated[
        Path | None, typer.Option(help="The same gel untouched, where that is not the gel of the bundle; any size.")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Time the frame path, or measure depth scale or accuracy.

    `frames` times its stages, and the whole against its other forms and against a plain run of its network.
    `presses` presses the 4 mm ball 1, 1.5 and 2 mm deep at 20 random places of the simulated sensor, with noise of 1
    grey level.
    `photometric` compares GelNet with photometric stereo on other such presses, and on the ten benchmark objects.
    """
    if subject is Subject.INTEGRATOR:
        scales = bench.depth_scales()
        typer.echo(json.dumps(bench.as_rows(scales), indent=2) if as_json else _scale_table(scales))
        return
    bundle = load_bundle(calibration)
    if subject is Subject.PRESSES:
        errors = [evaluate_simulated(bundle, depth_mm=depth) for depth in DEPTHS_MM]
        typer.echo(json.dumps(bench.as_rows(errors), indent=2) if as_json else _press_table(errors))
    elif subject is Subject.PHOTOMETRIC:
        ways = compare_ways(bundle)
        typer.echo(json.dumps(bench.as_rows(ways), indent=2) if as_json else _way_table(ways))
    else:
        pictures = [read_image(path) if path else None for path in (press, untouched)]
        times = frame_times(bundle, rounds=rounds, threads=threads, press=pictures[0], untouched=pictures[1])
        typer.echo(json.dumps(bench.as_rows(times), indent=2) if as_json else _time_table(times))


def _time_table(times: Sequence[FrameTimes]) -> str:
    lines = []
    for t in times:
        size = f"{t.image_width_px} x {t.image_height_px}"
        lines.append(
            f"{t.scene}, {size} px, {t.touched:.1%} touched, {t.single:.1%} pixel by pixel, {t.computed_by}; "
            "ms: CPU, wall"
        )
        rows = [*t.stages.items(), ("whole frame", t.whole), *t.others.items()]
        for name, ms in rows:
            ratio = f"{t.ratios[name]:9.1f} x the whole frame" if name in t.ratios else ""
            lines.append(f"  {name:26}{ms.cpu_ms:9.2f}{ms.wall_ms:9.2f}{ratio}")
        shares = ", ".join(f"{name} {share:.0%}" for name, share in t.peak_fraction.items())
        lines.append(f"  of what one core can do: {shares}")
    return "\n".join(lines)


def _press_table(errors: Sequence[SimulatedError]) -> str:
    """Return a line a figure and a column a depth."""
    columns = bench.as_rows(errors)
    return "\n".join(f"{name:26}" + "".join(f"{column[name]:10.4g}" for column in columns) for name in columns[0])


def _way_table(ways: Sequence[Figures]) -> str:
    columns = ("exposure", "contact, deg", "all, deg", "x GelNet's", "depth, mm")
    lines = [f"{'errors':24}" + "".join(f"{name:>14}" for name in columns)]
    for w in ways:
        if w.exposures == 1:
            lines.append(f"{w.presses} presses, {w.objects}")
        figures = (w.contact_normal_deg, w.normal_deg, w.over_network)
        row = "".join(f"{value:14.3f}" for value in figures)
        lines.append(f"  {w.way:22}{w.exposure_us / 1e3:11.1f} ms{row}{w.contact_depth_mm:14.4f}")
    return "\n".join(lines)


def _scale_table(scales: Sequence[DepthScale]) -> str:
    lines = ["image        surface      size px  place       scale   +-      largest error"]
    for s in scales:
        size = f"{s.image_width_px} x {s.image_height_px}"
        lines.append(
            f"{size:11}  {s.surface:11}  {s.size_px:7g}  {s.place:10}  {s.scale:.4f}  {s.scale_spread:.4f}  "
            f"{s.largest_error:.2%}"
        )
    return "\n".join(lines)
