"""`gellight reconstruct`: the files it writes, what it prints, and what it refuses before and during the work."""

import errno
import json
import os
import re
from dataclasses import replace
from pathlib import Path
from unittest.mock import Mock

import cv2
import numpy as np
import pytest
from typer.testing import Result

from gellight.bundle.bundle import extend_bundle, load_bundle, save_bundle
from gellight.cli.ending import Ending
from gellight.frame_path.pipeline import Reconstructor
from gellight.frames.image_files import ImageCamera, read_image
from gellight.lab.report.pictures import (
    depth_bar,
    depth_picture,
    difference_picture,
    four_panels,
    normal_picture,
    write_png,
)
from tests.helpers.analytic_surfaces import gaussian
from tests.helpers.children import gellight
from tests.helpers.command_line import invoke, refused
from tests.helpers.linear_sensor import linear_bundle, photograph
from tests.helpers.places import of_real, real_picture
from tests.helpers.weighed import force_files

SHAPE = (120, 160)


@pytest.fixture
def bundle(tmp_path: Path) -> Path:
    linear_bundle(tmp_path / "bundle", SHAPE)
    return tmp_path / "bundle"


def press(path: Path, height: float = 8.0, shape: tuple[int, int] = SHAPE) -> Path:
    path.parent.mkdir(exist_ok=True)
    image = photograph(gaussian(shape, 12, (10, -5), height).gradient_map, noise_grey=0.5).image
    assert cv2.imwrite(str(path), image[..., ::-1])
    return path


def run(*arguments: object) -> Result:
    return invoke("reconstruct", *arguments)


def test_maps_and_picture_of_each_image_are_written(tmp_path: Path, bundle: Path) -> None:
    paths = [press(tmp_path / "in" / f"press{i}.png", height) for i, height in ((1, 8.0), (2, 4.0))]
    result = run(*paths, "--calibration", bundle, "--out", tmp_path / "out" / "deep")
    assert result.exception is None
    names = sorted(p.name for p in (tmp_path / "out" / "deep").iterdir())
    assert names == ["press1.npz", "press1.png", "press2.npz", "press2.png"]
    with np.load(tmp_path / "out" / "deep" / "press1.npz") as maps:
        assert {name: (maps[name].shape, maps[name].dtype) for name in maps.files} == {
            "gradient_map": ((*SHAPE, 2), np.float32),
            "normal_map": ((*SHAPE, 3), np.float32),
            "depth_mm": (SHAPE, np.float32),
            "contact": (SHAPE, np.bool_),
            "confidence": (SHAPE, np.float32),
            "quality_flags": (SHAPE, np.uint8),
            "findings": ((0,), np.dtype("<U1")),
        }
        assert maps["depth_mm"].max() == pytest.approx(0.4, abs=0.01)
        assert maps["contact"].sum() == pytest.approx(np.pi * 1.24**2 * 144, rel=0.05)
    assert read_image(tmp_path / "out" / "deep" / "press1.png").shape[0] > 2 * SHAPE[0]
    assert "press1.png" in result.stdout
    assert "indentation mm" in result.stdout


def test_a_name_that_is_not_utf_8_is_drawn_printed_and_written(tmp_path: Path, bundle: Path) -> None:
    """As archives have them that were packed on a Chinese Windows. OpenCV dies of such a text."""
    name = os.fsdecode("按压.png".encode("gbk"))
    press(tmp_path / "press.png").rename(tmp_path / name)
    done = gellight("reconstruct", tmp_path / name, "--calibration", bundle, "--out", tmp_path / "out")
    assert "\\udcb0" in done.stdout
    assert (tmp_path / "out" / name).is_file()
    assert ImageCamera([tmp_path / name]).read().source.endswith("\ufffd\ufffd\u0479.png")


def test_force_and_pressure_are_written_where_the_bundle_knows_them(tmp_path: Path, bundle: Path) -> None:
    plain = load_bundle(bundle)
    extend_bundle(plain, tmp_path / "knowing", force_files())
    path = press(tmp_path / "in" / "press.png")
    result = run(path, "--calibration", tmp_path / "knowing", "--out", tmp_path / "out", "--json")
    (row,) = json.loads(result.stdout)
    with np.load(tmp_path / "out" / "press.npz") as maps:
        assert maps["pressure_mpa"].shape == SHAPE
        assert maps["pressure_mpa"].sum() * 0.05**2 == pytest.approx(row["force_n"], rel=1e-3)
        assert (maps["force_n"], maps["force_error_n"]) == (row["force_n"], row["force_error_n"])
    assert 0 < row["force_error_n"] < row["force_n"]
    (row,) = json.loads(run(path, "--calibration", bundle, "--out", tmp_path / "out", "--json").stdout)
    assert row["force_n"] is None
    words = run(path, "--calibration", tmp_path / "knowing", "--out", tmp_path / "out").stdout
    assert " N\n" in words


def test_json_has_the_contact_of_each_image(tmp_path: Path, bundle: Path) -> None:
    press(tmp_path / "in" / "press10.png", 4.0)
    press(tmp_path / "in" / "press9.png", 8.0)
    press(tmp_path / "in" / "rest.png", 0.0)
    result = run(tmp_path / "in", "--calibration", bundle, "--out", tmp_path / "out", "--json")
    contacts = json.loads(result.stdout)
    assert [Path(c["image"]).name for c in contacts] == ["press9.png", "press10.png", "rest.png"]
    assert contacts[0]["indentation_mm"] == pytest.approx(0.4, abs=0.01)
    assert contacts[1]["indentation_mm"] == pytest.approx(0.2, abs=0.01)
    assert contacts[0]["centroid_mm"] == pytest.approx([0.5, -0.25], abs=0.02)
    assert (contacts[2]["area_mm2"], contacts[2]["centroid_mm"]) == (0, None)
    assert Path(contacts[2]["npz"]).is_file()
    assert Path(contacts[2]["png"]).is_file()
    table = run(tmp_path / "in", "--calibration", bundle, "--out", tmp_path / "out").stdout
    assert "no contact" in table


def of_gel(tmp_path: Path, thickness_mm: float) -> Path:
    """A bundle of the linear sensor whose gel is so thick."""
    bundle = linear_bundle(tmp_path / "told", SHAPE)
    manifest = bundle.manifest.model_copy(update={"gel_thickness_mm": thickness_mm})
    save_bundle(replace(bundle, manifest=manifest), tmp_path / "told", overwrite=True)
    return tmp_path / "told"


def findings(npz: Path) -> list[str]:
    with np.load(npz) as maps:
        return maps["findings"].tolist()


def test_a_depth_that_the_gel_cannot_have_is_said_and_all_is_written(tmp_path: Path) -> None:
    paths = [press(tmp_path / "in" / f"{name}.png", height) for name, height in (("deep", 8.0), ("fine", 4.0))]
    result = run(*paths, "--calibration", of_gel(tmp_path, 0.3), "--out", tmp_path / "out")
    assert result.exit_code == Ending.JUDGED_BAD
    assert result.stdout.count("too_deep: 0.4 mm deep in a gel that is 0.3 mm thick: the bundle is of another") == 1
    (finding,) = findings(tmp_path / "out" / "deep.npz")
    assert finding in result.stdout
    assert findings(tmp_path / "out" / "fine.npz") == []
    assert result.stderr == ""
    rows = json.loads(run(*paths, "--calibration", tmp_path / "told", "--out", tmp_path / "out", "--json").stdout)
    assert [row["findings"] for row in rows] == [[finding], []]


def test_a_bundle_that_does_not_know_its_gel_says_so_and_the_settings_may_tell(
    tmp_path: Path, bundle: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = press(tmp_path / "1.png")
    result = run(path, "--calibration", bundle, "--out", tmp_path / "out")
    assert result.exit_code == Ending.DONE
    assert "no depth was judged, since nobody told how thick the gel is" in result.stderr
    monkeypatch.setenv("GELLIGHT_GEOMETRY_GEL_THICKNESS_MM", "0.3")
    result = run(path, "--calibration", bundle, "--out", tmp_path / "out")
    assert result.exit_code == Ending.JUDGED_BAD
    assert result.stderr == ""


def test_a_contact_of_colours_that_nothing_learnt_is_said(tmp_path: Path) -> None:
    write_png(tmp_path / "bright.png", np.full((*SHAPE, 3), 255, np.uint8))
    result = invoke(
        "reconstruct", tmp_path / "bright.png", "--calibration", of_gel(tmp_path, 50.0), "--out", tmp_path / "out"
    )
    assert result.exit_code == Ending.JUDGED_BAD
    assert re.search(r"not_learnt: \d+% of the contact is a guess \(\d+% too bright\)", result.stdout)
    assert len(findings(tmp_path / "out" / "bright.npz")) == 1


@pytest.mark.parametrize(
    ("light", "depth_mm", "told"),
    [(1.0, 0.4, ""), (0.9, 0.4, "by up to 10."), (1.1, 0.4, "by up to 10."), (0.6, None, "by up to 4")],
)
def test_light_that_differs_from_the_reference_is_taken_out_and_told(
    tmp_path: Path, bundle: Path, light: float, depth_mm: float | None, told: str
) -> None:
    image = read_image(press(tmp_path / "in" / "as_calibrated.png"))
    assert cv2.imwrite(str(tmp_path / "in" / "press.png"), np.rint(light * image)[..., ::-1].clip(0, 255))
    result = run(tmp_path / "in" / "press.png", "--calibration", bundle, "--out", tmp_path / "out")
    assert ("the light differs from the reference's" in result.output) == bool(told)
    assert told in result.output
    if depth_mm is None:
        assert result.exit_code == 1
        assert "other_light: " in result.output
    else:
        with np.load(tmp_path / "out" / "press.npz") as maps:
            assert maps["depth_mm"].max() == pytest.approx(depth_mm, rel=0.03)


@pytest.mark.parametrize(
    "name",
    [
        "three_lights/press.png",
        "ball_plate/plate.png",
        *map(of_real, ("gelsight_mini_ball/0001.png", "digit_ball/0002.png", "gripper_ball/0003.png")),
    ],
)
def test_the_bundle_of_another_sensor_is_found_out(tmp_path: Path, name: str) -> None:
    picture = cv2.resize(cv2.imread(str(real_picture(name))), (640, 480))
    cv2.imwrite(str(tmp_path / "real.png"), picture)
    result = run(tmp_path / "real.png", "--calibration", "synthetic", "--out", tmp_path / "out")
    assert result.exit_code == Ending.JUDGED_BAD
    assert "mm deep in a gel that is 5 mm thick" in result.stdout


def test_images_that_would_write_one_file_are_refused_before_any_work(tmp_path: Path, bundle: Path) -> None:
    first, second = press(tmp_path / "a" / "Ball.png"), press(tmp_path / "b" / "ball.png")
    message = refused(run(first, second, "--calibration", bundle, "--out", tmp_path / "out"))
    assert str(first) in message
    assert str(second) in message
    assert "reconstruct them apart" in message
    assert not (tmp_path / "out").exists()


def test_a_picture_never_replaces_an_image(tmp_path: Path, bundle: Path) -> None:
    path = press(tmp_path / "in" / "ball.png")
    before = path.read_bytes()
    assert "give another folder to --out" in refused(run(path, "--calibration", bundle, "--out", tmp_path / "in"))
    assert path.read_bytes() == before


def test_an_image_of_another_size_ends_the_work_with_its_name(tmp_path: Path, bundle: Path) -> None:
    first, second = press(tmp_path / "a" / "1.png"), press(tmp_path / "a" / "2.png", shape=(60, 80))
    message = refused(run(first, second, "--calibration", bundle, "--out", tmp_path / "out"))
    assert "2.png is 80 x 60 px" in message
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == ["1.npz", "1.png"]
    assert "160 x 120 px" in refused(run(second, "--calibration", bundle, "--out", tmp_path / "out"))


@pytest.mark.parametrize("option", [["--least-squares"], ["--white", "200"]])
def test_an_option_that_would_change_nothing_is_refused(tmp_path: Path, bundle: Path, option: list[str]) -> None:
    result = invoke(
        "reconstruct", press(tmp_path / "a.png"), "--calibration", bundle, "--out", tmp_path / "out", *option
    )
    assert f"{option[0]} has no effect with a bundle of one light" in refused(result)
    assert not (tmp_path / "out").exists()


def test_a_full_disk_leaves_no_part_of_a_file(tmp_path: Path, bundle: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = press(tmp_path / "1.png")
    monkeypatch.setattr(Path, "replace", Mock(side_effect=OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))))
    message = refused(run(path, "--calibration", bundle, "--out", tmp_path / "out"))
    assert "No space left on device" in message
    assert not list((tmp_path / "out").iterdir())


def test_out_that_is_a_file_is_refused(tmp_path: Path, bundle: Path) -> None:
    path = press(tmp_path / "1.png")
    (tmp_path / "out").write_text("")
    assert "give --out a folder" in refused(run(path, "--calibration", bundle, "--out", tmp_path / "out"))


def test_equal_depths_have_equal_colours_in_every_picture_normals_and_differences_their_usual_ones() -> None:
    shallow, deep = np.full((4, 4), 0.1), np.full((4, 4), 0.1)
    deep[0, 0] = 0.9
    assert (depth_picture(shallow)[3, 3] == depth_picture(deep)[3, 3]).all()
    brightness = depth_picture(np.linspace(-0.2, 1.5, 50)[None]).sum(axis=2, dtype=int)[0]
    assert (np.diff(brightness) >= 0).all()
    assert brightness[0] < 20
    with pytest.raises(ValueError, match="scale_um = 0"):
        depth_picture(deep, scale_um=0)
    right_up_towards = np.eye(3) * [1, -1, 1]
    assert normal_picture(right_up_towards[None]).tolist() == [[[255, 127, 127], [127, 255, 127], [127, 127, 255]]]
    assert difference_picture(np.array([[[0.0, -200.0, 200.0]]])).tolist() == [[[127, 0, 255]]]


@pytest.mark.parametrize("scale_um", [1, 100, 150, 250, 1000, 3000])
def test_the_colour_bar_runs_from_zero_to_the_scale(scale_um: float) -> None:
    bar = depth_bar(240, 80, scale_um=scale_um)
    ends = depth_picture(np.array([[0.0, scale_um / 1000]]), scale_um=scale_um)[0]
    assert (bar[229, 5] == ends[0]).all()
    assert (bar[10, 5] == ends[1]).all()
    inside = bar[10:230, :18]
    assert (inside == inside[:, :1]).all(), "of one colour from side to side"
    assert (bar[:10, :18] == bar[0, 0]).all()
    assert (bar[:10, :18] != inside[0]).any()


def test_each_tick_of_the_colour_bar_stands_at_its_colour() -> None:
    bar = depth_bar(221, 80, scale_um=500)
    rows = np.flatnonzero((bar[:, 18:24] != bar[0, 0]).any(axis=2).all(axis=1))
    assert rows.tolist() == [10 + 20 * number for number in range(11)]
    colours = depth_picture(np.linspace(0.5, 0, 11)[:, None], scale_um=500)[:, 0]
    assert np.abs(bar[rows, 5].astype(int) - colours).max() <= 2
    numbers = (bar[:, 28:] != bar[0, 0]).any(axis=(1, 2))
    assert all(numbers[row - 4 : row + 5].any() for row in rows), "each with its number"


def test_the_sheet_shows_the_four_panels_unscaled(tmp_path: Path) -> None:
    shape = (240, 320)
    reconstructor = Reconstructor(linear_bundle(tmp_path / "b", shape))
    frame = reconstructor.reconstruct(photograph(gaussian(shape, 20, (0, 0), 10).gradient_map))
    sheet = four_panels(frame)
    assert sheet.dtype == np.uint8
    doubled = frame.camera_frame.image.repeat(2, axis=0).repeat(2, axis=1)
    assert (sheet[54 : 54 + 480, 20 : 20 + 640] == doubled).all()

    def at(top: int, left: int) -> np.ndarray:
        return sheet[top : top + 480 : 2, left : left + 640 : 2]

    assert (at(54, 680) == difference_picture(frame.difference)).all()
    assert (at(588, 20) == normal_picture(frame.normal_map)).all()
    outline = (at(588, 680) != depth_picture(frame.depth_mm)).any(axis=2)
    mask = frame.contact.mask.astype(np.uint8)
    assert outline.any()
    assert not outline[cv2.dilate(mask, np.ones((3, 3))) == cv2.erode(mask, np.ones((3, 3)))].any()
    paper = (sheet == sheet[0, 0]).all(axis=2)
    assert not paper[598:1058, 1332:1350].any(), "the colour bar"
    assert paper[:20].all()
    assert paper[1068:].all()
    assert paper[:, :20].all()
    assert all((~paper[top : top + 34, left : left + 640]).any() for top in (20, 554) for left in (20, 680)), "titles"
