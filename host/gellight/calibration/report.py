"""The report of a calibration: one page with every figure and picture, without anything from outside."""

from dataclasses import dataclass
from html import escape
from importlib.resources import files
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from gellight.calibration.circle import drawn
from gellight.calibration.records import (
    BallPresses,
    CheckRecord,
    Fit,
    MeasuredLens,
    MethodErrors,
    PinGrid,
    PixelSize,
    Preparation,
    UntouchedGel,
    Verdict,
    Verification,
)
from gellight.calibration.session import Session
from gellight.calibration.uniformity import contour_picture
from gellight.frames.frames import TactileFrame
from gellight.reconstruction.integration import normals
from gellight.report.charts import Axes, Series, heat_map, line_chart, picture
from gellight.report.pictures import depth_picture, difference_picture, normal_picture
from gellight.training.presses import Ball, Press, cap_depth_mm, contact_circle, sphere_gradient

_WIDTH_PX = 320
_ERROR_SCALE_UM = 100.0


@dataclass(frozen=True)
class Shown:
    """One fresh press in full, for the report."""

    image: NDArray[np.uint8]
    press: Press
    """its circle in the picture"""
    on_gel: Press
    """its circle over the undistorted gel, where what is felt lies"""
    felt: TactileFrame
    ball: Ball


def page(session: Session, verdict: Verdict, figures: Verification, shown: Shown) -> str:
    """Return the page as HTML; figures: means over the fresh presses."""
    folder = session.folder
    style = files("gellight.report").joinpath("report.css").read_text()
    sections = [
        _tiles(session, verdict),
        f"<p>{escape(verdict.text)}</p>",
        _verification(session, figures, shown),
        _preparation(session),
        _pixel_size(folder.figures(PixelSize), session.options.cylinder_diameter_mm),
        _lens(folder.state.steps.lens),
        _presses(folder.figures(BallPresses)),
        _training(folder.figures(Fit)),
    ]
    name = escape(session.options.sensor)
    return (
        '<!doctype html><html lang="en"><meta charset="utf-8"><meta name="viewport" content="width=device-width">'
        f"<title>GelLight: calibration of {name}</title><style>{style}</style>"
        f"<main><h1>Calibration of {name}</h1>" + "".join(sections) + "</main></html>\n"
    )


def _tiles(session: Session, verdict: Verdict) -> str:
    folder = session.folder
    fresh, size, presses = len(folder.state.checks), folder.figures(PixelSize), folder.figures(BallPresses)
    tiles = [
        (f"{verdict.depth_um:.0f} µm", f"mean depth error in contact on {fresh} fresh presses; paper: 20 µm"),
        (f"{verdict.normal_deg:.2f}°", "mean angle between the normals in contact there"),
        (f"{1000 * size.pixel_size_mm:.2f} µm", f"a pixel, from {size.presses} presses of the cylinder"),
        (f"{folder.figures(UntouchedGel).pixel_noise_grey:.2f}", "grey levels of noise in a pixel of a frame"),
        (f"{presses.presses}", f"ball presses learnt from; {presses.refused} refused"),
        ("passed" if verdict.passed else "not passed", "verdict"),
    ]
    body = "".join(f"<div><b>{escape(value)}</b><span>{escape(label)}</span></div>" for value, label in tiles)
    return f'<section class="tiles">{body}</section>'


def _table(head: list[str], rows: list[list[str]]) -> str:
    top = "".join(f"<th>{escape(cell)}" for cell in head)
    body = "".join("<tr>" + "".join(f"<td>{escape(cell)}" for cell in row) for row in rows)
    return f'<div class="wide"><table><tr>{top}{body}</table></div>'


def _verification(session: Session, figures: Verification, shown: Shown) -> str:
    methods: dict[str, MethodErrors] = {"GelNet": figures, **figures.second_opinions}
    return (
        "<h2>Verification on fresh presses</h2>"
        "<p>None of these presses was learnt from. A contact circle does not say how deep its own rim lies, so depth "
        "errors have their mean removed; the last column compares the picture with the one that the slopes felt would "
        "make.</p>"
        + _pictures(_felt_pictures(shown))
        + f'<div class="figures">{section_profile(shown)}</div>'
        + _checks(session.folder.state.checks)
        + "<h3>Second opinions, fitted to the same presses</h3>"
        + _table(
            ["method", "depth µm", "normals °"],
            [[name, f"{1000 * one.depth_mm:.1f}", f"{one.normal_deg:.2f}"] for name, one in methods.items()],
        )
    )


def _felt_pictures(shown: Shown) -> list[tuple[NDArray[np.uint8], str]]:
    """One fresh press: seen, felt, and as the ball says it should be."""
    press, felt = shown.on_gel, shown.felt
    shape = (felt.depth_mm.shape[0], felt.depth_mm.shape[1])
    inside = contact_circle(press, shape)
    error = felt.depth_mm - np.nan_to_num(cap_depth_mm(press, shown.ball, shape))
    error = np.where(inside, np.abs(error - error[inside].mean()), 0)
    scale = max(1000.0 * float(felt.depth_mm.max()), 100.0)
    true = np.where(inside[..., None], normals(np.nan_to_num(sphere_gradient(press, shown.ball, shape))), [0, 0, 1])
    return [
        (drawn(shown.image, shown.press), "one fresh press and its contact circle"),
        (difference_picture(felt.difference), "difference from the untouched gel"),
        (depth_picture(felt.depth_mm, scale_um=scale), f"depth felt, bright: {scale:.0f} µm"),
        (normal_picture(true), "normals of the ball inside the circle"),
        (normal_picture(felt.normal_map), "normals felt"),
        (depth_picture(error, scale_um=_ERROR_SCALE_UM), f"depth error in contact, bright: {_ERROR_SCALE_UM:.0f} µm"),
    ]


def _checks(records: list[CheckRecord]) -> str:
    known = records[0].figures.true_depth_mm is not None
    head = ["press", "centre px", "radius px", "depth µm", "normals °", "picture, grey levels"]
    head += ["true depth µm", "true normals, whole map °"] if known else []
    rows = []
    for record in records:
        one = record.figures
        row = [
            str(record.number),
            f"{record.center_x_px:.1f}, {record.center_y_px:.1f}",
            f"{record.contact_radius_px:.1f}",
            f"{1000 * one.depth_mm:.1f}",
            f"{one.normal_deg:.2f}",
            f"{one.picture_grey:.2f}",
        ]
        if one.true_depth_mm is not None and one.true_normal_deg is not None:
            row += [f"{1000 * one.true_depth_mm:.1f}", f"{one.true_normal_deg:.2f}"]
        rows.append(row)
    return _table(head, rows)


def section_profile(shown: Shown) -> str:
    """Draw depth along the horizontal line through the centre of a press, felt and by the ball (figure 6c)."""
    press = shown.on_gel
    shape = (shown.image.shape[0], shown.image.shape[1])
    row = round(press.center_y_px)
    felt = shown.felt.depth_mm[row]
    cap = cap_depth_mm(press, shown.ball, shape)[row].astype(float)
    inside = contact_circle(press, shape)[row]
    level = float((felt - cap)[inside].mean())
    reach = slice(max(0, round(press.center_x_px - 2.5 * press.contact_radius_px)),
                  round(press.center_x_px + 2.5 * press.contact_radius_px))  # fmt: skip
    at = (np.arange(shape[1]) - press.center_x_px) * shown.ball.pixel_size_mm
    ball = np.where(inside, cap + level, np.nan)
    return line_chart(
        [
            Series("felt", at[reach].tolist(), (1000 * felt[reach]).tolist()),
            Series("ball", at[reach].tolist(), (1000 * ball[reach]).tolist(), dashed=True),
        ],
        Axes(title="Section through the centre of the ball", x="mm", y="depth, µm"),
    )


def _preparation(session: Session) -> str:
    prepared, reference = session.folder.figures(Preparation), session.folder.figures(UntouchedGel)
    rows = []
    for name, one in prepared.uniformity:
        shares = [f"{100 * share:.2f} %" for share in (one.within_1_sigma, one.within_2_sigma, one.within_3_sigma)]
        rows.append([name, f"{one.mean_grey:.1f}", f"{one.sigma_grey:.2f}", *shares])
    rows.append(["paper, average", "159.0", "6.67", "64.05 %", "96.17 %", "99.90 %"])
    untouched = session.folder.reference()
    pictures = [
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
        + _pictures(pictures)
        + _table(["intensity", "mean", "sigma", "within 1 sigma", "2 sigma", "3 sigma"], rows)
        + (_table(["LED", "colour", "grey levels it adds", "shines from, degrees"], leds) if leds else "")
    )


def _pixel_size(size: PixelSize, diameter_mm: float) -> str:
    return (
        "<h2>Size of a pixel</h2>"
        f"<p>The cylinder of {diameter_mm:g} mm measures {size.diameter_px:.2f} px, spread {size.spread_px:.2f} "
        f"px over {size.presses} presses (paper: 340.17 px, 0.47 px).</p>"
        + _table(
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
        + _table(["root mean square", "px", "µm"], rows)
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


def _pictures(pictures: list[tuple[NDArray[np.uint8], str]]) -> str:
    body = "".join(picture(np.ascontiguousarray(image[::_step(image), ::_step(image)]), words, _WIDTH_PX)
                   for image, words in pictures)  # fmt: skip
    return f'<div class="pictures">{body}</div>'


def _step(image: NDArray[np.uint8]) -> int:
    """Every so many pixels are enough for a picture on a page."""
    return max(1, int(image.shape[1]) // _WIDTH_PX)
