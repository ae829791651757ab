"""The forms of the objects."""

import numpy as np
import pytest

from sim_reference.objects import OBJECT_NAMES, ObjectParameters, object_height

AXIS = np.linspace(-20, 20, 801)  # 0.05 mm
X, Y = AXIS[None, :], AXIS[:, None]


def height(name: str) -> np.ndarray:
    return object_height(name, X, Y)


def test_the_relief_follows_its_parameter() -> None:
    low = object_height("SINWAVE", X, Y, ObjectParameters(relief_mm=0.5))
    assert low[np.hypot(X, Y) < 17].min() == pytest.approx(-0.5, abs=2e-3)


def test_the_ball_is_a_sphere_of_4_mm() -> None:
    surface, r = height("BALL"), np.hypot(X, Y)
    on_ball = r < 3.9
    assert r[on_ball] ** 2 + (surface[on_ball] + 4) ** 2 == pytest.approx(np.full(on_ball.sum(), 16.0))


def test_the_crown_is_1_mm_high_over_a_base_of_2_mm() -> None:
    surface, r = height("SCROWN"), np.hypot(X, Y)
    assert (surface[(r > 2.01) & (r < 17)] == -1).all()
    assert (surface[r < 1.99] > -1).all()


def test_the_caves_are_the_balls_turned_inside_out() -> None:
    plate = np.hypot(X, Y) < 17
    assert (height("BALLVEX") + height("BALLCAVE"))[plate] == pytest.approx(np.full(plate.sum(), -1.0))


@pytest.mark.parametrize(("name", "at"), [("SINWAVE", 400), ("WAVE", 400)])
def test_waves_repeat_after_a_wavelength(name: str, at: int) -> None:
    profile = height(name)[at, 401:700]
    assert profile[50:] == pytest.approx(profile[:-50], abs=1e-9)  # 50 steps of 0.05 mm


def test_straight_waves_are_straight_and_circular_ones_round() -> None:
    inner = slice(300, 501)
    straight, round_ = height("SINWAVE")[inner, inner], height("WAVE")[inner, inner]
    assert (straight == straight[0]).all()
    assert round_ == pytest.approx(round_.T)
    assert round_ == pytest.approx(round_[::-1], abs=1e-9)


@pytest.mark.parametrize("name", OBJECT_NAMES)
def test_an_object_lies_the_same_on_a_coarse_grid(name: str) -> None:
    assert object_height(name, X[:, ::20], Y[::20]) == pytest.approx(height(name)[::20, ::20], abs=1e-9)


@pytest.mark.parametrize("name", OBJECT_NAMES)
def test_the_highest_point_is_0(name: str) -> None:
    fine = np.linspace(-2.5, 2.5, 2001)  # a crest, a ball or a polygon of each lies there
    assert -2e-3 < object_height(name, fine[None, :], fine[:, None]).max() <= 1e-9
