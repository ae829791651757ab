"""Slopes steeper than any press: exact for a matt surface, and what GelNet answers with and without them."""

from dataclasses import replace

import numpy as np
import pytest

from gelnet.recipes import RECIPES
from gelnet.steeper import steeper_rows
from gelnet.table import Table
from gelnet.train import _taught
from gelnet.trainers import make_trainer
from gelnet.training import train

WIDTH, HEIGHT = 160, 120
UNTOUCHED = np.full((HEIGHT, WIDTH, 3), 100, np.float32)
LIGHTS = np.array([[0.6, 0.0, 0.8], [-0.3, 0.52, 0.8], [-0.3, -0.52, 0.8]])
"""towards red, green and blue: none is behind a wall that leans by less than 53 degrees"""


def matt(slopes: np.ndarray, places: np.ndarray) -> np.ndarray:
    """(N, 3) change of colour by Lambert's law under even light that grows by half over the width."""
    upright = 1 / np.sqrt(1 + (slopes**2).sum(axis=1))
    normals = np.stack([-slopes[:, 0] * upright, -slopes[:, 1] * upright, upright - 1], axis=1)
    return np.asarray(100 * normals @ LIGHTS.T * (1 + places[:, :1] / WIDTH / 2))


def presses(steepest: float, count: int = 12) -> Table:
    """Presses of a ball whose rim slopes by `steepest`, on a sensor with a matt gel."""
    random, parts = np.random.default_rng(5), []
    for centre in random.uniform([20, 20], [WIDTH - 20, HEIGHT - 20], (count, 2)):
        places = np.rint(centre + random.uniform(-14, 14, (500, 2))).clip(0, [WIDTH - 1, HEIGHT - 1])
        slopes = (centre - places) / 20 * steepest
        parts.append(np.concatenate([matt(slopes, places), places, slopes], axis=1, dtype=np.float32))
    image = np.repeat(np.arange(count, dtype=np.int32), 500)
    return Table(rows=np.concatenate(parts), image=image, image_size=(WIDTH, HEIGHT), untouched=UNTOUCHED)


def test_colours_of_steeper_slopes_are_those_of_a_matt_surface() -> None:
    table = presses(0.5)
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


def test_no_colour_is_darker_than_black_or_brighter_than_white() -> None:
    table = presses(0.5)
    dim = UNTOUCHED * 0.3
    steeper = steeper_rows(replace(table, untouched=dim), dim, np.random.default_rng(0))
    assert steeper.pixels[:, :3].min() == pytest.approx(-30, abs=1e-4)
    bright = UNTOUCHED * 2.3
    steeper = steeper_rows(replace(table, untouched=bright), bright, np.random.default_rng(0))
    assert steeper.pixels[:, :3].max() == pytest.approx(25, abs=1e-4)


def test_a_gel_at_rest_and_walls_that_are_learnt_already_have_none() -> None:
    flat = presses(0.0, count=2)
    assert len(steeper_rows(flat, UNTOUCHED, np.random.default_rng(0)).rows) == 0
    walls = presses(0.5, count=2)
    walls.rows[:, 5:] = [2.0, 0.0]  # 63.4 degrees; 1.1 rad are 63.0
    assert len(steeper_rows(walls, UNTOUCHED, np.random.default_rng(0)).rows) == 0


@pytest.mark.parametrize(("taught", "least", "most"), [(True, 0.7, 1.1), (False, 0.2, 0.6)])
def test_a_wall_twice_as_steep_as_the_presses_is_answered(taught: bool, least: float, most: float) -> None:
    table, recipe = presses(0.4), replace(RECIPES["fast"], epochs=40, least_visits=0)
    rows, how = _taught(table, recipe, seed=0) if taught else (table, replace(recipe, place_jitter=0.0))
    network = train(rows, how, make_trainer("numpy", seed=0, threads=1), width=16).network
    random = np.random.default_rng(1)
    places, angle = random.uniform(30, 90, (500, 2)), random.uniform(0, 2 * np.pi, 500)
    walls = 1.0 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    pixels = np.concatenate([matt(walls, places), places], axis=1, dtype=np.float32)
    found = np.hypot(*network.answer(pixels).T)
    assert least < float(np.median(found)) < most
