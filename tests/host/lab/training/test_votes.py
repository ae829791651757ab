"""Labels judged without the truth: those that lie right win, and a shift that all share changes nothing."""

from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np
import pytest

from gellight.base.errors import InputError
from gellight.lab.training.presses import Ball, Press, contact_circle, sphere_gradient
from gellight.lab.training.votes import votes_apart_deg
from tests.helpers.linear_sensor import GREY_PER_SLOPE

SHAPE, BALL = (96, 128), Ball(radius_mm=4.0, pixel_size_mm=0.1)
REFERENCE = np.full((*SHAPE, 3), 120, np.float32)
RANDOM = np.random.default_rng(4)


@pytest.fixture(scope="module")
def truth(tmp_path_factory: pytest.TempPathFactory) -> list[Press]:
    folder, presses = tmp_path_factory.mktemp("presses"), []
    for number in range(8):
        x, y = RANDOM.uniform((30, 30), (98, 66)).tolist()
        press = Press(image=folder / f"{number}.png", center_x_px=x, center_y_px=y, contact_radius_px=24.0)
        slope = np.where(contact_circle(press, SHAPE)[..., None], sphere_gradient(press, BALL, SHAPE), 0.0)
        grey = 120 + slope @ GREY_PER_SLOPE.T + RANDOM.normal(0, 0.5, (*SHAPE, 3))
        cv2.imwrite(str(press.image), np.clip(np.rint(grey), 0, 255).astype(np.uint8)[..., ::-1])
        presses.append(press)
    return presses


def moved(presses: Sequence[Press], moves: np.ndarray) -> list[Press]:
    return [
        replace(press, center_x_px=press.center_x_px + x, center_y_px=press.center_y_px + y)
        for press, (x, y) in zip(presses, moves.tolist(), strict=True)
    ]


def apart(*labels: Sequence[Press]) -> np.ndarray:
    return votes_apart_deg(labels, REFERENCE, BALL, follow_light=False).mean(axis=1)


def test_labels_that_lie_right_win_however_little_the_others_are_off(truth: list[Press]) -> None:
    random = RANDOM.normal(0, 1, (len(truth), 2))
    right, near, off = apart(truth, moved(truth, 0.5 * random), moved(truth, 3 * random))
    assert right < 1.5
    assert right < near < off


def test_what_each_label_says_of_its_own_press_is_not_believed(truth: list[Press]) -> None:
    """A press whose own label is moved is felt as before, by the others, and they are felt worse."""
    moves = np.zeros((len(truth), 2))
    moves[0] = 4.0
    labels = [truth, moved(truth, moves)]
    by_press = votes_apart_deg(labels, REFERENCE, BALL, follow_light=False)
    assert by_press[1, 0] == pytest.approx(by_press[0, 0], abs=1e-6)
    assert (by_press[1, 1:] > by_press[0, 1:]).all()


def test_one_press_is_refused(truth: list[Press]) -> None:
    with pytest.raises(InputError, match=r"1 press: .* give at least two"):
        apart(truth[:1])
