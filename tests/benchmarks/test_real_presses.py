"""No change makes real presses worse unseen: a part of `real_presses` is measured again and held against its record."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gellight.frame_path.pipeline import Reconstructor
from gellight.frames.frames import CameraFrame
from gellight.lab.training.training import Learning, TrainingOptions, fit
from tests.benchmarks.real_judging import GIVEN, PLAIN, Errors, folds_of, judged, learnt, means
from tests.benchmarks.real_presses import FIRST, GATE, PICTURES, Row, measure, rows
from tests.benchmarks.real_record import Record, Recorded, worse
from tests.benchmarks.real_sets import SETS, groove

FAST = Learning(options=TrainingOptions(recipe="fast"))
ROWS = [Row(name, FIRST, None, circles, way) for name, circles, way in GATE]


def of_row(row: Row) -> object:
    marks = [pytest.mark.real_images(PICTURES[row.set])] if row.set in PICTURES else []
    return pytest.param(row, marks=marks, id=str(row))


@pytest.mark.nightly
@pytest.mark.parametrize("row", [of_row(row) for row in ROWS])
def test_real_presses_are_felt_no_worse_than_recorded(row: Row) -> None:
    """Where this fails on purpose, measure the row again (`--only ... --seeds 5 --again`) and say so in the commit."""
    measured, presses = measure(row, seed=0)
    recorded = Record().rows[str(row)]
    assert presses == recorded.presses
    assert worse(str(row), measured, recorded) == []


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=pytest.mark.real_images(PICTURES[name])) for name in ("mini", "gripper")]
)
def test_circles_by_hand_are_each_of_a_picture_and_know_its_dots(name: str, tmp_path: Path) -> None:
    images = SETS[name](tmp_path)
    circles = {(press.center_x_px, press.center_y_px, press.contact_radius_px) for press in images.hand}
    assert len(circles) == len(images.hand), "one label was copied to a second picture"
    assert {press.dots for press in images.hand} == {images.reference.dots}
    assert (images.reference.dots is not None) == (name == "gripper")


@pytest.mark.nightly
def test_circles_a_pixel_off_are_worse(tmp_path: Path) -> None:
    images = SETS["three_lights_crop"](tmp_path)
    fold = next(folds_of(images))
    moved = [replace(press, center_x_px=press.center_x_px + 1) for press in fold.training]
    felt = learnt(moved, images, PLAIN, TrainingOptions(recipe="thorough"))
    errors = {GIVEN: means(judged(felt, images, {GIVEN: fold.held_out})[GIVEN])}
    told = worse("moved", errors, Record().rows[str(ROWS[0])])
    assert any("normals_deg is" in line for line in told)


@pytest.mark.nightly
@pytest.mark.real_images("oem_six_lights")
@pytest.mark.real_images("oem_groove")
def test_a_groove_has_the_walls_and_the_depth_that_six_lights_say(tmp_path: Path) -> None:
    """An object that is no ball, by the balls of its sensor: a quadratic of all six lights, fitted to them without this
    code, says walls of 43.3 degrees, 0.540 mm deep. Its shoulders are flat, its bottom too."""
    images = SETS["three_lights"](tmp_path)
    bundle = fit(images.presses, images.reference, images.ball, tmp_path / "bundle", sensor="oem", how=FAST)
    frame = Reconstructor(bundle).reconstruct(CameraFrame(image=groove(), time_s=0.0, sequence=0))
    across_deg = np.degrees(np.arctan(frame.gradient_map[..., 0]))
    begins, left = (int(np.median(np.argmax(side, axis=1))) for side in (across_deg < -20, across_deg[:, ::-1] < -20))
    wall = across_deg[:, begins + 25 : 612 - left - 25]
    shoulder, bottom = frame.depth_mm[:, 20 : begins - 20], frame.depth_mm[:, 612 - left + 40 : -5]
    deep = np.median(shoulder, axis=1) - np.median(bottom, axis=1)
    assert np.median(wall) == pytest.approx(-43.3, abs=1)
    assert np.median(deep) == pytest.approx(0.540, abs=0.02)
    assert np.quantile(np.abs(deep - 0.540), 0.9) < 0.06  # it grows by that along the groove
    assert shoulder.std() < 0.015


def test_what_is_worse_is_what_lies_beyond_the_spread_of_the_seeds() -> None:
    seeds = {seed: {GIVEN: Errors(deg, 4.0, 0.05, 1.0)} for seed, deg in enumerate((5.0, 5.1, 5.2))}
    recorded = Recorded(seeds=seeds, presses=7)
    assert worse("row", {GIVEN: Errors(5.35, 4.0, 0.05, 0.5)}, recorded) == []
    (line,) = worse("row", {GIVEN: Errors(5.45, 4.03, 0.05, 1.0)}, recorded)
    assert line == "row, as given: normals_deg is 5.45, worse than 5.4, which the record and its spread allow"
    with pytest.raises(ValueError, match="2 seeds tell no spread"):
        worse("row", seeds[0], Recorded(seeds={0: seeds[0], 1: seeds[1]}, presses=7))


def test_the_record_has_rows_of_the_table_alone() -> None:
    assert set(Record().rows) <= {str(row) for row in rows()}
