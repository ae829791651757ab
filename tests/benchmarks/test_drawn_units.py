"""Drawn units against real presses that were held out, and the peer that they are compared with."""

from pathlib import Path

import numpy as np
import pytest

from gellight.lab.training.table import PressTable
from tests.benchmarks.drawn_units import PLATE, WAYS, Unit, drawn, ssim
from tests.benchmarks.real_judging import folds_of
from tests.benchmarks.real_sets import SETS
from tests.benchmarks.taxim_table import TaximTable


def test_presses_held_out_are_drawn_better_than_by_the_table(tmp_path: Path) -> None:
    fold = next(folds_of(SETS["three_lights_crop"](tmp_path)))
    found = list(drawn(Unit(fold.images, fold.training, PLATE), fold))
    ours, table, untouched = (np.mean([one[way].grey for one in found]) for way in WAYS)
    assert len(found) == 3
    assert ours < 5
    assert ours < untouched / 4
    assert ours < table / 4
    assert np.mean([one["ours"].ssim - one["untouched"].ssim for one in found]) > 0.2


def test_the_table_is_a_quadratic_of_the_place_in_each_bin() -> None:
    random = np.random.default_rng(0)
    x, y = random.uniform(0, 40, (2, 500))
    colour = np.stack([x**2 - y, x * y + 3, 0 * x], axis=1)
    rows = np.column_stack([colour, x, y, np.full(500, 0.3), np.full(500, 0.1)]).astype(np.float32)
    table = TaximTable.fitted(PressTable(rows=rows, image=np.zeros(500, np.int32), image_size=(40, 40)))
    v, u = np.indices((40, 40), dtype=np.float64)
    right = np.stack([u**2 - v, u * v + 3, 0 * u], axis=2)
    for across, down in ((0.3, 0.1), (-0.5, 0.9)):
        drawn_change = table.change(np.full((40, 40), across), np.full((40, 40), down))
        assert drawn_change == pytest.approx(right, abs=0.01), "a bin that nothing filled is the nearest one"


def test_pictures_are_similar_by_structure() -> None:
    """Of two pictures without structure only the light is left: (2ab + c) / (a^2 + b^2 + c)."""
    picture = np.random.default_rng(0).uniform(0, 255, (30, 40, 3))
    assert ssim(picture, picture) == pytest.approx(1)
    even = [np.full((30, 40, 3), grey) for grey in (100.0, 50.0)]
    assert ssim(*even) == pytest.approx((2 * 5000 + 6.5025) / (12500 + 6.5025))
