"""The teacher: exact where its terms hold, even light from one press, and what GelNet gains by it."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gelnet.recipes import RECIPES
from gelnet.table import Table, TableError, load_table
from gelnet.teacher import fit_teacher, with_taught
from gelnet.trainers import make_trainer
from gelnet.training import normal_error_deg, train

WIDTH, HEIGHT = 160, 120
UNTOUCHED = np.full((HEIGHT, WIDTH, 3), 100, np.float32)
LIGHTS = np.array([[1.0, 0.0], [-0.5, 0.87], [-0.5, -0.87]])


def presses(count: int, *, bright: np.ndarray | None = None, seed: int = 3) -> Table:
    """Presses of 15 px on a sensor whose colours are linear in the angle of the slope, and as bright as it is lit."""
    random, light = np.random.default_rng(seed), UNTOUCHED if bright is None else bright
    parts = []
    for centre in random.uniform([20, 20], [WIDTH - 20, HEIGHT - 20], (count, 2)):
        places = np.rint(centre + random.uniform(-15, 15, (500, 2))).clip(0, [WIDTH - 1, HEIGHT - 1])
        angles = (centre - places) / 30
        colours = 80 * angles @ LIGHTS.T * light[places[:, 1].astype(int), places[:, 0].astype(int)] / 100
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


def test_a_picture_of_another_size_is_refused(tmp_path: Path) -> None:
    table = presses(2)
    arrays = {"rows": table.rows, "image": table.image, "image_size": np.array(table.image_size)}
    np.savez(tmp_path / "table.npz", **arrays, untouched=UNTOUCHED[:10])
    with pytest.raises(TableError, match="untouched has shape"):
        load_table(tmp_path / "table.npz")
