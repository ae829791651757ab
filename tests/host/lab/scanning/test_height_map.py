"""A map of heights: what it refuses, and that its file holds it whole."""

from pathlib import Path

import numpy as np
import pytest

from gellight.base.errors import InputError
from gellight.lab.scanning.height_map import HeightMap, load_height_map


def a_map() -> HeightMap:
    """Return a map of 3 x 4 pixels with one that was not reached."""
    height = np.arange(12, dtype=np.float32).reshape(3, 4) / 100
    height[1, 2] = np.nan
    return HeightMap(height, np.where(np.isnan(height), np.nan, 0.01).astype(np.float32), 0.02)


def test_a_file_holds_the_map_whole(tmp_path: Path) -> None:
    """Heights, errors, the size of a pixel and what was not reached come back as they were."""
    a_map().save(tmp_path / "map.npz")
    back = load_height_map(tmp_path / "map.npz")
    np.testing.assert_array_equal(back.height_mm, a_map().height_mm)
    np.testing.assert_array_equal(back.error_mm, a_map().error_mm)
    assert back.pixel_mm == 0.02
    assert back.reached.sum() == 11
    assert not back.reached[1, 2]


@pytest.mark.parametrize(
    ("height", "error", "pixel_mm", "what"),
    [
        ((3, 4), (4, 3), 0.02, "shape"),
        ((12,), (12,), 0.02, "shape"),
        ((0, 4), (0, 4), 0.02, "shape"),
        ((3, 4), (3, 4), 0.0, "0.0 mm"),
        ((3, 4), (3, 4), float("nan"), "nan mm"),
    ],
)
def test_what_is_no_map_is_refused(height: tuple[int], error: tuple[int], pixel_mm: float, what: str) -> None:
    """The sentence says which value is wrong."""
    with pytest.raises(InputError, match=what):
        HeightMap(np.zeros(height, np.float32), np.zeros(error, np.float32), pixel_mm)


@pytest.mark.parametrize("content", [b"", b"rubbish", b"PK\x03\x04rubbish"])
def test_a_file_that_is_no_map_is_named(tmp_path: Path, content: bytes) -> None:
    """One sentence with the path, and what writes a map."""
    path = tmp_path / "map.npz"
    path.write_bytes(content)
    with pytest.raises(InputError, match=r"map\.npz is no map of heights .*gellight scan"):
        load_height_map(path)


def test_a_map_whose_data_is_damaged_is_named(tmp_path: Path) -> None:
    """What the archive packed cannot be unpacked, or is packed by a method that nobody knows."""
    path = tmp_path / "map.npz"
    HeightMap(np.ones((30, 40), np.float32), np.ones((30, 40), np.float32), 0.1).save(path)
    sound = path.read_bytes()
    for at, wrong in (
        (sound.index(b"height_mm.npy") + 13 + 20, b"\xff" * 8),
        (sound.index(b"PK\x01\x02") + 10, b"\x63\x00"),
    ):
        path.write_bytes(sound[:at] + wrong + sound[at + len(wrong) :])
        with pytest.raises(InputError, match=r"map\.npz is no map of heights"):
            load_height_map(path)


def test_a_field_that_is_missing_is_named(tmp_path: Path) -> None:
    """An npz of something else is no map."""
    np.savez(tmp_path / "other.npz", height_mm=np.zeros((2, 2)))
    with pytest.raises(InputError, match="error_mm"):
        load_height_map(tmp_path / "other.npz")


def test_a_device_is_no_map() -> None:
    """It would be read for ever."""
    with pytest.raises(InputError, match=r"/dev/zero is no map of heights .*no regular file"):
        load_height_map(Path("/dev/zero"))
