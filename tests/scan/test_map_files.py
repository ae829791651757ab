"""Maps as files, read back by other people's programs."""

import hashlib
import zipfile
from pathlib import Path

import cv2
import numpy as np
import pytest

from gellight.base.errors import InputError
from gellight_scan import map_files
from gellight_scan.height_map import HeightMap, load_height_map
from gellight_scan.map_files import write_maps
from gellight_scan.pictures import coloured_heights
from tests.helpers.ply import open_edges, read_ply, read_stl

PIXEL_MM = 0.25
Y, X = np.mgrid[:40, :60] * PIXEL_MM
HEIGHT = (0.2 + 0.01 * X + np.where(Y < 3, 0.05, 0.0)).astype(np.float32)
HEIGHT[20:30, 40:55] = np.nan
HEIGHT[0, :5] = np.nan
MAP = HeightMap(HEIGHT, np.where(np.isfinite(HEIGHT), np.float32(0.001), HEIGHT), PIXEL_MM)


@pytest.mark.nightly
def test_x3p_is_read_back_by_another_program(tmp_path: Path) -> None:
    surfalize = pytest.importorskip("surfalize", reason="the judge from outside is not installed")
    pytest.importorskip("x3pio")
    write_maps(MAP, [tmp_path / "map.x3p"])
    other = surfalize.Surface.load(tmp_path / "map.x3p")
    np.testing.assert_allclose(other.data[::-1], HEIGHT * 1e3, rtol=1e-6, err_msg="y points up in the file")
    assert (other.step_x, other.step_y) == pytest.approx((250.0, 250.0))


def test_x3p_holds_the_heights_and_the_checksums_of_the_standard(tmp_path: Path) -> None:
    pytest.importorskip("x3pio")
    write_maps(MAP, [tmp_path / "map.x3p"])
    with zipfile.ZipFile(tmp_path / "map.x3p") as archive:
        head = archive.read("main.xml")
        assert archive.read("md5checksum.hex").decode().split()[0].lower() == hashlib.md5(head).hexdigest()
        data = archive.read("bindata/data.bin")
        assert hashlib.md5(data).hexdigest() in head.decode().lower()
    heights = np.frombuffer(data).reshape(HEIGHT.shape)
    np.testing.assert_allclose(heights[::-1], HEIGHT * 1e-3, rtol=1e-6, err_msg="metres, y points up in the file")
    assert head.count(b">0.00025<") == 2, "its steps along both axes"


def test_an_stl_is_a_closed_solid_with_the_surface_on_top(tmp_path: Path) -> None:
    write_maps(MAP, [tmp_path / "map.stl"])
    corners = read_stl((tmp_path / "map.stl").read_bytes()).astype(float)
    _, points = np.unique(corners.reshape(-1, 3), axis=0, return_inverse=True)
    assert open_edges(points.reshape(-1, 3)) == 0
    low = float(np.nanmin(HEIGHT))
    z = corners[..., 2]
    assert (z.min(), z.max()) == pytest.approx((low - 2.0, np.nanmax(HEIGHT)), abs=1e-6)
    ends = slice(-1), slice(1, None)
    mean = np.mean([HEIGHT[rows, columns] for rows in ends for columns in ends], axis=0)
    volume = np.nansum(mean - low + 2.0) * PIXEL_MM**2
    assert np.linalg.det(corners).sum() / 6 == pytest.approx(volume, rel=1e-3), "its faces look outwards"


def test_a_ply_has_the_known_heights_and_faces_up(tmp_path: Path) -> None:
    write_maps(MAP, [tmp_path / "map.ply"])
    vertices, triangles, _ = read_ply(tmp_path / "map.ply")
    assert np.array_equal(vertices["z"], HEIGHT[np.isfinite(HEIGHT)])
    assert len({tuple(each) for each in zip(vertices["red"], vertices["green"], vertices["blue"], strict=True)}) > 20
    a, b, c = (np.stack([vertices["x"], vertices["y"]], axis=1)[triangles[:, corner]] for corner in range(3))
    assert (np.linalg.det(np.stack([b - a, c - a], axis=1)) > 0).all()


def test_a_picture_shows_heights_in_colour_the_unknown_hatched_and_a_scale(tmp_path: Path) -> None:
    write_maps(MAP, [tmp_path / "map.PNG"])
    picture = cv2.imread(str(tmp_path / "map.PNG")).astype(int)
    unknown, step = (
        picture[20 + 25 * 11 - 40 : 20 + 25 * 11 + 40, 20 + 47 * 11 - 40 : 20 + 47 * 11 + 40],
        picture[24:30],
    )
    assert np.ptp(unknown, axis=2).max() == 0, "grey"
    assert len(np.unique(unknown[..., 0])) == 2, "hatched"
    assert np.ptp(step[:, 200:640], axis=2).max() > 60, "coloured"
    rows = np.flatnonzero((picture[-26, :, :] > 220).all(axis=1))
    assert rows[rows < 112].size == pytest.approx(2.0 / PIXEL_MM * 11, abs=2), (
        "2 mm of 15 mm, 11 px to a pixel of the map"
    )


def test_an_npz_is_the_same_map_again(tmp_path: Path) -> None:
    write_maps(MAP, [tmp_path / "map.npz"])
    again = load_height_map(tmp_path / "map.npz")
    np.testing.assert_array_equal(again.height_mm, HEIGHT)
    np.testing.assert_array_equal(again.error_mm, MAP.error_mm)
    np.testing.assert_array_equal(again.reached, np.isfinite(HEIGHT))
    assert again.pixel_mm == PIXEL_MM


@pytest.mark.parametrize("ending", [".png", ".x3p", ".ply", ".stl", ".npz"])
def test_a_map_without_heights_is_no_file(tmp_path: Path, ending: str) -> None:
    nothing = np.full((5, 5), np.nan, np.float32)
    with pytest.raises(InputError, match="the map holds no heights"):
        write_maps(HeightMap(nothing, nothing, 0.1), [tmp_path / f"map{ending}"])
    assert list(tmp_path.iterdir()) == []


def test_what_cannot_be_written_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(InputError, match=r"end its name with one of \.png, \.x3p, \.ply, \.stl, \.npz"):
        write_maps(MAP, [tmp_path / "map.xyz"])
    with pytest.raises(InputError, match="was not written"):
        write_maps(MAP, [tmp_path / "nowhere" / "map.npz"])
    monkeypatch.setattr(map_files, "MOST_TRIANGLED", 100)
    for name in ("map.stl", "map.ply"):
        with pytest.raises(InputError, match="2245 pixels would become a huge mesh"):
            write_maps(MAP, [tmp_path / name])
    assert list(tmp_path.iterdir()) == []


def test_a_plain_map_is_a_picture_too(tmp_path: Path) -> None:
    flat = np.zeros((3, 4000), np.float32)
    write_maps(HeightMap(flat, flat, 0.1), [tmp_path / "flat.png"])
    assert cv2.imread(str(tmp_path / "flat.png")).shape[1] < 3200


def test_heights_that_nobody_knows_are_not_drawn() -> None:
    with pytest.raises(ValueError, match="none of the 12 heights is known"):
        coloured_heights(np.full((3, 4), np.nan))
