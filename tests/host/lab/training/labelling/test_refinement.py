"""Labels refined by what all presses share: random errors go, what is common stays, and nothing leaks."""

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from gellight.base.errors import InputError
from gellight.lab.training.labelling.pattern import PressShape, response
from gellight.lab.training.labelling.refinement import FirstFits, refine, refine_others
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


def clicked(presses: list[Press], *, common: tuple[float, float] = (0.0, 0.0), spread: float = 3.0) -> list[Press]:
    """Labels as a hand makes them: each a few pixels off, and all of them by something."""
    random = np.random.default_rng(1)
    off = random.normal(0, spread, (len(presses), 3))
    off -= off.mean(axis=0)
    return [
        replace(
            press,
            center_x_px=press.center_x_px + common[0] + dx,
            center_y_px=press.center_y_px + common[1] + dy,
            contact_radius_px=press.contact_radius_px + dr,
        )
        for press, (dx, dy, dr) in zip(presses, off, strict=True)
    ]


def circles(presses: list[Press]) -> np.ndarray:
    return np.array([(press.center_x_px, press.center_y_px, press.contact_radius_px) for press in presses])


def test_random_errors_of_the_labels_are_taken_off(truth: list[Press]) -> None:
    labels = clicked(truth)
    refined = refine(labels, REFERENCE, BALL)
    assert np.hypot(*(circles(labels) - circles(truth))[:, :2].T).mean() > 2.5
    assert np.abs(circles(refined.presses) - circles(truth)).max() < 0.6
    assert refined.rms_shift_px == pytest.approx(np.sqrt(2) * 3, rel=0.4)
    assert refined.kept == []


def test_a_shift_that_all_labels_share_stays_as_labelled(truth: list[Press]) -> None:
    labels = clicked(truth, common=(2.0, -1.5))
    refined = refine(labels, REFERENCE, BALL)
    shared = circles(refined.presses).mean(axis=0) - circles(labels).mean(axis=0)
    np.testing.assert_allclose(shared[:2], 0, atol=1e-6)
    np.testing.assert_allclose(refined.offset, [-2.0, 1.5, 0.0], atol=0.4)


def test_the_radius_is_the_lights_where_the_hand_drew_all_circles_too_wide(truth: list[Press]) -> None:
    labels = [replace(press, contact_radius_px=1.14 * press.contact_radius_px) for press in clicked(truth, spread=1.0)]
    refined = refine(labels, REFERENCE, BALL)
    ratio = circles(refined.presses)[:, 2] / circles(truth)[:, 2]
    np.testing.assert_allclose(ratio, 1.0, atol=0.03)
    assert refined.record()["radius_of_light_over_label"] == pytest.approx(1 / 1.14, abs=0.02)
    assert refined.record()["radius_by_light_images"] == len(truth)


def test_the_mean_radius_stays_as_labelled_where_no_clear_ball_is_seen(
    truth: list[Press], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("gellight.lab.training.labelling.refinement.LEAST_QUALITY", 1.0)
    labels = [replace(press, contact_radius_px=1.14 * press.contact_radius_px) for press in truth]
    refined = refine(labels, REFERENCE, BALL)
    assert circles(refined.presses)[:, 2].mean() == pytest.approx(circles(labels)[:, 2].mean())
    assert refined.record()["radius_by_light_images"] == 0


def test_a_circle_that_is_nowhere_near_a_press_is_kept_and_named(truth: list[Press]) -> None:
    labels = clicked(truth, spread=1.0)
    labels[3] = replace(labels[3], center_x_px=labels[3].center_x_px + 25.0)
    refined = refine(labels, REFERENCE, BALL)
    assert refined.kept == ["3.png"]
    assert refined.presses[3] == labels[3]
    others = [n for n in range(10) if n != 3]
    assert np.abs(circles(refined.presses) - circles(truth))[others, :2].max() < 1.2


def test_a_held_out_label_is_refined_by_a_response_that_never_saw_its_image(truth: list[Press]) -> None:
    labels = clicked(truth)
    refined = refine(labels[:7], REFERENCE, BALL)
    coefficients = refined.coefficients.copy()
    others = refine_others(refined, labels[7:], REFERENCE, BALL)
    np.testing.assert_array_equal(refined.coefficients, coefficients)
    shared = (circles(labels[:7]) - circles(truth[:7])).mean(axis=0)
    assert np.abs(circles(others) - shared - circles(truth[7:])).max() < 0.8
    # One by one or together: they do not learn from each other either.
    np.testing.assert_allclose(circles(others)[1], circles(refine_others(refined, [labels[8]], REFERENCE, BALL))[0])


def test_a_response_is_never_learnt_from_the_image_it_corrects(
    truth: list[Press], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import gellight.lab.training.labelling.refinement as refinement

    solved: list[np.ndarray] = []
    solve = refinement._solve
    monkeypatch.setattr(
        refinement, "_solve", lambda square, right, count: solved.append(square.copy()) or solve(square, right, count)
    )
    monkeypatch.setattr(refinement, "_ROUNDS", 1)
    refine(truth, REFERENCE, BALL)
    *others, _ = solved
    assert len(others) == len(truth)
    # Summed over all, each image is counted once less than there are images: that mean is what all of them say.
    assert all(np.trace(square) < 0.99 * np.trace(sum(others)) / (len(truth) - 1) for square in others)


def test_few_presses_refine_each_other_under_light_that_changes_over_the_view(truth: list[Press]) -> None:
    refined = refine(clicked(truth[:5]), REFERENCE, BALL)
    off = circles(refined.presses) - circles(truth[:5])
    assert np.abs(off[:, :2] - off[:, :2].mean(axis=0)).max() < 0.5


def test_each_radius_is_that_of_its_own_image_times_what_all_have_in_common(truth: list[Press]) -> None:
    labels = clicked(truth)
    first = FirstFits(REFERENCE, BALL)
    refined = refine(labels, REFERENCE, BALL, first=first)
    alone = [first.of(press).shape.contact_radius for press in labels]
    np.testing.assert_allclose(circles(refined.presses)[:, 2] / alone, refined.alone_share)
    assert refined.alone_share == pytest.approx(1.0, abs=0.02)


def test_too_few_presses_cannot_vouch_for_each_other(truth: list[Press]) -> None:
    with pytest.raises(InputError, match="4 presses cannot be refined: give at least 5"):
        refine(truth[:4], REFERENCE, BALL)
