"""What a calibration says of itself: the true error first, and in words what is taken off another."""

from pathlib import Path

import numpy as np
import pytest

from gellight.lab.calibration.choices import Limits
from gellight.lab.calibration.records import CheckErrors, Fit, Verification
from gellight.lab.calibration.report import Example, _training, _verification, depth_tiles
from gellight.lab.calibration.state import CheckRecord
from gellight.lab.calibration.verifying import verdict_on
from gellight.lab.training.presses import Ball, Press, cap_depth_mm, contact_circle
from tests.helpers.tactile import tactile

BALL = Ball(radius_mm=4.0, pixel_size_mm=0.1)
SHAPE = (60, 80)
PRESS = Press(image=Path("a.png"), center_x_px=40.0, center_y_px=30.0, contact_radius_px=15.0)


def errors(depth_um: float, true_um: float | None) -> CheckErrors:
    true_mm = None if true_um is None else true_um / 1000
    return CheckErrors(depth_mm=depth_um / 1000, normal_deg=0.9, indentation_mm=1.0, true_depth_mm=true_mm)


def mean_of(each: list[CheckErrors]) -> Verification:
    true = [one.true_depth_mm for one in each if one.true_depth_mm is not None]
    return Verification(
        presses=len(each),
        depth_mm=float(np.mean([one.depth_mm for one in each])),
        normal_deg=0.9,
        indentation_mm=1.0,
        true_depth_mm=float(np.mean(true)) if true else None,
    )


def test_the_headline_is_the_true_error_with_its_worst_press_and_not_the_one_without_its_mean() -> None:
    each = [errors(3.5, 7.9), errors(11.1, 26.4), errors(6.6, 32.3)]
    first, second = depth_tiles(mean_of(each), each)
    assert first[0] == "22 µm"
    assert "against the simulator's truth" in first[1]
    assert "worst press 32 µm" in first[1]
    assert second[0] == "7 µm"
    assert "the mean error of each press is taken off" in second[1]


def test_without_a_truth_the_headline_says_what_is_taken_off() -> None:
    each = [errors(3.5, None), errors(11.1, None)]
    ((value, words),) = depth_tiles(mean_of(each), each)
    assert value == "7 µm"
    assert "shape of the depth" in words
    assert "the mean error of each press is taken off" in words
    assert "worst press 11 µm" in words


def test_the_verdict_leads_with_the_true_error_and_judges_it() -> None:
    figures = mean_of([errors(5.0, 12.6)])
    verdict = verdict_on(figures, Limits())
    assert (verdict.passed, verdict.depth_um) == (True, 12.6)
    assert "depth off by 13 µm on average in contact (5 µm with the mean error of each press taken off)" in verdict.text
    assert not verdict_on(figures, Limits(depth_mm=0.01)).passed
    assert not verdict_on(mean_of([errors(12.6, 5.0)]), Limits(depth_mm=0.01)).passed
    assert "shape of the depth off by 5 µm with the mean" in verdict_on(mean_of([errors(5.0, None)]), Limits()).text


def example(raised_mm: float) -> Example:
    """A press that feels as the ball, its rim so deep."""
    cap = np.nan_to_num(cap_depth_mm(PRESS, BALL, SHAPE))
    depth = np.where(contact_circle(PRESS, SHAPE), cap + raised_mm, 0).astype(np.float32)
    return Example(np.zeros((*SHAPE, 3), np.uint8), PRESS, tactile(depth), BALL)


@pytest.mark.parametrize("raised_mm", [0.0, 0.33])
def test_the_section_says_how_deep_the_rim_of_the_ball_is_felt(raised_mm: float) -> None:
    figures = errors(5.0, None)
    record = CheckRecord(number=1, file="checks/press-001.png", center_x_px=40, center_y_px=30, contact_radius_px=15,
                         figures=figures)  # fmt: skip
    words = _verification([record], mean_of([figures]), example(raised_mm))
    assert f"The rim of the ball is felt {1000 * raised_mm:.0f} µm deep" in words
    assert words.count("<figure") == 6


def test_a_press_that_was_left_out_is_named_with_the_reason() -> None:
    training = {"images": 9, "cpu_seconds": 1.0, "trainer": "numpy"}
    wrong = {"contradicted_labels": [{"image": "04.png", "why": "the ball lies 7 px <beside>", "kept": False}]}
    page = _training(Fit.model_validate({"training": training, "losses": [1.0, 0.5], **wrong}))
    assert "LEFT OUT: 04.png: the ball lies 7 px &lt;beside&gt;" in page
    assert "LEFT OUT" not in _training(Fit.model_validate({"training": training, "losses": [1.0, 0.5]}))
