"""The teacher: exact where its terms hold, even light from one press, and what GelNet gains by it."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gelnet import train as train_main
from gelnet.recipes import RECIPES
from gelnet.steeper import steeper_rows
from gelnet.table import Table, TableError, load_table
from gelnet.teacher import fit_teacher, unlikeness, with_taught
from gelnet.train import _taught
from gelnet.trainers import make_trainer
from gelnet.training import normal_error_deg, train

WIDTH, HEIGHT = 160, 120
UNTOUCHED = np.full((HEIGHT, WIDTH, 3), 100, np.float32)
LIGHTS = np.array([[1.0, 0.0], [-0.5, 0.87], [-0.5, -0.87]])


def presses(count: int, *, bright: np.ndarray | None = None, seed: int = 3, turned_deg: float = 0.0) -> Table:
    """Presses of 15 px on a sensor whose colours are linear in the angle of the slope, and as bright as it is lit.

    turned_deg: by which its lights are turned.
    """
    random, light = np.random.default_rng(seed), UNTOUCHED if bright is None else bright
    cos, sin = np.cos(np.radians(turned_deg)), np.sin(np.radians(turned_deg))
    turn, parts = np.array([[cos, -sin], [sin, cos]]), []
    for centre in random.uniform([20, 20], [WIDTH - 20, HEIGHT - 20], (count, 2)):
        places = np.rint(centre + random.uniform(-15, 15, (500, 2))).clip(0, [WIDTH - 1, HEIGHT - 1])
        angles = (centre - places) / 30
        colours = 80 * angles @ (LIGHTS @ turn).T * light[places[:, 1].astype(int), places[:, 0].astype(int)] / 100
        parts.append(np.concatenate([colours, places, np.tan(angles)], axis=1))
    rows = np.concatenate(parts).astype(np.float32)
    image = np.repeat(np.arange(count, dtype=np.int32), 500)
    return Table(rows=rows, image=image, image_size=(WIDTH, HEIGHT), untouched=light)


def error(taught: Table, judged: Table) -> float:
    assert taught.untouched is not None
    answer = fit_teacher(taught, taught.untouched).answer(judged.pixels)
    return float(np.abs(np.arctan(answer) - np.arctan(judged.gradient)).mean())


def test_few_presses_teach_a_sensor_that_is_even_and_more_teach_it_better() -> None:
    judged = presses(20, seed=4)
    errors = [error(presses(count), judged) for count in (1, 2, 30)]
    assert errors == sorted(errors, reverse=True)
    assert errors[0] < 0.06
    assert errors[1] < 0.01
    assert errors[2] < 0.001


def test_the_untouched_picture_tells_where_the_light_is_bright() -> None:
    ramp = UNTOUCHED * np.linspace(0.5, 1.5, WIDTH, dtype=np.float32)[None, :, None]
    known, judged = presses(2, bright=ramp), presses(20, bright=ramp, seed=4)
    assert error(known, judged) < 0.01
    assert error(replace(known, untouched=UNTOUCHED), judged) > 0.015


def test_a_like_unit_helps_one_press_and_no_longer_many() -> None:
    like, judged = presses(30, seed=9, turned_deg=4), presses(20, seed=4)
    alone, helped = (error(table, judged) for table in (presses(1), replace(presses(1), like=like)))
    assert helped < 0.5 * alone
    assert helped < 0.5 * error(like, judged)
    assert error(replace(presses(30), like=like), judged) < 0.001


def test_a_unit_that_is_not_alike_shows_itself(tmp_path: Path) -> None:
    told = {turn: unlikeness(replace(presses(2), like=presses(30, turned_deg=turn)), UNTOUCHED) for turn in (0, 10, 60)}
    assert told[0] < 0.01
    assert told[10] == pytest.approx(np.radians(10), rel=0.1)  # slopes turn with the lights
    assert told[60] == pytest.approx(1, rel=0.1)
    other, own = presses(30, turned_deg=60), presses(2)
    arrays = {"rows": own.rows, "image": own.image, "image_size": own.image_size, "untouched": UNTOUCHED}
    np.savez(tmp_path / "t.npz", **arrays, like_rows=other.rows, like_image=other.image)
    table = load_table(tmp_path / "t.npz")
    assert table.like is not None
    assert (table.like.rows == other.rows).all()
    with pytest.raises(TableError, match=r"off by (0\.9|1\.0)\d of the slopes of these presses"):
        train_main.run(train_main._arguments(["--table", str(tmp_path / "t.npz"), "--out", "x", "--trainer", "numpy"]))


def test_no_change_of_colour_is_no_slope_and_none_is_too_steep() -> None:
    teacher = fit_teacher(presses(3), UNTOUCHED)
    nothing, much = np.zeros((2, 5), np.float32), np.full((1, 5), 50, np.float32)
    assert (teacher.answer(nothing) == 0).all()
    much[:, :3] = [250, -250, 250]
    assert np.isfinite(teacher.answer(much)).all()


def test_what_is_taught_lies_all_over_the_gel_but_near_the_presses() -> None:
    table = presses(2)
    taught = with_taught(table, UNTOUCHED, np.random.default_rng(0))
    new = taught.rows[len(table.rows) :]
    assert len(taught.image) == len(taught.rows)
    assert len(table.rows) / 2 < len(new) < 1.3 * len(table.rows)
    assert (new[:, 3:5].min(axis=0) < 3).all()
    assert (new[:, 3:5].max(axis=0) > [WIDTH - 4, HEIGHT - 4]).all()
    for number in (0, 1):
        centre = table.rows[table.image == number, 3:5].mean(axis=0)
        assert np.linalg.norm(new[:, 3:5] - centre, axis=1).min() > 20


def test_gelnet_of_two_presses_is_right_elsewhere() -> None:
    table, judged = presses(2), presses(20, seed=4)
    recipe = replace(RECIPES["fast"], least_visits=200_000, place_jitter=0.0)
    alone, helped = (
        normal_error_deg(train(rows, recipe, make_trainer("numpy", seed=0), width=16).network, judged)["mean"]
        for rows in (table, with_taught(table, UNTOUCHED, np.random.default_rng(0)))
    )
    assert helped < 3
    assert helped < alone / 2


# ---- slopes steeper than any press ----

WIDTH, HEIGHT = 160, 120
WALL_LIGHTS = np.array([[0.6, 0.0, 0.8], [-0.3, 0.52, 0.8], [-0.3, -0.52, 0.8]])
"""towards red, green and blue: none is behind a wall that leans by less than 53 degrees"""


def matt(slopes: np.ndarray, places: np.ndarray) -> np.ndarray:
    """(N, 3) change of colour by Lambert's law under even light that grows by half over the width."""
    upright = 1 / np.sqrt(1 + (slopes**2).sum(axis=1))
    normals = np.stack([-slopes[:, 0] * upright, -slopes[:, 1] * upright, upright - 1], axis=1)
    return np.asarray(100 * normals @ WALL_LIGHTS.T * (1 + places[:, :1] / WIDTH / 2))


def rims(steepest: float, count: int = 12) -> Table:
    """Presses of a ball whose rim slopes by `steepest`, on a sensor with a matt gel."""
    random, parts = np.random.default_rng(5), []
    for centre in random.uniform([20, 20], [WIDTH - 20, HEIGHT - 20], (count, 2)):
        places = np.rint(centre + random.uniform(-14, 14, (500, 2))).clip(0, [WIDTH - 1, HEIGHT - 1])
        slopes = (centre - places) / 20 * steepest
        parts.append(np.concatenate([matt(slopes, places), places, slopes], axis=1, dtype=np.float32))
    image = np.repeat(np.arange(count, dtype=np.int32), 500)
    return Table(rows=np.concatenate(parts), image=image, image_size=(WIDTH, HEIGHT), untouched=UNTOUCHED)


def test_colours_of_steeper_slopes_are_those_of_a_matt_surface() -> None:
    table = rims(0.5)
    steeper = steeper_rows(table, UNTOUCHED, np.random.default_rng(0))
    slope = np.hypot(*steeper.gradient.T)
    assert 450 < len(steeper.rows) < 600  # a tenth of 6000, less those whose colours presses have
    apart = np.linalg.norm(steeper.pixels[:, None, :3] - table.pixels[None, ::7, :3], axis=2).min(axis=1)
    assert apart.min() > 7.9
    assert 0.4 < slope.min() < 0.6
    assert 1.9 < slope.max() <= np.tan(1.1) + 1e-5
    right = matt(steeper.gradient.astype(float), steeper.pixels[:, 3:5].astype(float))
    lit = right > -UNTOUCHED[0, 0]
    np.testing.assert_allclose(steeper.pixels[:, :3][lit], right[lit], atol=0.5)


def test_what_a_touch_changes_whatever_the_slope_does_not_grow_with_the_slope() -> None:
    touched = rims(0.5)
    touched.rows[:, :3] -= 6 + 4 * touched.pixels[:, 3:4] / WIDTH
    steeper = steeper_rows(touched, UNTOUCHED, np.random.default_rng(0))
    places = steeper.pixels[:, 3:5].astype(float)
    right = matt(steeper.gradient.astype(float), places) - 6 - 4 * places[:, :1] / WIDTH
    lit = right > -UNTOUCHED[0, 0]
    np.testing.assert_allclose(steeper.pixels[:, :3][lit], right[lit], atol=0.5)


def test_light_that_a_slope_turns_away_from_fades_before_it_is_gone() -> None:
    def half_lit(slopes: np.ndarray) -> np.ndarray:
        upright = 1 / np.sqrt(1 + (slopes**2).sum(axis=1))
        normals = np.stack([-slopes[:, 0] * upright, -slopes[:, 1] * upright, upright], axis=1)
        low = WALL_LIGHTS * [1.2, 1.2, 0.4]  # behind a wall that leans by 24 to 28 degrees
        return np.asarray(100 * (np.maximum(normals @ low.T, 0) - low[:, 2]))

    table = rims(0.8)
    table.rows[:, :3] = half_lit(table.gradient.astype(float))
    steeper = steeper_rows(table, UNTOUCHED, np.random.default_rng(0))
    right = half_lit(steeper.gradient.astype(float))
    # A plane through the same pixels, Lambert's law, is off by 12.6 grey levels.
    assert float(np.sqrt(((steeper.pixels[:, :3] - right) ** 2).mean())) < 11.5


def test_no_colour_is_darker_than_black_or_brighter_than_white() -> None:
    table = rims(0.5)
    dim = UNTOUCHED * 0.3
    steeper = steeper_rows(replace(table, untouched=dim), dim, np.random.default_rng(0))
    assert steeper.pixels[:, :3].min() == pytest.approx(-30, abs=1e-4)
    bright = UNTOUCHED * 2.3
    steeper = steeper_rows(replace(table, untouched=bright), bright, np.random.default_rng(0))
    assert steeper.pixels[:, :3].max() == pytest.approx(25, abs=1e-4)


def test_a_gel_at_rest_and_walls_that_are_learnt_already_have_none() -> None:
    flat = rims(0.0, count=2)
    assert len(steeper_rows(flat, UNTOUCHED, np.random.default_rng(0)).rows) == 0
    walls = rims(0.5, count=2)
    walls.rows[:, 5:] = [2.0, 0.0]  # 63.4 degrees; 1.1 rad are 63.0
    assert len(steeper_rows(walls, UNTOUCHED, np.random.default_rng(0)).rows) == 0


@pytest.mark.parametrize(("taught", "least", "most"), [(True, 0.7, 1.1), (False, 0.2, 0.6)])
def test_a_wall_twice_as_steep_as_the_presses_is_answered(taught: bool, least: float, most: float) -> None:
    table, recipe = rims(0.4), replace(RECIPES["fast"], epochs=40, least_visits=0)
    rows, how = _taught(table, recipe, seed=0) if taught else (table, replace(recipe, place_jitter=0.0))
    network = train(rows, how, make_trainer("numpy", seed=0, threads=1), width=16).network
    random = np.random.default_rng(1)
    places, angle = random.uniform(30, 90, (500, 2)), random.uniform(0, 2 * np.pi, 500)
    walls = 1.0 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    pixels = np.concatenate([matt(walls, places), places], axis=1, dtype=np.float32)
    found = np.hypot(*network.answer(pixels).T)
    assert least < float(np.median(found)) < most
