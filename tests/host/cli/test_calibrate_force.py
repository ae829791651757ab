"""`gellight calibrate force`: weights or a load cell's record in, a bundle that knows its force out."""

import json
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from gellight.bundle.bundle import load_bundle
from gellight.frames.frames import CameraFrame, CaptureStamp
from gellight.reconstruction.force_file import ForceRecord
from gellight.recording.recording_file import RecordingWriter
from tests.helpers.command_line import invoke, refused, succeeded
from tests.helpers.linear_sensor import linear_bundle
from tests.helpers.weighed import LAYER, MODULUS_MPA, PIXEL_MM, SHAPE, weighed, write_weighings

DEPTHS = (0.0, 0.1, 0.2, 0.35, 0.5, 0.6)
BEGUN_S = 1e9
PERIOD_S = 1 / 30


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    linear_bundle(tmp_path / "bundle", SHAPE, pixel_size_mm=(PIXEL_MM, PIXEL_MM))
    return tmp_path


def run(folder: Path, *more: object) -> Any:
    layer = {
        "GELLIGHT_GEOMETRY_GEL_THICKNESS_MM": str(LAYER.thickness_mm),
        "GELLIGHT_GEOMETRY_POISSON_RATIO": str(LAYER.poisson_ratio),
    }
    places = ["--calibration", folder / "bundle", "--out", folder / "new"]
    return invoke("calibrate", "force", folder / "forces.csv", *places, *more, env=layer)


def test_a_gel_that_nobody_told_is_asked_for(folder: Path) -> None:
    write_weighings(folder, [weighed(depth) for depth in DEPTHS])
    places = ["--calibration", folder / "bundle", "--out", folder / "new"]
    said = refused(invoke("calibrate", "force", folder / "forces.csv", *places))
    assert "give gel_thickness_mm under [geometry]" in said


def test_weights_give_the_modulus_and_the_bundle_keeps_all_the_rest(folder: Path) -> None:
    write_weighings(folder, [weighed(depth) for depth in DEPTHS])
    result = succeeded(run(folder, "--json"))
    said = json.loads(result.stdout)
    assert said["youngs_modulus_mpa"] == pytest.approx(MODULUS_MPA, rel=0.05)
    assert said["readings"] == len(DEPTHS) - 1
    old, new = load_bundle(folder / "bundle"), load_bundle(folder / "new")
    assert {**old.files, "force.json": new.files["force.json"]} == new.files
    record = ForceRecord.in_bundle(new)
    assert record.heaviest_n == pytest.approx(weighed(0.6).force_n)


def record_presses(folder: Path, *, lag_s: float = 0.0) -> None:
    """Write a recording of a press that comes and goes, and the load cell's record beside it, `lag_s` late."""
    bundle = load_bundle(folder / "bundle")
    levels = [0.0, 0.1, 0.2, 0.35, 0.5, 0.6, 0.6, 0.5, 0.35, 0.2, 0.1, 0.0]
    times = BEGUN_S + 2 * PERIOD_S * np.arange(len(levels))
    with RecordingWriter(folder / "presses.mcap", "finger") as writer:
        for number, (depth, unix_s) in enumerate(zip(levels, times.tolist(), strict=True)):
            frame = CameraFrame(image=weighed(depth).picture(0.5, number), time_s=unix_s - BEGUN_S, sequence=number)
            writer.add(frame, CaptureStamp(zeroed=bundle, unix_s=unix_s))
    at = np.arange(BEGUN_S - 1, times[-1] + 1, 0.01)
    forces = np.interp(at - lag_s, times, [weighed(depth).force_n for depth in levels])
    lines = [f"{time_s:.3f},{force:.5f}" for time_s, force in zip(at.tolist(), forces.tolist(), strict=True)]
    (folder / "forces.csv").write_text("\n".join(["unix_s,force_n", *lines]) + "\n")


@pytest.mark.parametrize("lag_s", [0.0, 0.05])
def test_a_load_cell_beside_a_recording_and_the_lag_of_its_clock(folder: Path, lag_s: float) -> None:
    record_presses(folder, lag_s=lag_s)
    result = succeeded(run(folder, "--recording", folder / "presses.mcap", "--json"))
    said = json.loads(result.stdout)
    assert said["youngs_modulus_mpa"] == pytest.approx(MODULUS_MPA, rel=0.05)
    assert said["lag_s"] == pytest.approx(lag_s, abs=0.011)


def test_times_need_a_recording_of_that_time_and_pictures_none(folder: Path) -> None:
    record_presses(folder)
    (folder / "forces.csv").write_text("unix_s,force_n\n5,0\n6,1\n7,2\n")
    assert "no frame of" in refused(run(folder, "--recording", folder / "presses.mcap"))
    assert "give the recording" in refused(run(folder))
    write_weighings(folder, [weighed(depth) for depth in DEPTHS])
    assert "leave --recording out" in refused(run(folder, "--recording", folder / "presses.mcap"))


def test_a_press_at_the_border_and_a_picture_that_is_missing_or_of_another_size_are_refused(folder: Path) -> None:
    write_weighings(folder, [*(weighed(depth) for depth in DEPTHS), weighed(0.5, 3.0, 7.5)])
    assert "weight6.png: the load goes on beyond the border" in refused(run(folder))
    write_weighings(folder, [weighed(depth) for depth in DEPTHS])
    cv2.imwrite(str(folder / "weight3.png"), np.zeros((10, 10, 3), np.uint8))
    assert "weight3.png is 10 x 10 px" in refused(run(folder))
    (folder / "weight3.png").unlink()
    assert "weight3.png does not exist" in refused(run(folder))
