"""The report: one page that needs nothing from outside, with every figure, the comparison with the paper, the parts."""

from dataclasses import asdict
from html import escape
from math import degrees, isnan
from pathlib import Path
from typing import Any

import numpy as np

from gellight.lab.design import designs, drawings, output, parts, studies
from gellight.lab.design.geometry import ring_colours
from gellight.lab.design.output import BallResult, write_all
from gellight.lab.design.studies import BeyondResult, StudySetup
from gellight.lab.report import html
from gellight.lab.report.charts import Axes, Series, line_chart
from gellight.lab.report.html import box, section, table
from sim_reference.geometry import SensorGeometry
from sim_reference.optimizer.coarse import CHOSEN_NUMBER, CoarseResult
from tests.paper import comparison, heights, renderings
from tests.paper.all_studies import AllResults
from tests.paper.comparison import Judgement
from tests.paper.gel_comparison import gel_json, gel_section
from tests.paper.variants import VariantResult

STEEPER = ("press", "relief", "coating", "wavelength")
"""quantities of the sensitivity study that change how steep the surface is"""


def write_report(results: AllResults, folder: Path) -> Path:
    """Write report.html and the parts of the given ring and of the chosen one into `folder`; return the page's path.

    Raises InputError if that is impossible.
    """
    for name, geometry in (("given", results.setup.geometry), ("chosen", results.chosen_sensor)):
        write_all(folder / name, designs.parts_of(geometry))
    return write_all(folder, {"report.html": page(results)})[0]


def report_json(results: AllResults, path: Path) -> dict[str, Any]:
    """Return the path of the page, and its statements, gains and designs."""
    return {
        "report": str(path),
        "statements": [_judgement_json(row) for row in results.judgements()],
        "gains": [designs.gain_json(gain) for gain in results.gains()],
        "given": designs.candidate_json(results.given),
        "chosen": designs.candidate_json(results.chosen),
        "gel": [gel_json(row) for row in results.gel],
    }


def report_text(results: AllResults, path: Path) -> str:
    """Return the path of the page, the statements that are not reproduced and the gains as lines of text."""
    rows = results.judgements()
    return "\n".join(
        [
            str(path),
            f"{comparison.summary(rows)}; under none:",
            *(f"  {row.by_default.claim}: {row.by_default.measured}" for row in rows if not row.reproduced),
            "what each step beyond the paper gains in Top1:",
            *(f"  {gain.in_words()}" for gain in results.gains()),
        ]
    )


def page(results: AllResults) -> str:
    """Return the page."""
    body = [
        _summary(results),
        _statements(results),
        _benchmark(results.setup),
        _coarse(results.coarse),
        _fine(results),
        _ball(results.ball),
        _beyond(results),
        _designs(results),
        _sensitivity(results.sensitivity),
        gel_section(results.gel, results.setup) if results.gel else "",
        _parts(results),
        section("Time of the coarse sweep", f"<p>{results.times.in_words()}</p>") if results.times else "",
    ]
    return html.page("GelLight: illumination", "Illumination of a tactile sensor", "".join(body))


def _summary(results: AllResults) -> str:
    best, given, gains = results.chosen, results.given, results.gains()
    return f"<p><b>{comparison.summary(results.judgements())}.</b></p>" + html.tiles(
        [
            (
                _deg(results.coarse.best_angle_rad(), 0),
                "best incident angle of the averaged benchmark (tuned); paper: 29°",
            ),
            (_deg(results.coarse.mean_best_angle_rad(), 1), "mean of the objects' best angles; paper: 32.2°"),
            (f"{gains[0].factor:.1f}×", f"lower Top1: {gains[0].step}"),
            (f"{gains[2].factor:.1f}×", f"lower Top1: {gains[2].step} instead of one"),
            (
                f"{best.number} LEDs",
                f"chosen: tilt {_deg(best.incident_angle_rad, 1)}, height {best.mounting_height_mm:.1f} mm, Top1 "
                f"{_deg(best.top1_rad, 2)}; given: {_deg(given.incident_angle_rad, 1)}, "
                f"{given.mounting_height_mm:.1f} mm, {_deg(given.top1_rad, 2)}",
            ),
        ]
    )


def _judgement_json(row: Judgement) -> dict[str, Any]:
    return {
        **asdict(row.by_default),
        "reproduced": row.reproduced,
        "holds_under": row.holds_under,
        "readings": {reading: one.measured for reading, one in row.by_reading.items()},
    }


def _statements(results: AllResults) -> str:
    rows, body = results.judgements(), ""
    for row in rows:
        one = row.best
        kind, verdict = ("yes", "reproduced") if row.reproduced else ("no", "not reproduced")
        row_cells = [one.section, escape(one.claim), escape(one.measured), _readings(row), verdict]
        body += f'<tr class="{kind}">{html.cells(row_cells)}'
    head = "<tr><th>section<th>the paper says<th>measured here<th>holds under<th>verdict"
    return section(
        "The paper, line by line",
        f"<p>{comparison.summary(rows)}. Where the text leaves open what was done, each statement is judged under "
        "every reading: a click on how many it holds under shows them, and why. The numbers decide, not the author of "
        "this page. In the coarse stage 29° comes out because the objects' measures, which the paper does not give, "
        "were chosen so.</p>",
        box("wide", f'<table class="statements">{head}{body}</table>'),
    )


def _readings(row: Judgement) -> str:
    """Return under how many readings it holds; folded below: each one, the criterion and why."""
    readings: dict[tuple[bool, str], list[str]] = {}
    for reading, one in row.by_reading.items():
        readings.setdefault((one.reproduced, one.measured), []).append(reading)
    each = "<br>".join(
        f"{'✓' if holds else '✗'} {escape(measured)} <small>({escape(' / '.join(names))})</small>"
        for (holds, measured), names in readings.items()
    )
    return (
        f"<details><summary>{len(row.holds_under)} of {len(row.by_reading)} readings</summary>"
        f"{each}<p>Holds if: {escape(row.best.holds_if)}. {escape(row.best.why)}</p></details>"
    )


def _benchmark(setup: StudySetup) -> str:
    return section(
        "The benchmark",
        f"<p>Ten objects in four groups, relief {setup.parameters.relief_mm:g} mm, pressed "
        f"{setup.sampling.press_depth_mm:g} mm into the gel. Under each object stand the slope that 0.3 % of the "
        "surface exceeds and the largest depth. White is deepest, black the highest bulge. Below, the same presses "
        "under the coloured ring (figure 4d).</p>",
        box("pictures", renderings.benchmark_depths(setup)),
        box("pictures", renderings.benchmark_pictures(setup)),
    )


def _coarse(result: CoarseResult) -> str:
    best, means = result.best_angles_rad(), result.map_mean_by_number()
    relative = line_chart(
        [Series("", list(means), list(means.values()))],
        Axes(title=f"Map mean relative to {CHOSEN_NUMBER} lights", x="number of lights", y="relative Top1"),
    )
    return section(
        "Coarse stage: number of lights and incident angle",
        "<p>Parallel light with attached and cast shadows, 8 bit, noise with a standard deviation of "
        f"{result.groups.noise_grey:g} grey levels. Rows are numbers of lights, columns incident angles. The best of "
        "each row is framed; from 30° all cells are red. Figure 3a, then figure 4a:</p>",
        box("figures", *(output.top1_map(result, "SCROWN", figure) for figure in range(3))),
        box("figures", *(output.top1_map(result, name) for name in result.names)),
        "<h3>Figure 4b: Top1 against the incident angle, one curve for each number of lights</h3>",
        box(
            "figures",
            *(box("card", output.top1_curves(result, name)) for name in (None, *result.names)),
            box("card", relative),
        ),
        table(["", *best], [[f"best angle, {CHOSEN_NUMBER} lights", *(_deg(angle, 0) for angle in best.values())]]),
    )


def _fine(results: AllResults) -> str:
    geometry = results.setup.geometry
    rows = [
        [escape(row.view), "never" if isnan(row.half_mm) else f"{row.half_mm:.1f} mm", f"{row.at_20_mm:.0%}"]
        for row in comparison.saturation_table(geometry)
    ]
    return section(
        "Fine stage: mounting height",
        "<p>LEDs are spot lights near the gel. The first row shows the plane at each height with the same lamps and "
        "exposure, which clips where the LEDs are near (figure 4e); the second each channel at "
        f"{geometry.mounting_height_mm:g} mm with lines of equal brightness, {renderings.CONTOURS} steps from black to "
        "the brightest (figure 4c). Dashed curves of the error include the window, which bends the light and leaves no "
        "room for LEDs further down.</p>",
        box("pictures", renderings.plane_pictures(results.setup, results.fine.heights_mm)),
        box("pictures", renderings.channel_pictures(results.setup)),
        box(
            "figures",
            *(box("card", str(chart)) for chart in heights.fine_charts(results.fine).values()),
            table(["view and camera", "SAT = 50 % at", "SAT at 20 mm"], rows),
        ),
    )


def _ball(result: BallResult) -> str:
    return section(
        "Calibration ball",
        f"<p>Recommended: {escape(output.ball_text(result.choice))}. The largest ball that records 60° has the "
        "sharpest edge in the image.</p>",
        box("figures", box("card", output.ball_chart(result))),
    )


def _beyond(results: AllResults) -> str:
    beyond = results.beyond
    gains = [
        [escape(gain.step), f"{gain.before_deg:.2f}°", f"{gain.after_deg:.2f}°", f"{gain.factor:.2f}×",
         escape(gain.compared)]
        for gain in results.gains()
    ]  # fmt: skip
    schemes = [[escape(name), _deg(error[0], 3), _deg(error[2], 2)] for name, error in beyond.schemes.items()]
    return section(
        "Beyond the paper",
        "<p>Observations within three sigma of black are dropped where three others remain. A window bends the light "
        "towards the normal, so a larger angle in air is best; it also takes some of the light. With one exposure each "
        "colour comes from four LEDs at once; with four exposures, three LEDs 120° apart shine in each.</p>",
        table(["step", "Top1 without", "with", "times lower", "compared"], gains),
        "<p></p>",
        box(
            "figures",
            _beyond_chart(beyond, "Shadow-aware photometric stereo", "least squares", "shadows dropped"),
            _beyond_chart(
                beyond, "Refraction at the window", "least squares", "window, same lamps", "window, exposure restored"
            ),
            table(["at 29°", "MAE", "Top1"], schemes),
        ),
    )


def _beyond_chart(beyond: BeyondResult, title: str, *names: str) -> str:
    angles = [degrees(angle) for angle in studies.BEYOND_ANGLES]
    series = [Series(name, angles, np.degrees(beyond.curves[name][:, 2]).tolist()) for name in names]
    return box(
        "card", line_chart(series, Axes(title=title, x="incident angle in air, degrees", y="Top1, degrees", log=True))
    )


def _designs(results: AllResults) -> str:
    groups = (
        ("the given sensor, every LED by itself, shadows dropped", [results.given]),
        ("every LED by itself, shadows dropped", results.designs),
        ("the given sensor, one exposure in colour", [results.one_shot_given]),
        ("one exposure in colour", results.one_shot_designs),
        ("every LED by itself, exposed as long as it takes", results.bright_designs),
    )
    rows = [
        [label, str(one.number), _deg(one.incident_angle_rad, 1), f"{one.mounting_height_mm:.1f} mm",
         f"{one.brightest_grey:.0f}", _deg(one.mae_rad, 3), _deg(one.noise_mae_rad, 3), _deg(one.top1_rad, 2)]
        for label, candidates in groups
        for one in candidates
    ]  # fmt: skip
    head = ["read as", "LEDs", "tilt", "height", "brightest grey", "MAE", "noise alone", "Top1"]
    return section(
        "Designs: tilt, height, number and exposure at once",
        "<p>Near field, light bent by the window, criterion Top1 of the benchmark. A ring far away or turned aside is "
        "dark, so no design is exposed longer than the given sensor unless the row says otherwise. “Noise alone” is "
        "the closed form on a plane, sd² (LᵀL)⁻¹. An MAE above it comes from shadows and clipping; it can also lie "
        "below, because steep slopes face the light.</p>",
        box("wide", table(head, rows)),
    )


def _sensitivity(rows: list[VariantResult]) -> str:
    start = degrees(rows[0].best_angle_rad)
    moved = {True: 0.0, False: 0.0}
    for row in rows:
        steeper = row.variant.quantity in STEEPER
        moved[steeper] = max(moved[steeper], abs(degrees(row.best_angle_rad) - start))
    body = [
        [row.variant.quantity, escape(row.variant.setting), _deg(row.best_angle_rad, 0),
         _deg(row.mean_best_angle_rad, 1)]
        for row in rows
    ]  # fmt: skip
    return section(
        f"What {start:.0f}° depends on",
        f"<p>The study with one thing changed. Noise, exposure and cast shadows move the best angle by "
        f"{moved[False]:.0f}° at most; what changes the steepness of the surface (press, relief, coating, wavelength) "
        f"moves it by up to {moved[True]:.0f}°. The best angle is a property of this benchmark, not of tactile "
        "sensors.</p>",
        table(["changed", "to", "best angle", "mean of the objects"], body),
    )


def _parts(results: AllResults) -> str:
    return section(
        "Parts to make",
        "<p>The LEDs stand on a flexible strip that is rolled to a cone, LEDs inside and towards the gel; unrolled it "
        "is the sector below. Lengths are mm. The folders <code>given</code> and <code>chosen</code> beside this page "
        "hold <code>strip.dxf</code> and <code>strip.svg</code> for the maker of the strip, <code>ring.svg</code> "
        "(section, and the ring as the camera sees it), <code>leds.csv</code> (colour, position and axis of each LED) "
        "and <code>gellight.toml</code>: the design, which the simulated sensor and photometric stereo read. "
        "The command under each drawing lights the ring by hand.</p>",
        box("figures", _part("given", results.setup.geometry), _part("chosen", results.chosen_sensor)),
    )


def _part(title: str, geometry: SensorGeometry) -> str:
    flat = parts.strip(geometry)
    return (
        f'<div class="card part"><h3>{title}: {flat.count} LEDs, {_deg(geometry.incident_angle_rad, 1)}, '
        f"{geometry.mounting_height_mm:g} mm</h3>{drawings.strip_svg(flat, geometry.led_colours)}"
        f"{drawings.ring_svg(geometry)}<p><code>gellight ring set {ring_colours(geometry)}</code></p>"
        f"{table([], [[name, f'{value:.3f} {unit}'] for name, value, unit in _strip_facts(flat)])}</div>"
    )


def _strip_facts(flat: parts.Strip) -> list[tuple[str, float, str]]:
    """Return the measures of the strip: name, value, unit."""
    return [
        ("sector", degrees(flat.sector_rad), "degrees"),
        ("inner radius", flat.inner_radius_mm, "mm"),
        ("middle radius", flat.middle_radius_mm, "mm"),
        ("outer radius", flat.outer_radius_mm, "mm"),
        ("pitch of the LEDs", degrees(flat.pitch_rad), "degrees"),
        ("height of the cone", flat.rise_mm, "mm"),
    ]


def _deg(angle_rad: float, decimals: int) -> str:
    return f"{degrees(angle_rad):.{decimals}f}°"
