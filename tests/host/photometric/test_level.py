"""The height of a view that is touched all over, from the light alone; and whether the scene rested meanwhile."""

from collections.abc import Callable
from math import inf

import numpy as np
import pytest

from gellight.lab.simulator.scene import Press
from gellight.photometric.level import Level, find_level, samples
from gellight.photometric.light_model import LightGroups, LightModel, Signals, signals_of
from gellight.photometric.solver import Points, flat_gel, light_rows
from gellight.photometric.static_scene import change_of_repetition, misfit, repetition_limit
from tests.helpers.simulated_gel import GROUPS, PIXEL_MM, RING, SMALL, Gel


@pytest.fixture(scope="module")
def gel() -> Gel:
    return Gel(seed=5)


@pytest.fixture(scope="module")
def model(gel: Gel) -> LightModel:
    return gel.model(16)


def measured(
    gel: Gel, model: LightModel, press: Press | None, wrong_mm: float, most_pixels: int | None = None
) -> Level:
    """The offset that is found when the truth is taken to be `wrong_mm` too high, by so many pixels at most."""
    groups = GROUPS[LightGroups.TRIPLES]
    gel.expose(3.0)
    signals = signals_of([[gel.picture(press, group)] for group in groups], groups, model, gel.base.noise_grey)
    if most_pixels is not None:
        signals.valid[:, np.setdiff1d(np.arange(signals.valid.shape[1]), samples(signals.valid)[:most_pixels])] = False
    _, surface = gel.scene.show(press)
    gel.expose(1.0)
    references = model.references(LightGroups.TRIPLES).astype(np.float32).reshape(12, -1)
    return find_level(signals, references, surface.depth_mm.ravel() + np.float32(wrong_mm), seen_from(inf), RING)


def seen_from(height_mm: float) -> Callable[[np.ndarray, np.ndarray], Points]:
    """Where pixels see the gel, from a camera so high."""
    flat = flat_gel(SMALL.image_shape, PIXEL_MM)
    return lambda pixels, depth: Points.seen_at(flat.x_mm[pixels], flat.y_mm[pixels], depth, height_mm)


@pytest.mark.parametrize("wrong_mm", [-0.6, 0.0, 0.4])
@pytest.mark.parametrize("press", [None, Press("TSTEP", 0.7, 2.0, 1.0)])
def test_the_light_tells_how_high_the_gel_stands(
    gel: Gel, model: LightModel, press: Press | None, wrong_mm: float
) -> None:
    level = measured(gel, model, press, wrong_mm)
    assert level.offset_mm == pytest.approx(-wrong_mm, abs=0.05)
    assert level.deviation_mm < 0.02
    assert level.correction_mm == (level.offset_mm if wrong_mm else 0.0)


@pytest.mark.parametrize(("lights", "seen"), [(7, 0), (8, 4000)])
def test_a_pixel_is_compared_that_eight_lights_reach(lights: int, seen: int) -> None:
    valid = np.repeat((np.arange(12) < lights)[:, None], 4000, axis=1)
    assert len(samples(valid)) == seen


@pytest.mark.parametrize(("pixels", "certain"), [(199, False), (200, True)])
def test_a_height_is_found_by_two_hundred_pixels(gel: Gel, model: LightModel, pixels: int, certain: bool) -> None:
    assert np.isfinite(measured(gel, model, None, 0.3, pixels).deviation_mm) == certain


def test_where_every_height_fits_alike_nothing_is_said() -> None:
    nothing = np.zeros(4000, np.float32)
    dark = Signals(np.zeros((12, 4000), np.float32), np.ones((12, 4000), bool), np.ones(12), np.zeros((3, 4000)))
    light = np.ones((12, 4000), np.float32)
    assert find_level(dark, light, nothing, lambda pixels, depth: Points(depth, depth, 0 * depth), RING) == Level(
        0.0, np.inf
    )


@pytest.mark.parametrize("wrong_mm", [-0.4, 0.4])
def test_a_camera_near_the_gel_sees_each_height_at_another_place(wrong_mm: float) -> None:
    """Level gel 0.5 mm deep under 12 lights of 100 grey levels at rest: no noise, and the height is found."""
    places, count = seen_from(40.0), SMALL.image_shape[0] * SMALL.image_shape[1]
    every, references = np.arange(count), np.full((12, count), 100, np.float32)
    rows = light_rows(places(every, np.full(count, 0.5, np.float32)), references, RING)
    signals = Signals(rows[:, 2], np.ones((12, count), bool), np.ones(12), np.zeros((3, count)))
    found = find_level(signals, references, np.full(count, 0.5 + wrong_mm, np.float32), places, RING)
    assert found.offset_mm == pytest.approx(-wrong_mm, abs=0.005)


def test_samples_are_spread_over_rows_and_columns() -> None:
    chosen = samples(np.ones((12, 480 * 640), bool))
    assert 2000 < len(chosen) < 3000
    assert len(np.unique(chosen // 640)) == 480
    assert len(np.unique(chosen % 640)) == 640


def test_a_small_or_uncertain_offset_is_left_to_the_gel_at_rest() -> None:
    found = ((0.049, 0.001), (0.051, 0.001), (0.3, 0.061), (0.3, 0.059), (-0.3, 0.01))
    assert [Level(*one).correction_mm for one in found] == [0, 0.051, 0, 0.3, -0.3]


# ---- the scene at rest ----


def test_a_repetition_differs_by_its_noise_and_the_light_by_nothing() -> None:
    first = np.full((32, 40, 3), 100, np.uint8)
    last = first + 9
    last[8:16, 16:24, 1] -= 4
    change = change_of_repetition(first, last)
    assert change[1, 2] == 4
    assert np.count_nonzero(change) == 1
    assert repetition_limit(1.0) == pytest.approx(1.288, abs=1e-3), "7 deviations of the mean of 64 pixels"


@pytest.mark.parametrize(("blocks", "off_grey", "moved"), [(8, 2.8, False), (8, -2.95, True), (7, 50.0, False)])
def test_a_scene_has_moved_where_eight_blocks_misfit(blocks: int, off_grey: float, moved: bool) -> None:
    """By more than 7 deviations of a mean, 0.875 grey levels here, and a fiftieth of the signal of 100."""
    off = np.zeros((12, 64, 64), np.float32)
    off[3, :8, : 8 * blocks] = off_grey
    predicted, valid, noise = np.full((12, 4096), 100, np.float32), np.ones((12, 4096), bool), np.ones(12)
    found = misfit(predicted + off.reshape(12, -1), valid, predicted, noise, (64, 64))
    assert (found > 1) == moved
    valid[5] = False
    assert misfit(predicted + off.reshape(12, -1), valid, predicted, noise, (64, 64)) == 0, "at the edge of a shadow"
