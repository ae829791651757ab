"""The report of a calibration: one page with every figure and picture, without anything from outside."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from html import escape
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from gellight.frames.frames import TactileFrame
from gellight.lab.calibration.preparing import contour_picture
from gellight.lab.calibration.pressing import drawn
from gellight.lab.calibration.records import (
    BallPresses,
    CheckErrors,
    Fit,
    MeasuredLens,
    MeasuredPixelSize,
    PinGrid,
    PixelSize,
    Preparation,
    UntouchedGel,
    Verdict,
    Verification,
)
from gellight.lab.calibration.run import CalibrationRun
from gellight.lab.calibration.state import CheckRecord
from gellight.lab.report import html
from gellight.lab.report.charts import Axes, Series, heat_map, line_chart, picture
from gellight.lab.report.html import box, section, table
from gellight.lab.report.pictures import depth_picture, difference_picture, normal_picture
from gellight.lab.training.presses import Ball, Press, cap_depth_mm, contact_circle, sphere_gradient
from gellight.lab.training.training import like_words
from gellight.lab.training.wrong_labels import contradicted_lines
from gellight.reconstruction.integration import normals

_SHAPE = "depth, mean taken off, µm"
_WHAT_IS_TAKEN_OFF = (
    "No network was trained on these presses. A contact circle does not say how deep its own rim lies. So where it "
    "says &quot;mean taken off&quot;, the mean error of each press is taken off: what is left is the error of the "
    "shape, not of the level. The column &quot;picture&quot; compares the picture with the one that the felt slopes "
    "make."
)


@dataclass(frozen=True, eq=False)
class Example:
    """One fresh press in full."""

    image: NDArray[np.uint8]
    press: Press
    """its circle in the picture"""
    on_gel: Press
    """its circle over the undistorted gel, where what is felt lies"""
    felt: TactileFrame
    ball: Ball

    @property
    def shape(self) -> tuple[int, int]:
        """(H, W)"""
        return self.image.shape[0], self.image.shape[1]

    @cached_property
    def inside(self) -> NDArray[np.bool_]:
        """(H, W) the contact circle over the undistorted gel."""
        return contact_circle(self.on_gel, self.shape)

    @cached_property
    def cap_mm(self) -> NDArray[np.float32]:
        """(H, W) depth of the ball below the rim of its contact circle; NaN outside."""
        return np.where(self.inside, cap_depth_mm(self.on_gel, self.ball, self.shape), np.nan)

    @cached_property
    def rim_mm(self) -> float:
        """How deep the rim has to lie for the ball to fit what is felt best."""
        return float((self.felt.depth_mm - self.cap_mm)[self.inside].mean())


def page(run: CalibrationRun, verdict: Verdict, figures: Verification, example: Example) -> str:
    """Return the page as HTML; figures: means over the fresh presses."""
    folder, sensor = run.folder, run.options.sensor
    name = f"{folder.state.name} ({sensor})" if folder.state.name else sensor
    sections = (
        _tiles(run, verdict, figures),
        f"<p>{escape(verdict.text)}</p>",
        _verification(folder.state.checks, figures, example),
        _preparation(run),
        _pixel_size(folder.figures(PixelSize), run.options.tools.cylinder_diameter_mm),
        _lens(folder.state.steps.lens),
        _presses(folder.figures(BallPresses), example.ball),
        _training(folder.figures(Fit)),
    )
    return html.page(f"GelLight: calibration of {name}", f"Calibration of {name}", "".join(sections))


def _tiles(run: CalibrationRun, verdict: Verdict, figures: Verification) -> str:
    folder = run.folder
    size, presses = folder.figures(PixelSize), folder.figures(BallPresses)
    return html.tiles(
        [
            *depth_tiles(figures, [check.figures for check in folder.state.checks]),
            (f"{verdict.normal_deg:.2f}°", "mean angle between the normals in contact there"),
            (f"{1000 * size.pixel_size_mm:.2f} µm", f"a pixel, {_origin(size)}"),
            (f"{folder.figures(UntouchedGel).pixel_noise_grey:.2f}", "grey levels of noise in a pixel of a frame"),
            (f"{presses.presses}", f"ball presses to train on; {presses.refused} refused"),
            ("passed" if verdict.passed else "not passed", "verdict"),
        ]
    )


def depth_tiles(figures: Verification, each: Sequence[CheckErrors]) -> list[tuple[str, str]]:
    """Return the depth errors with what they are: first with nothing taken off, where a simulator knows that."""
    worst = f"worst press {1000 * max(one.known_depth_mm for one in each):.0f} µm; paper: 20 µm"
    shape = f"{1000 * figures.depth_mm:.0f} µm"
    removed = "the mean error of each press is taken off, since a contact circle does not say how deep its rim lies"
    if figures.true_depth_mm is None:
        return [
            (shape, f"mean error of the shape of the depth in contact on {len(each)} fresh presses: {removed}; {worst}")
        ]
    true = f"mean depth error in contact on {len(each)} fresh presses, against the simulator's truth; {worst}"
    return [(f"{1000 * figures.true_depth_mm:.0f} µm", true), (shape, f"of it in the shape of the depth: {removed}")]


def _verification(records: list[CheckRecord], figures: Verification, example: Example) -> str:
    """The section about the fresh presses; figures: means over them."""
    return section(
        "Verification on fresh presses",
        f"<p>{_WHAT_IS_TAKEN_OFF}</p>",
        small_pictures(_felt_pictures(example)),
        box("figures", section_profile(example)),
        f"<p>The ball is drawn twice: its rim at depth 0, and raised by {1000 * example.rim_mm:.0f} µm, where it fits "
        "what is felt best. A depth that is wrong by as much everywhere does not show against the raised ball.</p>",
        _checks(records),
    )


def _felt_pictures(example: Example) -> list[tuple[NDArray[np.uint8], str]]:
    """One fresh press: seen, felt, and as the ball says it should be."""
    felt, inside = example.felt, example.inside
    error = np.where(inside, np.abs(felt.depth_mm - example.cap_mm - example.rim_mm), 0)
    scale = max(1000.0 * float(felt.depth_mm.max()), 100.0)
    gradient = np.nan_to_num(sphere_gradient(example.on_gel, example.ball, example.shape))
    true = np.where(inside[..., None], normals(gradient), [0, 0, 1])
    return [
        (drawn(example.image, example.press), "one fresh press and its contact circle"),
        (difference_picture(felt.difference), "difference from the untouched gel"),
        (depth_picture(felt.depth_mm, scale_um=scale), f"depth felt, bright: {scale:.0f} µm"),
        (normal_picture(true), "normals of the ball inside the circle"),
        (normal_picture(felt.normal_map), "normals felt"),
        (depth_picture(error, scale_um=100), "depth error in contact, its mean taken off, bright: 100 µm"),
    ]


def _checks(records: list[CheckRecord]) -> str:
    known = records[0].figures.true_depth_mm is not None
    depth, whole = (["depth µm"], ["normals, whole map °"]) if known else ([], [])
    expected = ["felt over expected indentation"] if records[0].figures.felt_over_expected is not None else []
    head = ["press", "centre px", "radius px", *depth, *expected, _SHAPE, "normals °", "picture, grey levels", *whole]
    rows = [
        [
            f"{record.number}",
            f"{record.center_x_px:.1f}, {record.center_y_px:.1f}",
            f"{record.contact_radius_px:.1f}",
            *([f"{1000 * one.known_depth_mm:.1f}"] if known else []),
            *([] if one.felt_over_expected is None else [f"{one.felt_over_expected:.2f}"]),
            f"{1000 * one.depth_mm:.1f}",
            f"{one.normal_deg:.2f}",
            f"{one.picture_grey:.2f}",
            *([] if one.true_normal_deg is None else [f"{one.true_normal_deg:.2f}"]),
        ]
        for record in records
        for one in [record.figures]
    ]
    return box("wide", table(head, rows))


def section_profile(example: Example) -> str:
    """Draw depth along the horizontal line through the centre of a press, felt and by the ball (figure 6c)."""
    press, row = example.on_gel, round(example.on_gel.center_y_px)
    left, right = (round(press.center_x_px + side * 2.5 * press.contact_radius_px) for side in (-1, 1))
    reach = slice(max(0, left), right)
    x_mm = ((np.arange(example.shape[1]) - press.center_x_px) * example.ball.pixel_size_mm)[reach].tolist()
    felt, ball = (1000 * depth_mm[row, reach].astype(float) for depth_mm in (example.felt.depth_mm, example.cap_mm))
    raised_um = 1000 * example.rim_mm
    return line_chart(
        [
            Series("felt", x_mm, felt.tolist()),
            Series("ball, its rim at depth 0", x_mm, ball.tolist()),
            Series(f"ball, raised by {raised_um:.0f} µm", x_mm, (ball + raised_um).tolist(), dashed=True),
        ],
        Axes(title="Section through the centre of the ball", x="mm", y="depth, µm"),
    )


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
    leds = [[f"{a.led}", a.colour, f"{a.grey:.1f}", f"{a.azimuth_deg:.0f}"] for a in answers]
    return section(
        "Light",
        f"<p>Camera locked: {escape(camera)}. Reference: mean of {reference.frames} frames, "
        f"{reference.pixel_noise_grey:.2f} grey levels of noise in a pixel, which count as {reference.noise_grey:.2f} "
        "(more where neighbours share them, as behind a camera that compresses); while warming up the light moved by "
        f"{reference.warm_up_grey:.2f} grey levels.</p>",
        small_pictures(shown),
        box("wide", table(["intensity", "mean", "sigma", "within 1 sigma", "2 sigma", "3 sigma"], rows)),
        table(["LED", "colour", "grey levels it adds", "shines from, degrees"], leds) if leds else "",
    )


def _origin(size: PixelSize) -> str:
    if isinstance(size, MeasuredPixelSize):
        return f"from {size.presses} presses of the cylinder"
    return "as it was given, not measured"


def _pixel_size(size: PixelSize, diameter_mm: float) -> str:
    if not isinstance(size, MeasuredPixelSize):
        return (
            f"<p>A pixel is taken to be {size.pixel_size_mm:.6f} mm in size, as it was given: nothing measured it.</p>"
        )
    sides = (("x", size.x_mm, size.x_spread_mm), ("y", size.y_mm, size.y_spread_mm))
    return section(
        "Size of a pixel",
        f"<p>The cylinder of {diameter_mm:g} mm measures {size.diameter_px:.2f} px, spread {size.spread_px:.2f} "
        f"px over {size.presses} presses (paper: 340.17 px, 0.47 px).</p>",
        table(["", "mm per pixel", "spread"], [[axis, f"{mm:.6f}", f"{spread:.6f}"] for axis, mm, spread in sides]),
    )


def _lens(lens: PinGrid | None) -> str:
    if not isinstance(lens, MeasuredLens):
        return "<p>No pin grid was pressed: the lens is taken to be straight.</p>"
    rows = [
        ["pins off a straight grid", f"{lens.rms_before_px:.3f}", f"{1000 * lens.rms_before_mm:.1f}"],
        ["pins off this lens", f"{lens.rms_after_px:.3f}", f"{1000 * lens.rms_after_mm:.1f}"],
    ]
    return section(
        "Lens",
        f"<p>{lens.pins} pins, {lens.pitch_mm:g} mm apart, in {lens.pictures} picture(s). The lens moves a "
        f"corner of the picture by {lens.corner_moves_px:.1f} px; depth and normals are freed of that.</p>",
        table(["root mean square", "px", "µm"], rows),
    )


def _presses(found: BallPresses, ball: Ball) -> str:
    seen = found.coverage
    rows, columns = ([f"{i + 1}" for i in range(n)] for n in np.shape(seen.places))
    turns = [f"{45 * i}°" for i in range(len(seen.slopes))]
    bands = [f"{low:.0f}-{high:.0f}°" for low, high in pairwise(seen.steepness_deg)]
    places, slopes = np.array(seen.places, float), np.array(seen.slopes, float) / 1000
    charts = [
        _counts(places, rows, columns, Axes(title="Presses by place", x="column", y="row")),
        _counts(slopes, turns, bands, Axes(title="Thousand pixels by slope", x="steepness", y="direction")),
    ]
    if len(found.held_out) > 1:
        presses, errors = zip(*found.held_out, strict=True)
        curve = Series("cubic polynomial, each press left out", presses, errors)
        charts.append(line_chart([curve], Axes(title="Held-out error as presses came in", x="presses", y="degrees")))
    return section("Ball presses", f"<p>Balls are {escape(ball.seen_from())}.</p>", box("figures", *charts))


def _counts(counts: NDArray[np.float64], rows: list[str], columns: list[str], axes: Axes) -> str:
    return heat_map(counts, rows, columns, axes, largest=max(counts.max(), 1), mark=False)


def _training(found: Fit) -> str:
    training, judged = found.training, found.held_out
    curve = Series("loss", range(1, len(found.losses) + 1), found.losses)
    error = (
        f" Error on presses that networks did not learn from: {judged.normal_error_deg.mean:.2f} degrees."
        if judged
        else ""
    )
    metrics = found.model_dump()
    begun = "".join(f" {escape(words.capitalize())}." for words in like_words(metrics))
    left_out = "".join(f"<p>{escape(line)}</p>" for line in contradicted_lines(metrics))
    return section(
        "Network",
        f"<p>Trained on {training.images} presses by {escape(training.trainer)} in {training.cpu_seconds:.1f} CPU "
        f"seconds.{error}{begun}</p>{left_out}",
        box("figures", line_chart([curve], Axes(title="Training", x="epoch", y="loss"))),
    )


_WIDTH_PX = 320


def small_pictures(images: Sequence[tuple[NDArray[np.uint8], str]]) -> str:
    """Return (H, W, 3) pictures with the words below each, as HTML."""
    return box("pictures", *(picture(_thinned(image), words, _WIDTH_PX) for image, words in images))


def _thinned(image: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Leave out rows and columns that a small picture does not show."""
    step = max(1, image.shape[1] // _WIDTH_PX)
    return np.ascontiguousarray(image[::step, ::step])
