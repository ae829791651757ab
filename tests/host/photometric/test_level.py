"""The height of a view that is touched all over, from the light alone."""

from dataclasses import replace

import numpy as np
import pytest

from gellight.lab.simulator.scene import Press
from gellight.photometric.level import Level, find_level, samples
from gellight.photometric.light_model import LightGroups, LightModel, Signals, signals_of
from gellight.photometric.solver import Points, flat_gel
from tests.helpers.simulated_gel import GROUPS, PIXEL_MM, RING, SMALL, Gel


@pytest.fixture(scope="module")
def gel() -> Gel:
    return Gel(seed=5)


@pytest.fixture(scope="module")
def model(gel: Gel) -> LightModel:
    return gel.model(16)


def measured(gel: Gel, model: LightModel, press: Press | None, wrong_mm: float) -> Level:
    """The offset that is found when the truth is taken to be `wrong_mm` too high."""
    groups = GROUPS[LightGroups.TRIPLES]
    gel.expose(3.0)
    signals = signals_of([[gel.picture(press, group)] for group in groups], groups, model, gel.base.noise_grey)
    _, surface = gel.scene.show(press)
    gel.expose(1.0)
    points = flat_gel(SMALL.image_shape, PIXEL_MM)
    points = replace(points, z_mm=surface.depth_mm.ravel() + np.float32(wrong_mm))
    references = model.references(LightGroups.TRIPLES).astype(np.float32).reshape(12, -1)
    return find_level(signals, references, points, RING)


@pytest.mark.parametrize("wrong_mm", [-0.6, 0.0, 0.4])
@pytest.mark.parametrize("press", [None, Press("TSTEP", 0.7, 2.0, 1.0)])
def test_the_light_tells_how_high_the_gel_stands(
    gel: Gel, model: LightModel, press: Press | None, wrong_mm: float
) -> None:
    level = measured(gel, model, press, wrong_mm)
    assert level.offset_mm == pytest.approx(-wrong_mm, abs=0.05)
    assert level.deviation_mm < 0.02
    assert level.correction_mm == (level.offset_mm if wrong_mm else 0.0)


def test_where_too_few_pixels_see_eight_lights_nothing_is_said() -> None:
    few = np.zeros((12, 4000), bool)
    few[:7] = True
    points = Points(*(np.zeros(4000, np.float32),) * 3)
    signals = Signals(np.ones((12, 4000), np.float32), few, np.ones(12), np.zeros((3, 4000), np.float32))
    level = find_level(signals, np.ones((12, 4000), np.float32), points, RING)
    assert level == Level(0.0, np.inf)
    assert level.correction_mm == 0


def test_where_every_height_fits_alike_nothing_is_said() -> None:
    points = Points(*(np.zeros(4000, np.float32),) * 3)
    dark = Signals(np.zeros((12, 4000), np.float32), np.ones((12, 4000), bool), np.ones(12), np.zeros((3, 4000)))
    assert find_level(dark, np.ones((12, 4000), np.float32), points, RING) == Level(0.0, np.inf)


def test_samples_are_spread_over_rows_and_columns() -> None:
    chosen = samples(np.ones((12, 480 * 640), bool))
    assert 2000 < len(chosen) < 3000
    assert len(np.unique(chosen // 640)) == 480
    assert len(np.unique(chosen % 640)) == 640


def test_a_small_or_uncertain_offset_is_left_to_the_gel_at_rest() -> None:
    assert Level(0.04, 0.001).correction_mm == 0
    assert Level(0.3, 0.1).correction_mm == 0
    assert Level(-0.3, 0.01).correction_mm == -0.3
