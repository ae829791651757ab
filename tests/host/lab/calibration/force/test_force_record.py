"""The record of forces: what is read of it, and what is refused with line and value."""

from pathlib import Path

import pytest

from gellight.base.errors import InputError
from gellight.lab.calibration.force.record import ForceReadings


def read(tmp_path: Path, text: str) -> ForceReadings:
    (tmp_path / "forces.csv").write_text(text)
    return ForceReadings.read(tmp_path / "forces.csv")


def test_weights_beside_pictures(tmp_path: Path) -> None:
    readings = read(tmp_path, "image,force_n\na.png,0.5\nb.png,1\n")
    assert readings.images == (tmp_path / "a.png", tmp_path / "b.png")
    assert readings.force_n.tolist() == [0.5, 1.0]


def test_a_load_cell(tmp_path: Path) -> None:
    readings = read(tmp_path, "unix_s,force_n\n1000.5,-0.01\n1000.6,2\n")
    assert readings.images == ()
    assert readings.unix_s.tolist() == [1000.5, 1000.6]


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("image,newton\na.png,1\n", "first line must be image,force_n or unix_s,force_n"),
        ("image,unix_s,force_n\na.png,1,1\n", "first line must be"),
        ("image,force_n\n", "has no forces"),
        ("image,force_n\na.png,heavy\n", "line 2: force_n is 'heavy'"),
        ("image,force_n\na.png,nan\n", "line 2: force_n is 'nan'"),
        ("image,force_n\na.png,1\n,2\n", "line 3: column image is empty"),
        ("image,force_n\na.png,1\nb.png,-0.5\n", r"a force is -0.5 N: set the load cell to zero"),
        ("image,force_n\na.png,-1\nb.png,0\n", r"the largest force is 0 N"),
        ("unix_s,force_n\n5,1\n5,2\n", "line 3: unix_s does not rise"),
    ],
)
def test_what_is_no_record_is_refused(tmp_path: Path, text: str, reason: str) -> None:
    with pytest.raises(InputError, match=reason):
        read(tmp_path, text)


def test_a_missing_file_and_one_that_is_no_text_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="cannot be opened"):
        ForceReadings.read(tmp_path / "none.csv")
    (tmp_path / "forces.csv").write_bytes(b"image,force_n\n\xff\xfe,1\n")
    with pytest.raises(InputError, match="not a csv file"):
        ForceReadings.read(tmp_path / "forces.csv")
