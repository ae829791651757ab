"""`gellight surface`: what it takes, writes and refuses. docs/scanning.md is typed by test_documented.py."""

import json
from pathlib import Path

import numpy as np
import pytest

from gellight_scan.height_map import HeightMap
from tests.helpers.command_line import invoke

X = np.arange(-10, 10, 0.1, dtype=np.float32)


@pytest.fixture
def plate(tmp_path: Path) -> Path:
    height = np.broadcast_to(0.02 * np.cos(np.pi * X), (200, 200)).astype(np.float32)
    HeightMap(height, np.full_like(height, 0.001), 0.1).save(tmp_path / "plate.npz")
    return tmp_path / "plate.npz"


def test_an_area_and_a_line_are_measured(plate: Path) -> None:
    area = json.loads(invoke("surface", plate, "--json").stdout)
    assert area["sa_mm"] == pytest.approx(0.04 / np.pi, rel=0.01)
    assert area["error_mm"] == pytest.approx(0.001)
    line = json.loads(invoke("surface", plate, "--line", -9, 1, 9, 1, "--cutoff-mm", 2.5, "--json").stdout)
    assert line["sections"] == 5
    text = invoke("surface", plate, "--blur-mm", 0.2).stdout
    assert "the coating's blur takes 18%; it is an S-filter of 1.07 mm" in text
    assert "cutoff 8 mm; the gel reached 100.0%" in text


def test_the_map_is_written_and_nothing_replaced_unasked(plate: Path) -> None:
    out = plate.parent / "map.png"
    assert invoke("surface", plate, "--out", out).stdout.startswith("written: ")
    before = out.read_bytes()
    refused = invoke("surface", plate, "--out", out)
    assert "exists: choose another name" in str(refused.exception)
    assert out.read_bytes() == before
    assert invoke("surface", plate, "--out", out, "--overwrite").exit_code == 0


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--cutoff-mm", "-1"), "a cutoff of -1.0 mm is none"),
        (("--cutoff-mm", "50"), "a cutoff of 50 mm is too long"),
        (("--blur-mm", "-1"), "a blur of -1.0 mm is none"),
        (("--blur-mm", "0.5"), "takes 71% of them"),
        (("--line", "0", "0", "99", "0"), "none on this map"),
        (("--frame", "3"), "--frame is of a recording"),
        (("--out", "map.xyz"), "end its name with one of .png"),
    ],
)
def test_rubbish_is_refused_in_a_sentence(plate: Path, words: tuple[str, ...], message: str) -> None:
    done = invoke("surface", plate, *words)
    assert done.exception is not None
    assert message in str(done.exception)


@pytest.mark.parametrize("name", ["none.npz", "none.mcap", "rubbish.npz", "rubbish.mcap"])
def test_a_file_that_is_none_is_refused(tmp_path: Path, name: str) -> None:
    if name.startswith("rubbish"):
        (tmp_path / name).write_bytes(b"rubbish")
    done = invoke("surface", tmp_path / name)
    assert type(done.exception).__name__ == "InputError"
    assert name in str(done.exception)
    assert "Errno" not in str(done.exception)
