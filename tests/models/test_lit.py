"""What measured lights add: exact for a matt gel, corrected by presses for another, and not believed where wrong."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gelnet import train as train_main
from gelnet.lit import judged, lit_rows
from gelnet.table import Table, load_table
from gelnet.trainers import make_trainer
from gelnet.training import normal_error_deg, train

SIZE = (160, 120)
REST = 100.0
UNTOUCHED = np.full((*SIZE[::-1], 3), REST, np.float32)
LIGHTS = np.array([[1.2, 0.0], [-0.6, 1.0], [-0.6, -1.0]])
SHINE = np.array([0.3, 0.24, 0.36])
"""of the gel that is not matt: so much brighter it gets with the cosine of its slope"""


def shown(places: np.ndarray, slopes: np.ndarray, shine: float = 0.0) -> np.ndarray:
    """Colours of a matt gel under lights from three sides that fall off to the right; with a shine, of another."""
    upright = 1 / np.sqrt(1 + (slopes**2).sum(axis=1, keepdims=True))
    falls = 1 - 0.3 * places[:, :1] / SIZE[0]
    light = upright * (1 - falls * (slopes @ LIGHTS.T))
    return np.asarray(REST * (light * (1 + shine * SHINE * (1 - upright)) - 1))


def rows_at(random: np.random.Generator, count: int, steepest_rad: float) -> np.ndarray:
    """Places and slopes, and no colours yet."""
    places, along = random.integers(0, SIZE, (count, 2)), random.uniform(0, 2 * np.pi, count)
    slopes = np.tan(random.uniform(0, steepest_rad, count)) * (np.cos(along), np.sin(along))
    return np.concatenate([np.zeros((count, 3)), places, slopes.T], axis=1)


def pressed(count: int, shine: float = 0.0, seed: int = 3) -> Table:
    """Presses, each in one place with slopes of up to 35 degrees; their lights; and rows of up to 60 degrees."""
    random = np.random.default_rng(seed)
    parts = [rows_at(random, 300, 0.6) for _ in range(count)]
    for part in parts:
        part[:, 3:5] = (random.uniform([20, 20], [140, 100]) + random.uniform(-12, 12, (300, 2))).round()
    rows, everywhere = np.concatenate(parts), rows_at(random, 4000, 1.05)
    rows[:, :3] = shown(rows[:, 3:5], rows[:, 5:], shine)
    everywhere[:, :3] = shown(everywhere[:, 3:5], everywhere[:, 5:])
    return Table(
        rows=rows.astype(np.float32),
        image=np.repeat(np.arange(count, dtype=np.int32), 300),
        image_size=SIZE,
        untouched=UNTOUCHED,
        lit=shown(rows[:, 3:5], rows[:, 5:]).astype(np.float32),
        lit_rows=everywhere.astype(np.float32),
    )


def off(rows: Table, shine: float) -> float:
    """How far the colours of rows of up to 35 degrees are off, grey levels."""
    flat = rows.chosen(np.hypot(*rows.gradient.T) < 0.7)
    true = np.clip(shown(flat.pixels[:, 3:5].astype(float), flat.gradient.astype(float), shine), -REST, 155)
    return float(np.abs(flat.pixels[:, :3] - true).mean())


@pytest.mark.parametrize("presses", [1, 2, 8])
def test_of_a_matt_gel_nothing_is_added_to_the_lights(presses: int) -> None:
    table = pressed(presses)
    lights = judged(table)
    assert lights.record() == {"off": 0.0, "corrected": False, "learnt_from": True}
    made = lit_rows(table, corrected=False)
    assert off(made, 0.0) < 1e-4
    np.testing.assert_array_equal(made.rows[:, 3:], table.lit_rows[:, 3:])


def test_no_colour_is_darker_than_black_or_brighter_than_white() -> None:
    table = pressed(3)
    table.lit_rows[:2, :3] = [[-150, 0, 0], [200, 0, 0]]
    assert lit_rows(table, corrected=False).rows[:2, 0].tolist() == [-REST, 255 - REST]


def test_presses_tell_what_else_the_gel_shows() -> None:
    table = pressed(8, shine=3.0)
    lights = judged(table)
    assert lights.corrected
    assert lights.believed
    alone, corrected = (off(lit_rows(table, corrected=corrected), 3.0) for corrected in (False, True))
    assert corrected < 0.2 * alone


def test_presses_of_a_like_unit_tell_it_where_own_ones_are_few() -> None:
    few, many = pressed(2, shine=3.0, seed=5), pressed(12, shine=3.0)
    alone = off(lit_rows(few, corrected=True), 3.0)
    assert off(lit_rows(replace(few, like=many), corrected=True), 3.0) < 0.6 * alone


@pytest.mark.parametrize(("share", "believed"), [(0.76, True), (0.74, False)])
def test_lights_that_leave_a_quarter_of_the_colours_are_not_learnt_from(share: float, believed: bool) -> None:
    table = pressed(1)
    assert judged(replace(table, lit=table.pixels[:, :3] * np.float32(share))).believed == believed


def test_presses_that_change_nothing_believe_no_lights() -> None:
    table = pressed(2)
    table.rows[:, :3] = 0
    assert not judged(table).believed


@pytest.mark.parametrize(("share", "corrected"), [(0.95, False), (0.85, True)])
def test_what_presses_add_is_taken_where_it_is_clearly_better(share: float, corrected: bool) -> None:
    """The first press is off by what the second one is, and by noise: what is fitted takes the first part away."""
    table, random = pressed(2, shine=3.0), np.random.default_rng(0)
    left = table.pixels[:, :3] - table.lit
    noise = random.normal(0, np.sqrt((left**2).mean()), left.shape)
    lit = table.pixels[:, :3] - np.sqrt(1 - share**2) * left - share * noise
    assert judged(replace(table, lit=lit.astype(np.float32))).corrected == corrected


def saved(place: Path, table: Table) -> Path:
    np.savez(place / "table.npz", **{name: value for name, value in vars(table).items() if value is not None})
    return place / "table.npz"


def trained(place: Path, table: Table) -> dict[str, object]:
    assert train_main.main(["--trainer=numpy", "--table", str(saved(place, table)), "--out", str(place)]) == 0
    return dict(json.loads((place / "training.json").read_text()))


def test_a_network_learns_from_the_lights_what_presses_do_not_show(tmp_path: Path) -> None:
    """It is judged all over the view and by steeper slopes than the presses have."""
    table, rows = pressed(3), rows_at(np.random.default_rng(4), 3000, 0.9)
    rows[:, :3] = shown(rows[:, 3:5], rows[:, 5:])
    judges = Table(rows=rows.astype(np.float32), image=np.zeros(3000, np.int32), image_size=SIZE)
    recipe, errors = replace(train_main.RECIPES["fast"], least_visits=0, epochs=40), {}
    for lit in (True, False):
        known = load_table(saved(tmp_path, table if lit else replace(table, lit=None, lit_rows=None)))
        learnt, how = train_main._taught(known, recipe, 0, judged(known) if lit else None)
        network = train(learnt, how, make_trainer("numpy", seed=0), width=16).network
        errors[lit] = normal_error_deg(network, judges)["mean"]
    assert errors[True] < 1.5
    assert errors[True] < 0.3 * errors[False]


def test_the_record_says_whether_the_lights_were_believed(tmp_path: Path) -> None:
    table = pressed(2)
    assert trained(tmp_path, table)["lights"] == {"off": 0.0, "corrected": False, "learnt_from": True}
    assert trained(tmp_path, replace(table, lit=-table.lit))["lights"]["learnt_from"] is False
    assert "lights" not in trained(tmp_path, replace(table, lit=None, lit_rows=None))
