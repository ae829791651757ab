"""Circles that were drawn by hand come to lie where the picture of each shows its edge, alone."""

from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np
import pytest

from gellight.lab.training.labelling.pattern import PressShape, response
from gellight.lab.training.labelling.refinement import refine
from gellight.lab.training.presses import Ball, Press

SHAPE = (160, 200)
BALL = Ball(radius_mm=4.0, pixel_size_mm=0.12)
REFERENCE = np.full((*SHAPE, 3), 120.0)
LIGHTS = np.array([[80.0, -40, -40], [0, 70, -70], [-20, -25, -15]])


def photograph(x: float, y: float, radius: float, random: np.random.Generator) -> np.ndarray:
    rows, columns = (axis.ravel().astype(float) for axis in np.indices(SHAPE))
    shape = PressShape(center_x=x, center_y=y, contact_radius=radius, step_length=5.0, skirt_length=30.0)
    colour = response(columns, rows, shape, BALL.radius_px)[:, :3] @ LIGHTS * (1 + 0.3 * columns[:, None] / 200)
    grey = REFERENCE + colour.reshape(*SHAPE, 3) + random.normal(0, 1, (*SHAPE, 3))
    return np.clip(np.round(grey), 0, 255).astype(np.uint8)


@pytest.fixture(scope="module")
def truth(tmp_path_factory: pytest.TempPathFactory) -> list[Press]:
    folder, random = tmp_path_factory.mktemp("presses"), np.random.default_rng(0)
    presses = []
    for number in range(10):
        x, y, radius = random.uniform([50, 45, 14], [150, 115, 24])
        path = folder / f"{number}.png"
        cv2.imwrite(str(path), photograph(x, y, radius, random)[..., ::-1])
        presses.append(Press(image=path, center_x_px=x, center_y_px=y, contact_radius_px=radius))
    return presses


def drawn(presses: list[Press], *, common: tuple[float, float] = (0.0, 0.0), wider: float = 1.0) -> list[Press]:
    """Labels as a hand makes them: each a few pixels off, and all of them by something."""
    off = np.random.default_rng(1).normal(0, 3, (len(presses), 2)) + common
    return [
        replace(
            press,
            center_x_px=press.center_x_px + dx,
            center_y_px=press.center_y_px + dy,
            contact_radius_px=wider * press.contact_radius_px,
        )
        for press, (dx, dy) in zip(presses, off.tolist(), strict=True)
    ]


def circles(presses: Sequence[Press]) -> np.ndarray:
    return np.array([(press.center_x_px, press.center_y_px, press.contact_radius_px) for press in presses])


def test_what_a_hand_drew_beside_and_too_wide_is_put_right_also_where_all_circles_share_it(truth: list[Press]) -> None:
    labels = drawn(truth, common=(2.0, -1.5), wider=1.14)
    refined = refine(labels, REFERENCE, BALL)
    np.testing.assert_allclose(circles(refined.presses), circles(truth), atol=0.6)
    assert all(press.found for press in refined.presses)
    told = refined.record()
    off = (circles(labels) - circles(truth))[:, :2]
    assert told["rms_shift_px"] == pytest.approx(np.sqrt((off**2).sum(axis=1).mean()), abs=0.3)
    np.testing.assert_allclose(told["mean_shift_px"], -off.mean(axis=0), atol=0.3)
    assert told["radius_of_light_over_label"] == pytest.approx(1 / 1.14, abs=0.02)
    assert told["kept_images"] == []


def test_a_circle_is_found_without_the_other_presses(truth: list[Press]) -> None:
    labels = drawn(truth)
    (alone,) = refine(labels[4:5], REFERENCE, BALL).presses
    assert alone == refine(labels, REFERENCE, BALL).presses[4]


def test_a_circle_that_is_nowhere_near_a_press_is_kept_and_named(truth: list[Press]) -> None:
    labels = drawn(truth[:4])
    labels[3] = replace(labels[3], center_x_px=labels[3].center_x_px + 25.0)
    refined = refine(labels, REFERENCE, BALL)
    assert refined.kept == ["3.png"]
    assert refined.presses[3] is labels[3]
    np.testing.assert_allclose(circles(refined.presses)[:3], circles(truth)[:3], atol=0.6)


def test_a_circle_without_a_clear_ball_is_kept_and_counts_as_drawn(
    truth: list[Press], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("gellight.lab.training.labelling.refinement.LEAST_QUALITY", 1.0)
    labels = drawn(truth[:2])
    refined = refine(labels, REFERENCE, BALL)
    assert refined.presses == labels
    assert refined.kept == ["0.png", "1.png"]
