"""The report of a calibration: one page with every figure and picture, without anything from outside."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from html import escape

import numpy as np
from numpy.typing import NDArray

from gellight.frames.frames import TactileFrame
from gellight.lab.calibration.records import (
    BallPresses,
    CheckErrors,
    Fit,
    MeasuredPixelSize,
    PixelSize,
    Preparation,
    UntouchedGel,
    Verdict,
    Verification,
)
from gellight.lab.calibration.run import CalibrationRun
from gellight.lab.calibration.state import CheckRecord
from gellight.lab.report import html
from gellight.lab.report.html import box, picture, section, table
from gellight.lab.report.pictures import depth_picture, difference_picture, normal_picture, with_circle
from gellight.lab.training.presses import Ball, Press, cap_depth_mm, contact_circle, sphere_gradient
from gellight.lab.training.skirts import skirt_words
from gellight.lab.training.training import learnt_words
from gellight.lab.training.wrong_labels import contradicted_lines
from gellight.reconstruction.integration import normals

_SHAPE = "depth, mean taken off, µm"
_WHAT_IS_TAKEN_OFF = (
    "No network was trained on these presses. A contact circle does not say how deep its own rim lies. So where it "
    "says &quot;mean taken off&quot;, the mean error of each press is taken off: what is left is the error of the "
    "shape, not of the level."
)


@dataclass(frozen=True, eq=False)
class Example:
    """One fresh press in full."""

    image: NDArray[np.uint8]
    press: Press
    felt: TactileFrame
    ball: Ball

    @property
    def shape(self) -> tuple[int, int]:
        """(H, W)"""
        return self.image.shape[0], self.image.shape[1]

    @cached_property
    def inside(self) -> NDArray[np.bool_]:
        """(H, W) the contact circle."""
        return contact_circle(self.press, self.shape)

    @cached_property
    def cap_mm(self) -> NDArray[np.float32]:
        """(H, W) depth of the ball below the rim of its contact circle; NaN outside."""
        return np.where(self.inside, cap_depth_mm(self.press, self.ball, self.shape), np.nan)

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
        f"<p>The rim of the ball is felt {1000 * example.rim_mm:.0f} µm deep, which a circle does not tell.</p>",
        _checks(records),
    )


def _felt_pictures(example: Example) -> list[tuple[NDArray[np.uint8], str]]:
    """One fresh press: seen, felt, and as the ball says it should be."""
    felt, inside, press = example.felt, example.inside, example.press
    error = np.where(inside, np.abs(felt.depth_mm - example.cap_mm - example.rim_mm), 0)
    scale = max(1000.0 * float(felt.depth_mm.max()), 100.0)
    gradient = np.nan_to_num(sphere_gradient(example.press, example.ball, example.shape))
    true = np.where(inside[..., None], normals(gradient), [0, 0, 1])
    return [
        (
            with_circle(example.image, press.center_x_px, press.center_y_px, press.contact_radius_px),
            "one fresh press and its contact circle",
        ),
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
    head = ["press", "centre px", "radius px", *depth, *expected, _SHAPE, "normals °", *whole]
    rows = [
        [
            f"{record.number}",
            f"{record.center_x_px:.1f}, {record.center_y_px:.1f}",
            f"{record.contact_radius_px:.1f}",
            *([f"{1000 * one.known_depth_mm:.1f}"] if known else []),
            *([] if one.felt_over_expected is None else [f"{one.felt_over_expected:.2f}"]),
            f"{1000 * one.depth_mm:.1f}",
            f"{one.normal_deg:.2f}",
            *([] if one.true_normal_deg is None else [f"{one.true_normal_deg:.2f}"]),
        ]
        for record in records
        for one in [record.figures]
    ]
    return box("wide", table(head, rows))


def _preparation(run: CalibrationRun) -> str:
    prepared, reference = run.folder.figures(Preparation), run.folder.figures(UntouchedGel)
    rows = [[name, f"{one.mean_grey:.1f}", f"{one.sigma_grey:.2f}"] for name, one in prepared.uniformity.items()]
    untouched = np.rint(run.folder.reference()).astype(np.uint8)
    camera = ", ".join(f"{name} {value:g}" for name, value in prepared.camera.items()) or "nothing to set"
    answers = prepared.lights.leds if prepared.lights else ()
    leds = [[f"{a.led}", a.colour, f"{a.grey:.1f}", f"{a.azimuth_deg:.0f}"] for a in answers]
    return section(
        "Light",
        f"<p>Camera locked: {escape(camera)}. Reference: mean of {reference.frames} frames, "
        f"{reference.pixel_noise_grey:.2f} grey levels of noise in a pixel, which count as {reference.noise_grey:.2f} "
        "(more where neighbours share them, as behind a camera that compresses); while warming up the light moved by "
        f"{reference.warm_up_grey:.2f} grey levels.</p>",
        small_pictures([(untouched, "the untouched gel")]),
        table(["intensity", "mean", "sigma"], [*rows, ["paper, average", "159.0", "6.67"]]),
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


def _presses(found: BallPresses, ball: Ball) -> str:
    seen = found.coverage
    head = ["presses by place", *(f"column {number + 1}" for number in range(len(seen.places[0])))]
    lines = [f"Balls are {escape(ball.seen_from())}. The steepest slope is {seen.steepest_deg:.0f} degrees."]
    if found.held_out:
        presses, error_deg = found.held_out[-1]
        lines.append(f"A cubic polynomial feels each of {presses} presses by the others to {error_deg:.2f} degrees.")
    return section(
        "Ball presses",
        f"<p>{' '.join(lines)}</p>",
        table(head, [[f"row {number}", *map(str, row)] for number, row in enumerate(seen.places, start=1)]),
    )


def _training(found: Fit) -> str:
    training, judged = found.training, found.held_out
    error = (
        f" Error on presses that networks did not learn from: {judged['normal_error_deg']['mean']:.2f} degrees."
        if judged
        else ""
    )
    trainer = escape(training.get("trainer", "torch"))  # before it was told, that was all there was
    metrics = found.model_dump()
    begun = "".join(f" {escape(words.capitalize())}." for words in (*learnt_words(metrics), *skirt_words(metrics)))
    left_out = "".join(f"<p>{escape(line)}</p>" for line in contradicted_lines(metrics))
    return section(
        "Network",
        f"<p>Trained on {training['images']} presses by {trainer} in {training['cpu_seconds']:.1f} CPU "
        f"seconds; its loss fell from {found.losses[0]:.3g} to {found.losses[-1]:.3g}.{error}{begun}</p>{left_out}",
    )


_WIDTH_PX = 320  # chosen: a report holds dozens of pictures


def small_pictures(images: Sequence[tuple[NDArray[np.uint8], str]]) -> str:
    """Return (H, W, 3) pictures with the words below each, as HTML."""
    return box("pictures", *(picture(_thinned(image), words, _WIDTH_PX) for image, words in images))


def _thinned(image: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Leave out rows and columns that a small picture does not show."""
    step = max(1, image.shape[1] // _WIDTH_PX)
    return np.ascontiguousarray(image[::step, ::step])
