"""Data sets of simulated presses: what the files say is what was pressed, and a data set can be gone on with."""

import csv
import json
import os
import signal
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gellight.base.errors import InputError
from gellight_design.simulating.dataset import DatasetRequest, make_dataset
from gellight_design.simulating.processes import call_all
from sim_reference import gel
from sim_reference.geometry import SensorGeometry
from sim_reference.surface import press_object
from tests.helpers.children import started
from tests.helpers.command_line import invoke
from tests.helpers.places import CHECKOUT
from tests.helpers.waiting import eventually

SMALL = SensorGeometry(image_width_px=80, image_height_px=60, pixel_size_mm=0.4)
REQUEST = DatasetRequest(presses=3, objects=("BALL", "WAVE"), geometry=SMALL, seed=5)


def make(folder: Path, request: DatasetRequest = REQUEST) -> None:
    make_dataset(request, folder)


def read(folder: Path) -> list[tuple[dict[str, str], dict[str, np.ndarray]]]:
    rows = list(csv.DictReader((folder / "index.csv").open()))
    return [(row, dict(np.load(folder / row["file"]))) for row in rows]


def content(folder: Path) -> dict[str, bytes]:
    files = [*folder.glob("*.npz"), *folder.glob("*.csv"), *folder.glob("presses/*")]
    return {str(path.relative_to(folder)): path.read_bytes() for path in files}


@pytest.fixture(scope="module")
def balls(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("balls")
    make(folder, replace(REQUEST, objects=("BALL",), noise_grey=0.0))
    return folder


def test_the_fields_are_those_of_the_press(balls: Path) -> None:
    for row, press in read(balls):
        assert press["images"].shape == (1, 60, 80, 3)
        assert press["images"].dtype == np.uint8
        assert press["light"].shape == (1, 12, 3)
        assert press["depth_mm"].max() == pytest.approx(float(row["depth_mm"]), abs=0.02)
        np.testing.assert_allclose(np.linalg.norm(press["normals"], axis=2), 1, atol=1e-6)
        deepest = np.unravel_index(press["depth_mm"].argmax(), (60, 80))
        x, y = ((at - (size - 1) / 2) * 0.4 for at, size in zip(deepest[::-1], (80, 60), strict=True))
        assert (x, y) == pytest.approx((float(row["x_mm"]), float(row["y_mm"])), abs=0.4)


def test_the_normals_are_those_of_the_depth(balls: Path) -> None:
    for _, press in read(balls):
        slope = -press["normals"][..., :2] / press["normals"][..., 2:]
        by_differences = np.stack(np.gradient(press["depth_mm"], 0.4)[::-1], axis=2)
        assert np.abs(slope - by_differences).mean() < 0.01


def test_pressure_adds_up_to_the_force(balls: Path) -> None:
    for row, press in read(balls):
        assert press["pressure_mpa"].sum() * 0.4**2 == pytest.approx(float(row["force_n"]), rel=0.05)
        assert ((press["pressure_mpa"] > 0) == press["contact"]).all()
        pressed = press_object("BALL", float(row["depth_mm"]), SMALL, model=gel.press)
        shear_modulus_mpa = 0.2 / 2 / (1 + SMALL.poisson_ratio)
        assert float(row["force_n"]) == press["force_n"]
        force = pressed.pressure.sum() * shear_modulus_mpa * pressed.spacing_mm**2
        assert float(row["force_n"]) == pytest.approx(force, abs=1e-5)


def test_where_nothing_is_pressed_the_picture_is_the_reference(balls: Path) -> None:
    reference = np.load(balls / "reference.npz")["images"].astype(int)
    for _, press in read(balls):
        changed = np.abs(press["images"].astype(int) - reference).max(axis=(0, 3)) > 4
        flat = press["normals"][..., 2] > np.cos(np.radians(0.5))
        assert changed[press["contact"]].mean() > 0.9
        assert changed[flat].mean() < 0.1


def test_single_lights_add_up_to_what_they_are_together(tmp_path: Path) -> None:
    make(tmp_path, replace(REQUEST, presses=1, light="singles", noise_grey=0.0))
    ((_, press),) = read(tmp_path)
    assert press["images"].shape == (12, 60, 80, 3)
    assert (press["light"].sum(axis=(0, 2)) == 3).all()
    assert len({image.tobytes() for image in press["images"]}) == 12
    assert 190 <= np.load(tmp_path / "reference.npz")["images"].max() <= 201


def test_what_was_begun_and_extended_is_the_same_in_the_end(tmp_path: Path) -> None:
    make(tmp_path / "whole")
    parts, told = tmp_path / "parts", []
    make(parts, replace(REQUEST, presses=1))
    make_dataset(REQUEST, parts, 2, lambda *how_far: told.append(how_far[:2]))
    assert told == [(1, 3), (2, 3), (3, 3)]
    assert content(parts) == content(tmp_path / "whole")


def test_what_is_there_is_not_made_again_and_what_was_removed_is(tmp_path: Path) -> None:
    make(tmp_path)
    before = content(tmp_path)
    kept, removed = tmp_path / "presses/000000.npz", tmp_path / "presses/000001.npz"
    at = kept.stat().st_mtime_ns
    removed.unlink()
    make(tmp_path)
    assert kept.stat().st_mtime_ns == at
    assert content(tmp_path) == before


def test_another_data_set_is_not_mixed_in(tmp_path: Path) -> None:
    make(tmp_path, replace(REQUEST, presses=1))
    with pytest.raises(InputError, match=r"another data set \(another seed\)"):
        make(tmp_path, replace(REQUEST, seed=6))
    (tmp_path / "dataset.json").write_text("{")
    with pytest.raises(InputError, match="another data set"):
        make(tmp_path)


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (["--object", "HAND"], "no object HAND: choose from BALL"),
        (["--deepest-mm", "3.1"], "up to 3 mm, 60 % of the gel's 5 mm"),
        (["--gel", "fem", "--resolution-mm", "0.05", "--workers", "9"], "in each of 9 --workers needs about"),
        (["--shallowest-mm", "0"], "give positive ones"),
        (["--shallowest-mm", "0.9", "--deepest-mm", "0.3"], "the shallowest first"),
    ],
)
def test_what_cannot_be_made_is_refused(tmp_path: Path, arguments: list[str], reason: str) -> None:
    result = invoke("simulate", "dataset", "--out", str(tmp_path / "out"), *arguments)
    assert isinstance(result.exception, InputError)
    assert reason in str(result.exception)


def test_the_verb_says_what_it_wrote(tmp_path: Path) -> None:
    out = tmp_path / "out"
    arguments = ["--out", str(out), "--presses", "1", "--object", "ball", "--workers", "1", "--json"]
    result = invoke("simulate", "dataset", *arguments)
    assert json.loads(result.stdout)["presses"] == 1, result.output
    assert json.loads((out / "dataset.json").read_text())["request"]["objects"] == ["BALL"]


def square(number: int) -> int:
    return number**2


def test_results_come_in_the_order_of_the_calls() -> None:
    done: list[int] = []
    assert call_all(square, [(3,), (2,), (1,)], 2, done.append) == [9, 4, 1]
    assert sorted(done) == [0, 1, 2]


def die(number: int) -> int:
    os.kill(os.getpid(), signal.SIGKILL)
    return number


def test_a_worker_that_was_killed_is_reported() -> None:
    with pytest.raises(InputError, match="use fewer --workers than 2"):
        call_all(die, [(1,)], 2)


def linger(folder: str) -> None:
    """Say which process this is, and work for long."""
    (Path(folder) / str(os.getpid())).touch()
    time.sleep(100)


CALLS = """
import sys
from gellight_design.simulating.processes import call_all
from tests.design.simulating.test_dataset import linger
if __name__ == "__main__":
    call_all(linger, [(sys.argv[1] + f"/{at}",) for at in range(2)], 2)
"""


def test_workers_end_with_the_program_that_is_killed(tmp_path: Path) -> None:
    for at in range(2):
        (tmp_path / str(at)).mkdir()
    (tmp_path / "calls.py").write_text(CALLS)
    environment = os.environ | {
        "PYTHONPATH": os.pathsep.join(str(CHECKOUT / at) for at in ("", "host", "host/gellight_design"))
    }
    with started([sys.executable, tmp_path / "calls.py", tmp_path], env=environment) as program:
        eventually(lambda: len(list(tmp_path.glob("[01]/*"))) == 2, 60)
        program.kill()
        workers = [Path("/proc") / path.name for path in tmp_path.glob("[01]/*")]
        eventually(lambda: not any(worker.exists() for worker in workers), 60)
