"""Any lights, from balls: exact where the model holds, and on pictures of a real sensor under six single lights."""

from contextlib import nullcontext
from pathlib import Path
from unittest.mock import Mock

import numpy as np
import pytest

from gellight.base.errors import InputError
from gellight.lab.optics.lights import ball_lights
from gellight.lab.optics.lights.ball_lights import check_lights, lights_from_balls
from gellight.lab.optics.lights.ball_series import BallSeries, divided
from gellight.lab.training.presses import Ball, Press, contact_circle, sphere_gradient
from gellight.photometric.directions import view_places
from gellight.reconstruction.integration import normals

SHAPE = (150, 200)
BALL = Ball(radius_mm=2.0, pixel_size_mm=0.1)
PRESSES = [
    Press(image=Path(f"{x}-{y}.png"), center_x_px=x, center_y_px=y, contact_radius_px=15.0)
    for y in (30.0, 75.0, 120.0)
    for x in (35.0, 100.0, 165.0)
]


def surface(presses: list[Press]) -> np.ndarray:
    """(H, W, 3) normals of balls pressed into a flat gel."""
    gradient = np.zeros((*SHAPE, 2), np.float32)
    for press in presses:
        inside = contact_circle(press, SHAPE)
        gradient[inside] = sphere_gradient(press, BALL, SHAPE)[inside]
    return normals(gradient)


def series(levels: np.ndarray, presses: list[Press]) -> BallSeries:
    return BallSeries(levels=levels, presses=tuple(presses))


def shaded(vectors: np.ndarray, normal: np.ndarray, untouched: np.ndarray, noise: float = 0.3) -> np.ndarray:
    places = view_places(SHAPE, np.arange(SHAPE[0] * SHAPE[1]))
    lights = np.einsum("kij,jn->kin", vectors, places).reshape(len(vectors), 3, *SHAPE)
    grey = untouched * np.einsum("kihw,hwi->khw", lights, normal)
    return np.asarray(grey + np.random.default_rng(0).normal(0, noise, grey.shape), np.float32)


@pytest.fixture(scope="module")
def vectors() -> np.ndarray:
    """Five lights at no regular azimuths, of which two are low, all changing over the view."""
    middles = np.array([[0.5, 0.1, 1], [0.2, -0.6, 1], [-0.7, -0.2, 1], [-0.3, 0.5, 1], [0.35, 0.4, 1]])
    over_the_view = np.random.default_rng(1).normal(0, 0.06, (5, 3, 2)) * [[1], [1], [0]]
    return np.concatenate([middles[..., None], over_the_view], axis=2)


def test_lights_of_any_number_and_place_are_found_and_balls_felt(vectors: np.ndarray) -> None:
    rows, columns = np.indices(SHAPE)
    untouched = np.stack([80 + 0.2 * k * columns + 0.1 * rows for k in range(5)]).astype(np.float32)
    pictures = shaded(vectors, surface(PRESSES), untouched)
    lights = lights_from_balls([series(pictures, PRESSES[1:])], untouched, BALL, 0.3)
    np.testing.assert_allclose(lights.vectors, vectors, atol=0.03)
    judged = check_lights(lights, [series(pictures, PRESSES[:1])], BALL)
    assert judged.normal_deg < 0.6
    assert judged.felt_radius_mm == pytest.approx(2.0, rel=0.01)


def test_several_series_of_one_ball_each_say_the_same_as_one_picture_of_all(vectors: np.ndarray) -> None:
    untouched = np.full((5, *SHAPE), 100, np.float32)
    apart = [series(shaded(vectors, surface([press]), untouched), [press]) for press in PRESSES]
    lights = lights_from_balls(apart[1:], untouched, BALL, 0.3)
    np.testing.assert_allclose(lights.vectors, vectors, atol=0.03)
    learnt, judging = divided(apart)
    assert [one.presses[0] for one in judging] == [PRESSES[0], PRESSES[4], PRESSES[8]]
    assert len(learnt) == 6
    with pytest.raises(InputError, match="give at least 6"):
        divided(apart[:4])


def test_lights_that_do_not_explain_the_balls_are_refused(vectors: np.ndarray) -> None:
    untouched = np.full((5, *SHAPE), 100, np.float32)
    pictures = shaded(vectors, surface(PRESSES), untouched)
    lights = lights_from_balls([series(pictures, PRESSES[1:])], untouched, BALL, 0.3)
    with pytest.raises(InputError, match="degrees off, 12 are allowed"):
        check_lights(lights, [series(pictures[[1, 0, 3, 2, 4]], PRESSES[:1])], BALL)
    with pytest.raises(InputError, match="at least 3 lights"):
        lights_from_balls([series(pictures[:2], PRESSES)], untouched[:2], BALL, 0.3)
    with pytest.raises(InputError, match="too few to find lights by"):
        lights_from_balls([series(pictures, PRESSES[:3])], untouched, BALL, 0.3)
    assert len(lights_from_balls([series(pictures, PRESSES[:4])], untouched, BALL, 0.3).vectors) == 5


@pytest.mark.parametrize(("lean", "enough"), [(0.095, False), (0.105, True)])
def test_lights_from_straight_above_are_refused(lean: float, enough: bool) -> None:
    untouched = np.full((3, *SHAPE), 100, np.float32)
    above = np.tile(np.array([[lean, 0, 0], [0, 0, 0], [1, 0, 0]]), (3, 1, 1))
    pictures = shaded(above, surface(PRESSES), untouched, noise=0.0)
    with nullcontext() if enough else pytest.raises(InputError, match="straight above"):
        assert len(lights_from_balls([series(pictures, PRESSES)], untouched, BALL, 0.3).vectors) == 3


@pytest.mark.parametrize(("normal_deg", "right"), [(11.9, True), (12.1, False)])
def test_held_out_balls_are_felt_within_twelve_degrees(
    normal_deg: float, right: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(ball_lights, "held_out", lambda *given: Mock(normal_deg=normal_deg))
    with nullcontext() if right else pytest.raises(InputError, match=r"felt 12\.1 degrees off"):
        assert check_lights(Mock(), [], BALL).normal_deg == normal_deg
