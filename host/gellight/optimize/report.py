"""The report: one page that holds every figure, every table and the comparison with the paper."""

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from importlib.resources import files
from math import degrees
from pathlib import Path
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from gellight.errors import InputError
from gellight.optimize import answers, comparison, gallery, parts, studies
from gellight.optimize.figures import Axes, Series, line_chart
from gellight.optimize.studies import FineResult, Subject
from gellight.optimize.sweep import Way
from gellight.optimize.timing import SweepTimes, time_sweep
from sim_reference.geometry import SensorGeometry
from sim_reference.optimizer import ball, design, fine
from sim_reference.optimizer.coarse import CoarseResult
from sim_reference.optimizer.exposing import LightGroups
from sim_reference.optimizer.sensitivity import Variant

Array = NDArray[np.float64]
T = TypeVar("T")
Sensitivity = list[tuple[Variant, float, float]]


@dataclass(frozen=True, kw_only=True)
class Findings:
    """Everything the page shows."""

    subject: Subject
    coarse: CoarseResult
    fine: FineResult
    balls: tuple[ball.BallChoice, dict[float, Array]]
    beyond: dict[str, Array]
    designs: list[design.Candidate]
    one_shot_designs: list[design.Candidate]
    given: dict[str, design.Candidate]
    bright_designs: list[design.Candidate]
    sensitivity: Sensitivity
    times: SweepTimes | None


def write_report(
    subject: Subject, way: Way, folder: Path, *, timed: bool, numbers: tuple[int, ...] = (6, 9, 12, 15)
) -> Path:
    """Run all studies and write report.html and the parts of the paper's ring and of the chosen one into `folder`.

    `numbers` of LEDs are designed for. Returns the path of the page; raises InputError if it cannot be written.
    """
    found = findings(subject, way, timed=timed, numbers=numbers)
    chosen = answers.designed(_chosen(found.designs, subject), subject.geometry)
    for name, geometry in (("given", subject.geometry), ("chosen", chosen)):
        answers.write_all(folder / name, answers.parts_of(geometry))
    return answers.write_all(folder, {"report.html": page(found)})[0]


def _chosen(designs: list[design.Candidate], subject: Subject) -> design.Candidate:
    """Return the design with as many LEDs as the given sensor, for its firmware drives that many; else the best."""
    same = [one for one in designs if one.number == len(subject.geometry.led_colours)]
    return same[0] if same else design.chosen(designs, "top1")


def findings(subject: Subject, way: Way, *, timed: bool, numbers: tuple[int, ...]) -> Findings:
    """Run all studies; those that the store holds are not run again."""
    groups = LightGroups()
    same = answers.wishes(numbers, one_shot=False, noise_grey=1.0, exposure_limit=1.0)
    middle = (numbers[len(numbers) // 2],)
    one_shot = answers.wishes(middle, one_shot=True, noise_grey=1.0, exposure_limit=1.0)
    bright = answers.wishes(middle, one_shot=False, noise_grey=1.0, exposure_limit=float("inf"))
    return Findings(
        subject=subject,
        coarse=_whole(studies.coarse_study(subject, groups, way)),
        fine=_whole(studies.fine_study(subject, fine.HEIGHTS_MM, way)),
        balls=answers.ball_choice(subject.geometry, 2.0, None),
        beyond=_whole(studies.beyond_study(subject, way)),
        designs=_whole(studies.design_study(subject, same, way)),
        given={
            label: _whole(studies.given_study(subject, wishes, way))
            for label, wishes in (("every LED by itself, shadows dropped", same), ("one exposure in colour", one_shot))
        },
        one_shot_designs=_whole(studies.design_study(subject, one_shot, way)),
        bright_designs=_whole(studies.design_study(subject, bright, way)),
        sensitivity=_whole(studies.sensitivity_study(subject, way)),
        times=time_sweep(subject, way, groups) if timed else None,
    )


def page(found: Findings) -> str:
    """Return the page."""
    sections = [
        _summary(found),
        _statements(found),
        _benchmark(found.subject),
        _coarse(found.coarse),
        _fine(found),
        _ball(found.balls),
        _beyond(found.beyond),
        _designs(found),
        _sensitivity(found.sensitivity),
        _parts(found),
        _times(found.times),
    ]
    style = files("gellight.optimize").joinpath("report.css").read_text()
    return (
        '<!doctype html><html lang="en"><meta charset="utf-8"><meta name="viewport" content="width=device-width">'
        f"<title>GelLight: illumination</title><style>{style}</style><main><h1>Illumination of a tactile sensor</h1>"
        + "".join(sections)
        + "</main></html>\n"
    )


def _summary(found: Findings) -> str:
    best = _chosen(found.designs, found.subject)
    plain, dropped = (found.beyond[name][:, 2].min() for name in ("least squares", "shadows dropped"))
    tiles = [
        (f"{degrees(found.coarse.best_angle_rad()):.0f}°", "best incident angle of the averaged benchmark; paper: 29°"),
        (f"{degrees(found.coarse.mean_best_angle_rad()):.1f}°", "mean of the objects' best angles; paper: 32.2°"),
        (f"{1 - dropped / plain:.0%}", "lower Top1 when shadowed observations are dropped"),
        (f"{_four_over_one(found.beyond):.1f}×", "lower Top1 with four exposures than with one, at 29°"),
        (
            f"{best.number} LEDs",
            f"chosen: tilt {degrees(best.incident_angle_rad):.0f}°, height {best.mounting_height_mm:.1f} mm, Top1 "
            f"{degrees(best.top1_rad):.2f}°",
        ),
    ]
    body = "".join(f"<div><b>{value}</b><span>{escape(label)}</span></div>" for value, label in tiles)
    return f'<section class="tiles">{body}</section>'


def _four_over_one(beyond: dict[str, Array]) -> float:
    four = next(name for name in beyond if name.endswith("exposures"))
    return float(beyond["one exposure"][0, 2] / beyond[four][0, 2])


def _statements(found: Findings) -> str:
    rows = [
        *comparison.coarse_statements(found.coarse),
        *comparison.fine_statements(found.fine, found.subject.geometry),
        *comparison.ball_statements(),
    ]
    held = sum(row.reproduced for row in rows)
    body = "".join(
        f'<tr class="{"yes" if row.reproduced else "no"}"><td>{row.section}<td>{escape(row.claim)}'
        f"<td>{escape(row.measured)}<td>{'reproduced' if row.reproduced else 'not reproduced'}"
        f"<td>{escape(row.why)}"
        for row in rows
    )
    head = "<tr><th>section<th>the paper says<th>measured here<th>verdict<th>why"
    return _section(
        "The paper, line by line",
        f"<p>{held} of {len(rows)} statements are reproduced. The numbers decide, not the author of this page.</p>"
        f'<div class="wide"><table class="statements">{head}{body}</table></div>',
    )


def _benchmark(subject: Subject) -> str:
    return _section(
        "The benchmark",
        f"<p>Ten objects in four groups, relief {subject.parameters.relief_mm:g} mm, pressed "
        f"{subject.sampling.press_depth_mm:g} mm into the gel; the angle is the slope that 0.3 % of the surface "
        "exceeds. Below, the same presses under the coloured ring (figure 4d).</p>"
        f'<div class="pictures">{gallery.benchmark_depths(subject)}</div>'
        f'<div class="pictures">{gallery.benchmark_pictures(subject)}</div>',
    )


def _coarse(result: CoarseResult) -> str:
    best = "".join(f"<tr><td>{name}<td>{degrees(angle):.0f}°" for name, angle in result.best_angles_rad().items())
    three = "".join(answers.top1_map(result, "SCROWN", figure) for figure in range(3))
    maps = "".join(answers.top1_map(result, name) for name in result.names)
    curves = "".join(_card(answers.top1_curves(result, name)) for name in (None, *result.names))
    means = result.map_mean_by_number()
    ratio = Series("mean of the map", list(means), list(means.values()))
    axes = Axes(title="Map mean relative to 12 lights", x="number of lights", y="relative Top1")
    return _section(
        "Coarse stage: number of lights and incident angle",
        "<p>Parallel light with attached and cast shadows, 8 bit, noise of one grey level. Rows are numbers of lights, "
        "columns incident angles; framed is the best of each row. Figure 3a, then figure 4a:</p>"
        f'<div class="figures">{three}</div><div class="figures">{maps}</div>'
        "<h3>Figure 4b: Top1 against the incident angle, one curve a number of lights</h3>"
        f'<div class="figures">{curves}{_card(line_chart([ratio], axes))}'
        f"<table><tr><th>object<th>best angle, 12 lights{best}</table></div>",
    )


def _fine(found: Findings) -> str:
    geometry = found.subject.geometry
    light, error = answers.fine_charts(found.fine)
    rows = "".join(
        f"<tr><td>{escape(label)}<td>{'never' if np.isnan(height) else f'{height:.1f} mm'}<td>{at_20:.0%}"
        for label, height, at_20 in comparison.saturation_table(geometry)
    )
    return _section(
        "Fine stage: mounting height",
        "<p>Spot lights near the gel; the plane at each height with the same lamps (figure 4e) and each channel at "
        f"{geometry.mounting_height_mm:g} mm with lines of equal brightness (figure 4c).</p>"
        f'<div class="pictures">{gallery.plane_pictures(found.subject, found.fine.heights_mm)}</div>'
        f'<div class="pictures">{gallery.channel_pictures(found.subject)}</div>'
        f'<div class="figures">{_card(light)}{_card(error)}'
        f"<table><tr><th>view and camera<th>SAT = 50 % at<th>SAT at 20 mm{rows}</table></div>",
    )


def _ball(balls: tuple[ball.BallChoice, dict[float, Array]]) -> str:
    choice, curves = balls
    return _section(
        "Calibration ball",
        f"<p>{escape(answers.ball_text(choice))}. The largest ball that records 60° has the sharpest edge in the image."
        f'</p><div class="figures">{_card(answers.ball_chart(curves))}</div>',
    )


def _beyond(beyond: dict[str, Array]) -> str:
    angles = [degrees(angle) for angle in studies.BEYOND_ANGLES]

    def chart(names: Sequence[str], title: str) -> str:
        series = [Series(name, angles, np.degrees(beyond[name][:, 2]).tolist()) for name in names]
        return _card(line_chart(series, Axes(title=title, x="incident angle in air, degrees", y="Top1, °", log=True)))

    single = [name for name, curve in beyond.items() if len(curve) == 1]
    rows = "".join(
        f"<tr><td>{escape(name)}<td>{degrees(beyond[name][0, 0]):.3f}°<td>{degrees(beyond[name][0, 2]):.2f}°"
        for name in single
    )
    return _section(
        "Beyond the paper",
        "<p>Observations within three sigma of black are dropped where three others remain. A window bends the light "
        "towards the normal, so a larger angle in air is best, and takes some of it. With one exposure each colour "
        "comes from four LEDs at once; with four, three LEDs 120° apart shine in each.</p>"
        f'<div class="figures">{chart(("least squares", "shadows dropped"), "Shadow-aware photometric stereo")}'
        f"{chart(('least squares', 'window, same lamps', 'window, exposure restored'), 'Refraction at the window')}"
        f"<table><tr><th>at 29°<th>MAE<th>Top1{rows}</table></div>",
    )


def _designs(found: Findings) -> str:
    groups = (
        *((f"the given sensor, {label}", [one]) for label, one in found.given.items()),
        ("every LED by itself, shadows dropped", found.designs),
        ("one exposure in colour", found.one_shot_designs),
        ("every LED by itself, exposed as long as it takes", found.bright_designs),
    )
    rows = "".join(
        f"<tr><td>{label}<td>{one.number}<td>{degrees(one.incident_angle_rad):.1f}°<td>{one.mounting_height_mm:.1f} mm"
        f"<td>{one.brightest_grey:.0f}<td>{degrees(one.mae_rad):.3f}°<td>{degrees(one.noise_mae_rad):.3f}°"
        f"<td>{degrees(one.top1_rad):.2f}°"
        for label, candidates in groups
        for one in candidates
    )
    head = "<tr><th>read as<th>LEDs<th>tilt<th>height<th>brightest grey<th>MAE<th>noise alone<th>Top1"
    return _section(
        "Designs: tilt, height, number and exposure at once",
        "<p>Near field, light bent by the window, criterion Top1 of the benchmark, exposed no longer "
        "than the given sensor unless said otherwise: a ring far away or turned aside is dark. “Noise alone” is "
        "the closed form on a plane, sd² (LᵀL)⁻¹: what the MAE has above it is shadow and "
        "clipping; below it, the steeper slopes face the light.</p>"
        f'<div class="wide"><table>{head}{rows}</table></div>',
    )


def _sensitivity(rows: Sensitivity) -> str:
    body = "".join(
        f"<tr><td>{variant.quantity}<td>{escape(variant.setting)}<td>{degrees(best):.0f}°<td>{degrees(mean):.1f}°"
        for variant, best, mean in rows
    )
    return _section(
        "What 29° depends on",
        "<p>The study with one thing changed. The best angle moves by no more than a step with noise, exposure and "
        "cast shadows, and further with all that makes slopes steeper. It is a property of this benchmark, not of "
        "tactile sensors.</p>"
        f"<table><tr><th>changed<th>to<th>best angle<th>mean of the objects{body}</table>",
    )


def _parts(found: Findings) -> str:
    chosen = answers.designed(_chosen(found.designs, found.subject), found.subject.geometry)
    cards = [_part(title, geometry) for title, geometry in (("given", found.subject.geometry), ("chosen", chosen))]
    return _section(
        "Parts to make",
        "<p>The strip of the LEDs is a cone, unrolled; files in the folders <code>given</code> and <code>chosen</code> "
        "beside this page: <code>strip.dxf</code>, <code>strip.svg</code>, <code>ring.svg</code>, "
        "<code>leds.csv</code>, and <code>gellight.toml</code>, which the simulated sensor reads.</p>"
        f'<div class="figures">{"".join(cards)}</div>',
    )


def _part(title: str, geometry: SensorGeometry) -> str:
    flat = parts.strip(geometry)
    rows = "".join(f"<tr><td>{name}<td>{value:.3f} {unit}" for name, value, unit in parts.strip_facts(flat))
    return (
        f'<div class="card part"><h3>{title}: {flat.count} LEDs, {degrees(geometry.incident_angle_rad):.1f}°, '
        f"{geometry.mounting_height_mm:g} mm</h3>{parts.strip_svg(flat, geometry.led_colours)}"
        f"{parts.ring_svg(geometry)}<table>{rows}</table></div>"
    )


def _times(times: SweepTimes | None) -> str:
    if times is None:
        return ""
    return _section("Time of the coarse sweep", f"<p>{times.in_words()}</p>")


def _section(title: str, body: str) -> str:
    return f"<section><h2>{escape(title)}</h2>{body}</section>"


def _card(body: str) -> str:
    return f'<div class="card">{body}</div>'


def _whole(result: T | None) -> T:
    if result is None:
        raise InputError("a part of the studies is missing: run the report without --shard")
    return result
