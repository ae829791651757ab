"""What the report of a calibration says of its fresh presses."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from html import escape

import numpy as np
from numpy.typing import NDArray

from gellight.calibration.circle import drawn
from gellight.calibration.records import CheckErrors, MethodErrors, Verification
from gellight.calibration.state import CheckRecord
from gellight.frames.frames import TactileFrame
from gellight.reconstruction.integration import normals
from gellight.report.charts import Axes, Series, line_chart, picture
from gellight.report.pictures import depth_picture, difference_picture, normal_picture
from gellight.training.presses import Ball, Press, cap_depth_mm, contact_circle, sphere_gradient

_WIDTH_PX = 320
_ERROR_SCALE_UM = 100.0
_SHAPE = "depth, mean taken off, µm"
_WHAT_IS_TAKEN_OFF = (
    "None of these presses was learnt from. A contact circle does not say how deep its own rim lies. So where it says "
    "&quot;mean taken off&quot;, the mean error of each press is taken off: what is left is the error of the shape, "
    "not of the level. The column &quot;picture&quot; compares the picture with the one that the felt slopes make."
)


@dataclass(frozen=True)
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


def verification(records: list[CheckRecord], figures: Verification, example: Example) -> str:
    """Return the section about the fresh presses as HTML; figures: means over them."""
    methods: dict[str, MethodErrors] = {"GelNet": figures, **figures.second_opinions}
    return (
        "<h2>Verification on fresh presses</h2>"
        f"<p>{_WHAT_IS_TAKEN_OFF}</p>"
        + pictures(_felt_pictures(example))
        + f'<div class="figures">{section_profile(example)}</div>'
        + f"<p>The ball is drawn twice: its rim at depth 0, and raised by {1000 * example.rim_mm:.0f} µm, where it "
        "fits what is felt best. A depth that is wrong by as much everywhere does not show against the raised ball.</p>"
        + _checks(records)
        + "<h3>Second opinions, fitted to the same presses</h3>"
        + table(
            ["method", _SHAPE, "normals °"],
            [[name, f"{1000 * one.depth_mm:.1f}", f"{one.normal_deg:.2f}"] for name, one in methods.items()],
        )
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
        (
            depth_picture(error, scale_um=_ERROR_SCALE_UM),
            f"depth error in contact, its mean taken off, bright: {_ERROR_SCALE_UM:.0f} µm",
        ),
    ]


def _checks(records: list[CheckRecord]) -> str:
    known = records[0].figures.true_depth_mm is not None
    depth, whole = (["depth µm"], ["normals, whole map °"]) if known else ([], [])
    head = ["press", "centre px", "radius px", *depth, _SHAPE, "normals °", "picture, grey levels", *whole]
    rows = []
    for record in records:
        one = record.figures
        rows.append(
            [
                str(record.number),
                f"{record.center_x_px:.1f}, {record.center_y_px:.1f}",
                f"{record.contact_radius_px:.1f}",
                *([f"{1000 * one.known_depth_mm:.1f}"] if known else []),
                f"{1000 * one.depth_mm:.1f}",
                f"{one.normal_deg:.2f}",
                f"{one.picture_grey:.2f}",
                *([] if one.true_normal_deg is None else [f"{one.true_normal_deg:.2f}"]),
            ]
        )
    return table(head, rows)


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


def table(head: list[str], rows: list[list[str]]) -> str:
    """Return a table as HTML."""
    top = "".join(f"<th>{escape(cell)}" for cell in head)
    body = "".join("<tr>" + "".join(f"<td>{escape(cell)}" for cell in row) for row in rows)
    return f'<div class="wide"><table><tr>{top}{body}</table></div>'


def pictures(images: list[tuple[NDArray[np.uint8], str]]) -> str:
    """Return pictures with their captions as HTML."""
    body = "".join(picture(np.ascontiguousarray(image[::_step(image), ::_step(image)]), words, _WIDTH_PX)
                   for image, words in images)  # fmt: skip
    return f'<div class="pictures">{body}</div>'


def _step(image: NDArray[np.uint8]) -> int:
    """Every so many pixels are enough for a picture on a page."""
    return max(1, int(image.shape[1]) // _WIDTH_PX)
