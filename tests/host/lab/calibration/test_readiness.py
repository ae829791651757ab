"""What a calibration needs is missed before the first press, not after the last."""

import os
import shutil
import tempfile
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import pytest

from gellight.base.errors import InputError, TrainingError
from gellight.lab.calibration import readiness, routine
from gellight.lab.calibration.choices import RoutineOptions
from gellight.lab.calibration.readiness import check_target, nearest
from gellight.lab.calibration.routine import Routine
from gellight.lab.simulator.virtual_hand import hand_of
from gellight.opening import open_camera

SHAPE = (240, 320)
GEOMETRY = {"image_width_px": 320, "image_height_px": 240, "pixel_size_mm": 0.1176}


def options(folder: Path, **changes: Any) -> RoutineOptions:
    return RoutineOptions(out=folder / "bundle", **{"sensor": "one", **changes})


def test_a_folder_that_does_not_exist_yet_is_made_in_the_nearest_that_does(tmp_path: Path) -> None:
    check_target(options(tmp_path / "new" / "deep"), tmp_path / "state", SHAPE)
    assert nearest(tmp_path / "new/deep/bundle") == tmp_path
    assert list(tmp_path.iterdir()) == []


def test_what_lies_below_a_file_cannot_be_written(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    for out, state in ((tmp_path / "file", tmp_path), (tmp_path, tmp_path / "file/state")):
        with pytest.raises(InputError, match=f"nothing can be written in {tmp_path / 'file'}: give another folder"):
            check_target(options(out), state / "state", SHAPE)


def test_a_folder_without_the_right_to_write_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    kept = tmp_path / "kept"
    kept.mkdir()
    may = os.access
    # Root may write everywhere, so the answer of the system is put in.
    monkeypatch.setattr(os, "access", lambda path, mode: may(path, mode) and Path(path) != kept)
    with pytest.raises(InputError, match=f"nothing can be written in {kept}"):
        check_target(options(kept), tmp_path / "state", SHAPE)


@pytest.mark.parametrize("full", ["bundle", "state", "temporary"])
def test_a_full_disk_is_refused_wherever_it_is(full: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    places = {name: tmp_path / name for name in ("bundle", "state", "temporary")}
    for place in places.values():
        place.mkdir()
    monkeypatch.setattr(tempfile, "gettempdir", lambda: str(places["temporary"]))
    usage = shutil.disk_usage(tmp_path)
    free = {places[full]: 5_000_000}
    monkeypatch.setattr(readiness.shutil, "disk_usage", lambda path: usage._replace(free=free.get(Path(path), 10**12)))
    with pytest.raises(InputError, match=rf"5 MB are free in {places[full]}, a calibration may need 25 MB: make room"):
        check_target(options(places["bundle"]), places["state"] / "new", SHAPE)


def test_a_sensor_without_a_name_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="empty name"):
        check_target(options(tmp_path, sensor=" "), tmp_path / "state", SHAPE)


def test_a_trainer_that_does_not_work_ends_it_before_the_first_press(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(
        routine,
        "rehearse",
        Mock(side_effect=TrainingError("no network can be trained here (libgomp.so.1 is missing): repair it")),
    )
    with open_camera("sim://?fps=500&board=0", geometry=GEOMETRY) as camera:
        begun = Routine(camera, options(tmp_path), tmp_path / "state", hand=hand_of(camera, seed=0))
        begun.act("start")
        begun.join(200)
        snapshot = begun.snapshot()
    assert snapshot["step"] == "failed"
    assert "libgomp.so.1 is missing" in snapshot["problem"]
    assert snapshot["figures"] == {}
    assert not list((tmp_path / "state/presses").iterdir())
