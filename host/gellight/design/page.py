"""The page of the report: findings in, HTML that holds everything out."""

from collections.abc import Sequence
from html import escape
from importlib.resources import files
from math import degrees

import numpy as np
from numpy.typing import NDArray

from gellight.design import answers, comparison, drawings, gallery, parts, studies
from gellight.design.findings import Findings
from gellight.design.geometry import ring_colours
from gellight.design.studies import Subject
from gellight.design.sweep_times import SweepTimes
from gellight.report.charts import Axes, Series, line_chart
from sim_reference.geometry import SensorGeometry
from sim_reference.optimizer import ball
from sim_reference.optimizer.coarse import CHOSEN_NUMBER, CoarseResult
from sim_reference.optimizer.sensitivity import Variant

Array = NDArray[np.float64]
STEEPER = ("press", "relief", "coating", "wavelength")
"""quantities of the sensitivity study that change how steep the surface is"""


def page(found: Findings) -> str:
    """Return the page."""
    sections = [
        _summary(found),
        _statements(found),
        _benchmark(found.subject),
        _coarse(found.coarse),
        _fine(found),
        _ball(found.balls),
        _beyond(found),
        _designs(found),
        _sensitivity(found.sensitivity),
        _parts(found),
        _times(found.times),
    ]
    style = files("gellight.report").joinpath("report.css").read_text()
    return (
        '<!doctype html><html lang="en"><meta charset="utf-8"><meta name="viewport" content="width=device-width">'
        f"<title>GelLight: illumination</title><style>{style}</style><main><h1>Illumination of a tactile sensor</h1>"
        + "".join(sections)
        + "</main></html>\n"
    )


def _summary(found: Findings) -> str:
    best, given = found.chosen, found.given
    gains = found.gains()
    tiles = [
        (f"{degrees(found.coarse.best_angle_rad()):.0f}°", "best incident angle of the averaged benchmark; paper: 29°"),
        (f"{degrees(found.coarse.mean_best_angle_rad()):.1f}°", "mean of the objects' best angles; paper: 32.2°"),
        (f"{gains[0].factor:.1f}×", f"lower Top1: {gains[0].step}"),
        (f"{gains[2].factor:.1f}×", f"lower Top1: {gains[2].step} instead of one"),
        (
            f"{best.number} LEDs",
            f"chosen: tilt {degrees(best.incident_angle_rad):.1f}°, height {best.mounting_height_mm:.1f} mm, Top1 "
            f"{degrees(best.top1_rad):.2f}°; given: {degrees(given.incident_angle_rad):.1f}°, "
            f"{given.mounting_height_mm:.1f} mm, {degrees(given.top1_rad):.2f}°",
        ),
    ]
    body = "".join(f"<div><b>{value}</b><span>{escape(label)}</span></div>" for value, label in tiles)
    return f'<section class="tiles">{body}</section>'


def _statements(found: Findings) -> str:
    rows = found.statements()
    held = sum(row.reproduced for row in rows)
    body = "".join(
        f'<tr class="{"yes" if row.reproduced else "no"}"><td>{row.section}<td>{escape(row.claim)}'
        f"<td>{escape(row.measured)}<td>{escape(row.holds_if)}"
        f"<td>{'reproduced' if row.reproduced else 'not reproduced'}<td>{escape(row.why)}"
        for row in rows
    )
    head = "<tr><th>section<th>the paper says<th>measured here<th>holds if<th>verdict<th>why"
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
        "exceeds, the length how far the gel is pressed in at most. White is deepest, black the highest bulge. Below, "
        "the same presses under the coloured ring (figure 4d).</p>"
        f'<div class="pictures">{gallery.benchmark_depths(subject)}</div>'
        f'<div class="pictures">{gallery.benchmark_pictures(subject)}</div>',
    )


def _coarse(result: CoarseResult) -> str:
    best = result.best_angles_rad()
    names, angles = "".join(f"<th>{name}" for name in best), "".join(f"<td>{degrees(a):.0f}°" for a in best.values())
    three = "".join(answers.top1_map(result, "SCROWN", figure) for figure in range(3))
    maps = "".join(answers.top1_map(result, name) for name in result.names)
    curves = "".join(_card(answers.top1_curves(result, name)) for name in (None, *result.names))
    means = result.map_mean_by_number()
    ratio = Series("", list(means), list(means.values()))
    axes = Axes(title=f"Map mean relative to {CHOSEN_NUMBER} lights", x="number of lights", y="relative Top1")
    return _section(
        "Coarse stage: number of lights and incident angle",
        "<p>Parallel light with attached and cast shadows, 8 bit, noise with a standard deviation of "
        f"{result.groups.noise_grey:g} grey. Rows are numbers of lights, columns incident angles; framed is the best "
        "of each row, red all from 30°. Figure 3a, then figure 4a:</p>"
        f'<div class="figures">{three}</div><div class="figures">{maps}</div>'
        "<h3>Figure 4b: Top1 against the incident angle, one curve a number of lights</h3>"
        f'<div class="figures">{curves}{_card(line_chart([ratio], axes))}'
        f"</div><table><tr><th>{names}<tr><td>best angle, {CHOSEN_NUMBER} lights{angles}</table>",
    )


def _fine(found: Findings) -> str:
    geometry = found.subject.geometry
    charts = "".join(_card(chart) for chart in answers.fine_charts(found.fine))
    rows = "".join(
        f"<tr><td>{escape(label)}<td>{'never' if np.isnan(height) else f'{height:.1f} mm'}<td>{at_20:.0%}"
        for label, height, at_20 in comparison.saturation_table(geometry)
    )
    return _section(
        "Fine stage: mounting height",
        "<p>Spot lights near the gel; the plane at each height with the same lamps and exposure, which clips where the "
        f"LEDs are near (figure 4e), and each channel at {geometry.mounting_height_mm:g} mm with lines of equal "
        f"brightness, {gallery.CONTOURS} steps from black to the brightest (figure 4c). In the error chart dashed "
        "lines are with the light bent by the window, which leaves no room for the LEDs further down.</p>"
        f'<div class="pictures">{gallery.plane_pictures(found.subject, found.fine.heights_mm)}</div>'
        f'<div class="pictures">{gallery.channel_pictures(found.subject)}</div>'
        f'<div class="figures">{charts}'
        f"<table><tr><th>view and camera<th>SAT = 50 % at<th>SAT at 20 mm{rows}</table></div>",
    )


def _ball(balls: tuple[ball.BallChoice, dict[float, Array]]) -> str:
    choice, curves = balls
    return _section(
        "Calibration ball",
        f"<p>Recommended: {escape(answers.ball_text(choice))}. The largest ball that records 60° has the sharpest edge "
        "in the image."
        f'</p><div class="figures">{_card(answers.ball_chart(curves))}</div>',
    )


def _beyond(found: Findings) -> str:
    beyond = found.beyond
    angles = [degrees(angle) for angle in studies.BEYOND_ANGLES]

    def chart(names: Sequence[str], title: str) -> str:
        series = [Series(name, angles, np.degrees(beyond[name][:, 2]).tolist()) for name in names]
        return _card(
            line_chart(series, Axes(title=title, x="incident angle in air, degrees", y="Top1, degrees", log=True))
        )

    gains = "".join(
        f"<tr><td>{escape(gain.step)}<td>{gain.before_deg:.2f}°<td>{gain.after_deg:.2f}°<td>{gain.factor:.2f}×"
        f"<td>{escape(gain.compared)}"
        for gain in found.gains()
    )
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
        "<table><tr><th>step<th>Top1 without<th>with<th>times lower<th>compared"
        f"{gains}</table><p></p>"
        f'<div class="figures">{chart(("least squares", "shadows dropped"), "Shadow-aware photometric stereo")}'
        f"{chart(('least squares', 'window, same lamps', 'window, exposure restored'), 'Refraction at the window')}"
        f"<table><tr><th>at 29°<th>MAE<th>Top1{rows}</table></div>",
    )


def _designs(found: Findings) -> str:
    groups = (
        ("the given sensor, every LED by itself, shadows dropped", [found.given]),
        ("every LED by itself, shadows dropped", found.designs),
        ("the given sensor, one exposure in colour", [found.one_shot_given]),
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


def _sensitivity(rows: list[tuple[Variant, float, float]]) -> str:
    body = "".join(
        f"<tr><td>{variant.quantity}<td>{escape(variant.setting)}<td>{degrees(best):.0f}°<td>{degrees(mean):.1f}°"
        for variant, best, mean in rows
    )
    start = degrees(rows[0][1])
    moved: dict[bool, float] = {True: 0.0, False: 0.0}
    for variant, best, _ in rows:
        steeper = variant.quantity in STEEPER
        moved[steeper] = max(moved[steeper], abs(degrees(best) - start))
    return _section(
        f"What {start:.0f}° depends on",
        f"<p>The study with one thing changed. Noise, exposure and cast shadows move the best angle by "
        f"{moved[False]:.0f}° at most, what changes the steepness of the surface (press, relief, coating, wavelength) "
        f"by {moved[True]:.0f}°. It is a property of this benchmark, not of tactile sensors.</p>"
        f"<table><tr><th>changed<th>to<th>best angle<th>mean of the objects{body}</table>",
    )


def _parts(found: Findings) -> str:
    cards = [
        _part(title, geometry)
        for title, geometry in (("given", found.subject.geometry), ("chosen", found.chosen_sensor))
    ]
    return _section(
        "Parts to make",
        "<p>The LEDs stand on a flexible strip that is rolled to a cone, LEDs inside and towards the gel; unrolled it "
        "is the sector below. Lengths are mm. The folders <code>given</code> and <code>chosen</code> beside this page "
        "hold <code>strip.dxf</code> and <code>strip.svg</code> for the maker of the strip, <code>ring.svg</code> "
        "(section, and the ring as the camera sees it), <code>leds.csv</code> (colour, place and axis of each LED) and "
        "<code>gellight.toml</code>: the design, which the simulated sensor and photometric stereo read. "
        "The line under each drawing lights the ring by hand.</p>"
        f'<div class="figures">{"".join(cards)}</div>',
    )


def _part(title: str, geometry: SensorGeometry) -> str:
    flat = parts.strip(geometry)
    rows = "".join(f"<tr><td>{name}<td>{value:.3f} {unit}" for name, value, unit in parts.strip_facts(flat))
    return (
        f'<div class="card part"><h3>{title}: {flat.count} LEDs, {degrees(geometry.incident_angle_rad):.1f}°, '
        f"{geometry.mounting_height_mm:g} mm</h3>{drawings.strip_svg(flat, geometry.led_colours)}"
        f"{drawings.ring_svg(geometry)}<p><code>gellight ring set {ring_colours(geometry)}</code></p>"
        f"<table>{rows}</table></div>"
    )


def _times(times: SweepTimes | None) -> str:
    if times is None:
        return ""
    return _section("Time of the coarse sweep", f"<p>{times.in_words()}</p>")


def _section(title: str, body: str) -> str:
    return f"<section><h2>{escape(title)}</h2>{body}</section>"


def _card(body: str) -> str:
    return f'<div class="card">{body}</div>'
