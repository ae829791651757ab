"""`gellight calibrate detect` and `view`: images in, circles and pictures of the gel out, or a reason for each."""

import json
import os
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import typer

from gellight.base.errors import InputError
from gellight.bundle.bundle import load_bundle
from gellight.cli.reconstruct import command
from gellight.frames.image_files import read_image
from gellight.frames.picture import PictureSteps
from gellight.lab.simulator.scene import Press, Scene
from gellight.lab.training.label_file import read_presses
from gellight.lab.training.presses import Ball
from sim_reference.camera import CameraResponse, digitise
from sim_reference.geometry import SensorGeometry
from tests.helpers.children import gellight
from tests.helpers.command_line import invoke, refused, succeeded
from tests.helpers.dotted import CORNERS, from_the_side, with_dots
from tests.helpers.places import real

PIXEL_MM = 0.1176
BALL = ["--ball-radius-mm", "4", "--pixel-size-mm", str(PIXEL_MM)]
PLACES = ((-9.0, -5.0, 0.8), (8.0, 4.0, 1.5), (0.5, 0.0, 2.0))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three presses of the simulated sensor, one picture of nothing, one that is no picture."""
    place = tmp_path_factory.mktemp("presses")
    scene = Scene(SensorGeometry(image_width_px=320, image_height_px=240, pixel_size_mm=PIXEL_MM), CameraResponse())
    random = np.random.default_rng(0)
    shown = [Press("BALL", depth, x, y) for x, y, depth in PLACES] + [None, None]
    for name, press in zip(("a", "b", "c", "nothing", "untouched"), shown, strict=True):
        image = digitise(scene.show(press)[0], 1.0, random)
        cv2.imwrite(str(place / f"{name}.png"), image[..., ::-1])
    (place / "broken.png").write_bytes(b"no picture")
    return place


def run(folder: Path, *arguments: str | Path, out: Path) -> Any:
    given = ["detect", *arguments, "--reference", folder / "untouched.png", *BALL, "--out", out]
    return invoke("calibrate", *given)


def test_the_csv_is_what_fit_reads_and_the_circles_are_right(folder: Path) -> None:
    result = succeeded(run(folder, *(folder / f"{name}.png" for name in "abc"), out=folder / "presses.csv"))
    assert "3 circles, 0 images refused" in result.stdout
    ball = Ball(radius_mm=4, pixel_size_mm=PIXEL_MM)
    presses = read_presses(folder / "presses.csv", ball=ball, image_shape=(240, 320))
    for press, (x, y, _) in zip(presses, PLACES, strict=True):
        assert press.center_x_px == pytest.approx(x / PIXEL_MM + 159.5, abs=0.6)
        assert press.center_y_px == pytest.approx(y / PIXEL_MM + 119.5, abs=0.6)


def test_a_name_that_is_not_utf_8_is_in_the_csv_as_on_the_disk(folder: Path, tmp_path: Path) -> None:
    image, out = tmp_path / os.fsdecode("按压.png".encode("gbk")), tmp_path / "presses.csv"
    image.write_bytes((folder / "a.png").read_bytes())
    gellight("calibrate", "detect", image, "--reference", folder / "untouched.png", *BALL, "--out", out, check=True)
    (press,) = read_presses(out, ball=Ball(radius_mm=4, pixel_size_mm=PIXEL_MM), image_shape=(240, 320))
    assert press.image == image


def test_a_press_whose_centre_is_off_the_picture_has_its_row_and_its_errors(folder: Path, tmp_path: Path) -> None:
    scene = Scene(SensorGeometry(image_width_px=320, image_height_px=240, pixel_size_mm=PIXEL_MM), CameraResponse())
    image = digitise(scene.show(Press("BALL", 1.5, -19.2, 2.0))[0], 1.0, np.random.default_rng(0))
    cv2.imwrite(str(tmp_path / "cut.png"), image[..., ::-1])
    result = succeeded(run(folder, tmp_path / "cut.png", "--json", out=tmp_path / "presses.csv"))
    (found,) = json.loads(result.stdout)
    ball = Ball(radius_mm=4, pixel_size_mm=PIXEL_MM)
    (press,) = read_presses(tmp_path / "presses.csv", ball=ball, image_shape=(240, 320))
    assert press.center_x_px == pytest.approx(159.5 - 19.2 / PIXEL_MM, abs=3 * found["center_error_px"])
    assert 0 < found["center_error_px"] < 0.07 * ball.radius_px
    assert found["radius_error_px"] > 0


def test_a_refused_image_has_its_reason_and_is_passed_over(folder: Path, tmp_path: Path) -> None:
    images = [folder / f"{name}.png" for name in ("a", "nothing", "broken")]
    result = run(folder, *images, "--json", out=tmp_path / "presses.csv")
    assert result.exit_code == 1
    found = {Path(record["image"]).stem: record for record in json.loads(result.stdout)}
    assert found["a"]["quality"] > 0.9
    assert "no press" in found["nothing"]["refused"]
    assert "not an image" in found["broken"]["refused"]
    assert "no press" in (tmp_path / "presses.csv").read_text()
    presses = read_presses(
        tmp_path / "presses.csv", ball=Ball(radius_mm=4, pixel_size_mm=PIXEL_MM), image_shape=(240, 320)
    )
    assert [press.image.name for press in presses] == ["a.png"]


def test_without_any_circle_every_reason_is_told_and_nothing_is_written(
    folder: Path, tmp_path: Path, tmp_path_factory: pytest.TempPathFactory
) -> None:
    long = tmp_path_factory.mktemp("long") / "a_name_of_twenty-six.letters.png"
    long.write_bytes((folder / "nothing.png").read_bytes())
    images = [long, folder / "broken.png"]
    result = run(folder, *images, "--json", out=tmp_path / "presses.csv")
    assert "no circle in any of 2 images" in refused(result)
    nothing, broken = json.loads(result.stdout)
    assert "no press" in nothing["refused"]
    assert "not an image" in broken["refused"]
    table = run(folder, *images, out=tmp_path / "presses.csv").stdout
    assert "letters.png refused: no press" in table
    assert "not an image" in table
    assert "wrote" not in table
    assert list(tmp_path.iterdir()) == []


def test_the_overlay_shows_the_circle_on_the_picture(folder: Path, tmp_path: Path) -> None:
    succeeded(run(folder, folder / "c.png", "--overlay", tmp_path / "seen", out=tmp_path / "presses.csv"))
    drawn, before = read_image(tmp_path / "seen/c.png"), read_image(folder / "c.png")
    changed = np.argwhere((drawn != before).any(axis=2))
    centre = np.array([119.5, 0.5 / PIXEL_MM + 159.5])
    assert np.linalg.norm(changed.mean(axis=0) - centre) < 2
    with pytest.raises(InputError, match="would replace it"):
        raise run(folder, folder / "c.png", "--overlay", folder, out=tmp_path / "other.csv").exception
    np.testing.assert_array_equal(read_image(folder / "c.png"), before)


def test_an_existing_csv_is_kept_and_no_image_counts_twice(folder: Path, tmp_path: Path) -> None:
    (tmp_path / "presses.csv").write_text("mine")
    assert "exists: choose another name" in refused(run(folder, folder / "a.png", out=tmp_path / "presses.csv"))
    assert (tmp_path / "presses.csv").read_text() == "mine"
    twice = run(folder, folder / "a.png", folder / "a.png", out=tmp_path / "other.csv")
    assert "is given twice" in refused(twice)


def test_a_place_that_cannot_be_written_is_told(folder: Path, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("no folder")
    for out in (tmp_path / "file/presses.csv", folder):
        assert "cannot be written" in str(run(folder, folder / "a.png", "--overwrite", out=out).exception)
    result = run(folder, folder / "a.png", "--overlay", tmp_path / "file", out=tmp_path / "presses.csv")
    assert "--overlay: " in refused(result)
    assert not (tmp_path / "presses.csv").exists(), "it is refused before the work"


def test_what_was_found_is_printed_also_where_it_cannot_be_written(folder: Path, tmp_path: Path) -> None:
    """It took minutes; it was lost where the csv or the overlays could not be written."""
    (tmp_path / "seen/a.png").mkdir(parents=True)
    for how in (["--overlay", tmp_path / "seen"], []):
        out = tmp_path / ("presses.csv" if how else "seen")
        result = run(folder, folder / "a.png", folder / "nothing.png", "--json", *how, "--overwrite", out=out)
        assert isinstance(result.exception, InputError)
        found, nothing = json.loads(result.stdout)
        assert found["quality"] > 0.9
        assert "no press" in nothing["refused"]


# ---- a gel with marker dots, seen from the side ----


COARSE_MM = 0.2352
COARSE_BALL = ["--ball-radius-mm", "4", "--pixel-size-mm", str(COARSE_MM)]
SEEN = ["--corners", " ".join(f"{x},{y}" for x, y in CORNERS), "--size", "160x120"]
reconstruct = typer.Typer()
reconstruct.command()(command)


def calibrate(*arguments: object) -> Any:
    return invoke("calibrate", *arguments)


@pytest.fixture(scope="module")
def places() -> list[tuple[float, float]]:
    return [(x, y) for y in (-6.0, 0.0, 6.0) for x in (-10.0, -3.5, 3.5, 10.0)]


@pytest.fixture(scope="module")
def taken(tmp_path_factory: pytest.TempPathFactory, places: list[tuple[float, float]]) -> Path:
    """Presses at `places`, and the untouched gel: dotted, and from the side."""
    folder = tmp_path_factory.mktemp("taken")
    geometry = SensorGeometry(image_width_px=160, image_height_px=120, pixel_size_mm=COARSE_MM)
    scene, random = Scene(geometry, CameraResponse()), np.random.default_rng(0)
    presses = {f"press{i:02}": Press("BALL", 1.5, x, y) for i, (x, y) in enumerate(places)}
    for number, (name, press) in enumerate({**presses, "untouched": None}.items()):
        image = digitise(scene.show(press)[0], 1.0, random)
        image = from_the_side(with_dots(image, shift=(0.3 * (number % 4), 0.2 * (number % 3))))
        cv2.imwrite(str(folder / f"{name}.png"), image[..., ::-1])
    return folder


@pytest.fixture(scope="module")
def view(taken: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("view")
    succeeded(calibrate("view", taken, *SEEN, "--out", out))
    return out


def test_a_dotted_gel_from_the_side_is_calibrated_and_felt(
    taken: Path, view: Path, places: list[tuple[float, float]], tmp_path: Path
) -> None:
    reference = ["--reference", view / "untouched.png"]
    found = succeeded(
        calibrate("detect", f"{view}/press*.png", *reference, *COARSE_BALL, "--out", view / "presses.csv", "--json")
    )
    for record, (x, y) in zip(json.loads(found.stdout), places, strict=True):
        assert record["center_x_px"] == pytest.approx(x / COARSE_MM + 79.5, abs=1.0)
        assert record["center_y_px"] == pytest.approx(y / COARSE_MM + 59.5, abs=1.0)
    how = ["--recipe", "fast", "--width", "16", "--epochs", "50", "--view", view / "view.json"]
    succeeded(
        calibrate("fit", "--presses", view / "presses.csv", *reference, *COARSE_BALL, *how, "--out", tmp_path / "b")
    )
    steps = PictureSteps.in_bundle(load_bundle(tmp_path / "b"))
    assert steps.view is not None
    assert steps.dots is not None
    for number in (0, 5, 11):
        asked = [taken / f"press{number:02}.png", "--calibration", tmp_path / "b", "--out", tmp_path / "out"]
        succeeded(invoke(*asked, app=reconstruct))
        with np.load(tmp_path / f"out/press{number:02}.npz") as maps:
            depth_mm = maps["depth_mm"]
        assert depth_mm.max() == pytest.approx(1.5, abs=0.2)
        row, column = np.unravel_index(depth_mm.argmax(), depth_mm.shape)
        deepest = (column - 79.5) * COARSE_MM, (row - 59.5) * COARSE_MM
        assert np.hypot(deepest[0] - places[number][0], deepest[1] - places[number][1]) < 0.8


def test_pictures_are_never_replaced_unasked(taken: Path, view: Path, tmp_path: Path) -> None:
    for arguments in ([taken / "press00.png", *SEEN, "--out", taken], [taken / "press00.png", *SEEN, "--out", view]):
        assert isinstance(calibrate("view", *arguments).exception, InputError)
    succeeded(calibrate("view", taken / "press00.png", *SEEN, "--out", view, "--overwrite"))


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ([], "give --corners, --crop or --grid"),
        (["--crop", "0,0,9,9", *SEEN], "one way"),
        (["--corners", "1,2 3,4", "--size", "9x9"], "--corners .* give 8 numbers"),
        (SEEN[:2], "needs --size"),
        (["--crop", "0,0,999,9"], "leaves the picture"),
    ],
)
def test_a_view_that_is_not_said_is_refused(taken: Path, tmp_path: Path, arguments: list[str], words: str) -> None:
    result = calibrate("view", taken / "press00.png", *arguments, "--out", tmp_path / "out")
    assert isinstance(result.exception, InputError)
    with pytest.raises(InputError, match=words):
        raise result.exception
    assert not (tmp_path / "out").exists()


def test_16_bit_pictures_of_fewer_bits_are_brought_to_white(tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "deep.png"), np.full((20, 30), 511, np.uint16))
    succeeded(
        calibrate("view", tmp_path / "deep.png", "--crop", "0,0,8,8", "--white", "1022", "--out", tmp_path / "out")
    )
    assert (read_image(tmp_path / "out/deep.png") == 128).all()


@pytest.mark.real_images("dots")
def test_the_presses_of_a_real_gel_with_dots_are_found(tmp_path: Path) -> None:
    """None of the 12 was found with its dots, in the perspective of the camera or out of it."""
    folder = real("dots")
    corners = ["--corners", "33,58 208,61 185,244 56,250", "--size", "240x320"]
    assert calibrate("view", f"{folder}/*.jpg", *corners, "--out", tmp_path / "view").exit_code == 0
    ball = ["--ball-radius-mm", "2.42", "--pixel-size-mm", "0.1", "--reference", tmp_path / "view/bg-0.png"]
    result = succeeded(
        calibrate("detect", f"{tmp_path}/view/ball-*.png", *ball, "--out", tmp_path / "presses.csv", "--json")
    )
    rows = [line.split(",") for line in (folder / "presses_after_warp.csv").read_text().splitlines()[1:]]
    labels = {Path(row[0]).stem: (float(row[1]), float(row[2])) for row in rows}
    found = {Path(record["image"]).stem: record for record in json.loads(result.stdout)}
    assert len(found) == 12
    for name, (x, y) in labels.items():  # the labels are of the rim, for orientation
        assert np.hypot(found[name]["center_x_px"] - x, found[name]["center_y_px"] - y) < 13
