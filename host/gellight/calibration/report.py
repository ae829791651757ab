"""The report of a calibration: one page with every figure and picture, without anything from outside."""

from html import escape
from importlib.resources import files
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from gellight.calibration.records import (
    BallPresses,
    Fit,
    MeasuredLens,
    PinGrid,
    PixelSize,
    Preparation,
    UntouchedGel,
    Verdict,
    Verification,
)
from gellight.calibration.run import CalibrationRun
from gellight.calibration.uniformity import contour_picture
from gellight.calibration.verification_report import Example, depth_tiles, pictures, table, verification
from gellight.report.charts import Axes, Series, heat_map, line_chart


def page(run: CalibrationRun, verdict: Verdict, figures: Verification, example: Example) -> str:
    """Return the page as HTML; figures: means over the fresh presses."""
    folder = run.folder
    style = files("gellight.report").joinpath("report.css").read_text()
    sections = [
        _tiles(run, verdict, figures),
        f"<p>{escape(verdict.text)}</p>",
        verification(folder.state.checks, figures, example),
        _preparation(run),
        _pixel_size(folder.figures(PixelSize), run.options.cylinder_diameter_mm),
        _lens(folder.state.steps.lens),
        _presses(folder.figures(BallPresses)),
        _training(folder.figures(Fit)),
    ]
    name = escape(run.options.sensor)
    return (
        '<!doctype html><html lang="en"><meta charset="utf-8"><meta name="viewport" content="width=device-width">'
        f"<title>GelLight: calibration of {name}</title><style>{style}</style>"
        f"<main><h1>Calibration of {name}</h1>" + "".join(sections) + "</main></html>\n"
    )


def _tiles(run: CalibrationRun, verdict: Verdict, figures: Verification) -> str:
    folder = run.folder
    size, presses = folder.figures(PixelSize), folder.figures(BallPresses)
    tiles = [
        *depth_tiles(figures, [check.figures for check in folder.state.checks]),
        (f"{verdict.normal_deg:.2f}°", "mean angle between the normals in contact there"),
        (f"{1000 * size.pixel_size_mm:.2f} µm", f"a pixel, from {size.presses} presses of the cylinder"),
        (f"{folder.figures(UntouchedGel).pixel_noise_grey:.2f}", "grey levels of noise in a pixel of a frame"),
        (f"{presses.presses}", f"ball presses learnt from; {presses.refused} refused"),
        ("passed" if verdict.passed else "not passed", "verdict"),
    ]
    body = "".join(f"<div><b>{escape(value)}</b><span>{escape(label)}</span></div>" for value, label in tiles)
    return f'<section class="tiles">{body}</section>'


def _preparation(run: CalibrationRun) -> str:
    prepared, reference = run.folder.figures(Preparation), run.folder.figures(UntouchedGel)
    rows = []
    for name, one in prepared.uniformity:
        shares = [f"{100 * share:.2f} %" for share in (one.within_1_sigma, one.within_2_sigma, one.within_3_sigma)]
        rows.append([name, f"{one.mean_grey:.1f}", f"{one.sigma_grey:.2f}", *shares])
    rows.append(["paper, average", "159.0", "6.67", "64.05 %", "96.17 %", "99.90 %"])
    untouched = run.folder.reference()
    shown = [
        (np.rint(untouched).astype(np.uint8), "the untouched gel"),
        (contour_picture(untouched.mean(axis=2)), "its average intensity, contours"),
        *((contour_picture(untouched[..., c]), name) for c, name in enumerate(("red", "green", "blue"))),
    ]
    camera = ", ".join(f"{name} {value:g}" for name, value in prepared.camera.items()) or "nothing to set"
    answers = prepared.lights.leds if prepared.lights else ()
    leds = [[str(a.led), a.colour, f"{a.grey:.1f}", f"{a.azimuth_deg:.0f}"] for a in answers]
    return (
        "<h2>Light</h2>"
        f"<p>Camera locked: {escape(camera)}. Reference: mean of {reference.frames} frames, "
        f"{reference.pixel_noise_grey:.2f} grey levels of noise in a pixel, which count as {reference.noise_grey:.2f} "
        "(more where neighbours share them, as behind a camera that compresses); while warming up the light moved by "
        f"{reference.warm_up_grey:.2f} grey levels.</p>"
        + pictures(shown)
        + table(["intensity", "mean", "sigma", "within 1 sigma", "2 sigma", "3 sigma"], rows)
        + (table(["LED", "colour", "grey levels it adds", "shines from, degrees"], leds) if leds else "")
    )


def _pixel_size(size: PixelSize, diameter_mm: float) -> str:
    return (
        "<h2>Size of a pixel</h2>"
        f"<p>The cylinder of {diameter_mm:g} mm measures {size.diameter_px:.2f} px, spread {size.spread_px:.2f} "
        f"px over {size.presses} presses (paper: 340.17 px, 0.47 px).</p>"
        + table(
            ["", "mm per pixel", "spread"],
            [
                ["x", f"{size.x_mm:.6f}", f"{size.x_spread_mm:.6f}"],
                ["y", f"{size.y_mm:.6f}", f"{size.y_spread_mm:.6f}"],
            ],
        )
    )


def _lens(lens: PinGrid | None) -> str:
    if not isinstance(lens, MeasuredLens):
        return "<p>No pin grid was pressed: the lens is taken to be straight.</p>"
    rows = [
        ["pins off a straight grid", f"{lens.rms_before_px:.3f}", f"{1000 * lens.rms_before_mm:.1f}"],
        ["pins off this lens", f"{lens.rms_after_px:.3f}", f"{1000 * lens.rms_after_mm:.1f}"],
    ]
    return (
        "<h2>Lens</h2>"
        f"<p>{lens.pins} pins, {lens.pitch_mm:g} mm apart, in {lens.pictures} picture(s). The lens moves a "
        f"corner of the picture by {lens.corner_moves_px:.1f} px; depth and normals are freed of that.</p>"
        + table(["root mean square", "px", "µm"], rows)
    )


def _presses(found: BallPresses) -> str:
    seen = found.coverage
    rows, columns = ([str(i + 1) for i in range(n)] for n in np.shape(seen.places))
    turns = [f"{45 * i}°" for i in range(len(seen.slopes))]
    bands = [f"{low:.0f}-{high:.0f}°" for low, high in pairwise(seen.steepness_deg)]
    charts = [
        _counts(np.array(seen.places, float), rows, columns, Axes(title="Presses by place", x="column", y="row")),
        _counts(
            np.array(seen.slopes, float) / 1000,
            turns,
            bands,
            Axes(title="Thousand pixels by slope", x="steepness", y="direction"),
        ),
    ]
    if len(found.held_out) > 1:
        presses, errors = zip(*found.held_out, strict=True)
        curve = Series("cubic polynomial, each press left out", presses, errors)
        charts.append(line_chart([curve], Axes(title="Held-out error as presses came in", x="presses", y="degrees")))
    return f'<h2>Ball presses</h2><div class="figures">{"".join(charts)}</div>'


def _counts(counts: NDArray[np.float64], rows: list[str], columns: list[str], axes: Axes) -> str:
    return heat_map(counts, rows, columns, axes, largest=max(counts.max(), 1), mark=False)


def _training(found: Fit) -> str:
    training = found.training
    curve = Series("loss", range(1, len(found.losses) + 1), found.losses)
    return (
        "<h2>Network</h2>"
        f"<p>Trained on {training.images} presses in {training.cpu_seconds:.1f} CPU seconds; error of single "
        f"pixels on {len(training.held_out_images)} presses held out: {training.held_out_normal_error_deg.mean:.2f} "
        "degrees.</p>"
        f'<div class="figures">{line_chart([curve], Axes(title="Training", x="epoch", y="loss"))}</div>'
    )
