"""Labels that the other presses and their picture contradict are named."""

from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np
import pytest

from gellight.lab.training.label_file import read_presses
from gellight.lab.training.presses import Ball, Press, contact_circle, sphere_gradient
from gellight.lab.training.training import Reference, read_reference
from gellight.lab.training.wrong_labels import CONTRADICTED, contradicted_lines, sorted_out, wrong_labels
from tests.helpers.linear_sensor import GREY_PER_SLOPE
from tests.helpers.places import real

SHAPE, BALL, RADIUS_PX = (96, 128), Ball(radius_mm=4.0, pixel_size_mm=0.1), 24.0
REFERENCE = Reference(image=np.full((*SHAPE, 3), 120, np.float32), frames=8, noise_grey=0.5)


@pytest.fixture(scope="module")
def truth(tmp_path_factory: pytest.TempPathFactory) -> list[Press]:
    folder, presses, random = tmp_path_factory.mktemp("presses"), [], np.random.default_rng(4)
    for number in range(12):
        x, y = random.uniform((30, 30), (98, 66)).tolist()
        press = Press(image=folder / f"{number}.png", center_x_px=x, center_y_px=y, contact_radius_px=RADIUS_PX)
        slope = np.where(contact_circle(press, SHAPE)[..., None], sphere_gradient(press, BALL, SHAPE), 0.0)
        grey = 120 + slope @ GREY_PER_SLOPE.T + random.normal(0, 0.5, (*SHAPE, 3))
        cv2.imwrite(str(press.image), np.clip(np.rint(grey), 0, 255).astype(np.uint8)[..., ::-1])
        presses.append(press)
    return presses


def with_moved(presses: Sequence[Press], moves: dict[int, tuple[float, float]]) -> list[Press]:
    return [
        replace(press, center_x_px=press.center_x_px + x, center_y_px=press.center_y_px + y)
        for number, press in enumerate(presses)
        for x, y in [moves.get(number, (0.0, 0.0))]
    ]


def named(presses: Sequence[Press]) -> list[str]:
    return [one.press.image.name for one in wrong_labels(presses, REFERENCE, BALL)]


@pytest.mark.parametrize("share", [0.3, 0.6])
def test_a_label_beside_its_ball_is_named_with_its_distance_and_no_other(truth: list[Press], share: float) -> None:
    (wrong,) = wrong_labels(with_moved(truth, {3: (share * RADIUS_PX, 0.0)}), REFERENCE, BALL)
    assert wrong.press.image.name == "3.png"
    assert float(wrong.why.split(" px from it")[0].split()[-1]) == pytest.approx(share * RADIUS_PX, abs=1.5)
    x, y = (float(text) for text in wrong.why.split("around (")[1].split(")")[0].split(","))
    assert (x, y) == pytest.approx((truth[3].center_x_px, truth[3].center_y_px), abs=1.5)


def test_labels_that_lie_right_or_a_tenth_of_a_radius_beside_are_not_named(truth: list[Press]) -> None:
    assert named(truth) == []
    assert named(with_moved(truth, {number: (2.4 * (-1) ** number, 0.0) for number in range(12)})) == []


def test_a_circle_on_untouched_gel_is_no_ball_to_the_others(truth: list[Press]) -> None:
    far = replace(truth[5], center_x_px=12.0 if truth[5].center_x_px > 64 else 116.0, center_y_px=10.0)
    (wrong,) = wrong_labels([*truth[:5], far, *truth[6:]], REFERENCE, BALL)
    assert wrong.press is far
    assert "see no ball in its circle" in wrong.why


def test_what_is_wrong_does_not_vouch_for_what_is_wrong(truth: list[Press]) -> None:
    wrong = named(with_moved(truth, dict.fromkeys((1, 6, 9), (10.0, 0.0))))
    assert sorted(wrong) == ["1.png", "6.png", "9.png"]


def test_with_few_presses_the_picture_has_to_contradict_too(truth: list[Press]) -> None:
    some = truth[:5]
    assert named(some) == []
    assert named(with_moved(some, {2: (0.0, 12.0)})) == ["2.png"]
    assert named(with_moved(some[:2], {1: (0.0, 12.0)})) == []


def test_the_contradicted_are_left_out_or_kept_and_told_in_both_cases(truth: list[Press]) -> None:
    labelled = with_moved(truth, {3: (12.0, 0.0)})
    for keep, count, word in ((False, 11, "LEFT OUT: 3.png"), (True, 12, "WRONG LABEL: 3.png")):
        learnt, told = sorted_out(labelled, REFERENCE, BALL, keep=keep)
        assert (len(learnt), labelled[3] in learnt) == (count, keep)
        (line,) = contradicted_lines(told)
        assert line.startswith(word)
        assert ("--keep" in line) is not keep
    assert sorted_out(truth, REFERENCE, BALL) == (truth, {})


def test_where_over_a_third_is_contradicted_nobody_is_left_out(truth: list[Press]) -> None:
    labelled = with_moved(truth, dict.fromkeys((0, 2, 4, 6, 8), (0.5 * RADIUS_PX, 0.0)))
    learnt, told = sorted_out(labelled, REFERENCE, BALL)
    assert learnt == labelled
    assert all(one["kept"] for one in told[CONTRADICTED])  # type: ignore[attr-defined]


@pytest.mark.real_images("skleff_mini_ball")
def test_the_one_wrong_label_of_a_real_set_is_named() -> None:
    folder, ball = real("skleff_mini_ball"), Ball(radius_mm=4.735, pixel_size_mm=0.0634)
    reference = read_reference(folder / "background.png")
    labelled = read_presses(folder / "presses.csv", ball=ball, image_shape=reference.image_shape)
    (wrong,) = wrong_labels(labelled, reference, ball)
    assert wrong.press.image.name == "0050.png"
    assert "around (174, 66) px, 85 px from it" in wrong.why
