"""A gel with marker dots that is seen from the side, from its first pictures to depth by its bundle."""

import json
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
from gellight.frames.picture import steps_of
from gellight.lab.simulator.scene import Press, Scene
from sim_reference.camera import CameraResponse, digitise
from sim_reference.geometry import SensorGeometry
from tests.helpers.command_line import invoke, succeeded
from tests.helpers.dotted import CORNERS, from_the_side, with_dots
from tests.helpers.places import real

PIXEL_MM = 0.2352
BALL = ["--ball-radius-mm", "4", "--pixel-size-mm", str(PIXEL_MM)]
SEEN = ["--corners", " ".join(f"{x},{y}" for x, y in CORNERS), "--size", "160x120"]
reconstruct = typer.Typer()
reconstruct.command()(command)


def run(*arguments: object) -> Any:
    return invoke("calibrate", *arguments)


@pytest.fixture(scope="module")
def places() -> list[tuple[float, float]]:
    return [(x, y) for y in (-6.0, 0.0, 6.0) for x in (-10.0, -3.5, 3.5, 10.0)]


@pytest.fixture(scope="module")
def taken(tmp_path_factory: pytest.TempPathFactory, places: list[tuple[float, float]]) -> Path:
    """Presses at `places`, and the untouched gel: dotted, and from the side."""
    folder = tmp_path_factory.mktemp("taken")
    geometry = SensorGeometry(image_width_px=160, image_height_px=120, pixel_size_mm=PIXEL_MM)
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
    succeeded(run("view", taken, *SEEN, "--out", out))
    return out


def test_a_dotted_gel_from_the_side_is_calibrated_and_felt(
    taken: Path, view: Path, places: list[tuple[float, float]], tmp_path: Path
) -> None:
    reference = ["--reference", view / "untouched.png"]
    found = succeeded(run("detect", f"{view}/press*.png", *reference, *BALL, "--out", view / "presses.csv", "--json"))
    for record, (x, y) in zip(json.loads(found.stdout), places, strict=True):
        assert record["center_x_px"] == pytest.approx(x / PIXEL_MM + 79.5, abs=1.0)
        assert record["center_y_px"] == pytest.approx(y / PIXEL_MM + 59.5, abs=1.0)
    how = ["--recipe", "fast", "--view", view / "view.json"]
    succeeded(run("fit", "--presses", view / "presses.csv", *reference, *BALL, *how, "--out", tmp_path / "b"))
    steps = steps_of(load_bundle(tmp_path / "b"))
    assert steps.view is not None
    assert steps.dots is not None
    for number in (0, 5, 11):
        asked = [taken / f"press{number:02}.png", "--calibration", tmp_path / "b", "--out", tmp_path / "out"]
        succeeded(invoke(*asked, app=reconstruct))
        with np.load(tmp_path / f"out/press{number:02}.npz") as maps:
            depth_mm = maps["depth_mm"]
        assert depth_mm.max() == pytest.approx(1.5, abs=0.2)
        row, column = np.unravel_index(depth_mm.argmax(), depth_mm.shape)
        deepest = (column - 79.5) * PIXEL_MM, (row - 59.5) * PIXEL_MM
        assert np.hypot(deepest[0] - places[number][0], deepest[1] - places[number][1]) < 0.8


def test_pictures_are_never_replaced_unasked(taken: Path, view: Path, tmp_path: Path) -> None:
    for arguments in ([taken / "press00.png", *SEEN, "--out", taken], [taken / "press00.png", *SEEN, "--out", view]):
        assert isinstance(run("view", *arguments).exception, InputError)
    succeeded(run("view", taken / "press00.png", *SEEN, "--out", view, "--overwrite"))


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
    result = run("view", taken / "press00.png", *arguments, "--out", tmp_path / "out")
    assert isinstance(result.exception, InputError)
    with pytest.raises(InputError, match=words):
        raise result.exception
    assert not (tmp_path / "out").exists()


def test_16_bit_pictures_of_fewer_bits_are_brought_to_white(tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "deep.png"), np.full((20, 30), 511, np.uint16))
    succeeded(run("view", tmp_path / "deep.png", "--crop", "0,0,8,8", "--white", "1022", "--out", tmp_path / "out"))
    assert (read_image(tmp_path / "out/deep.png") == 128).all()


@pytest.mark.real_images("dots")
def test_the_presses_of_a_real_gel_with_dots_are_found(tmp_path: Path) -> None:
    """None of the 12 was found with its dots, in the perspective of the camera or out of it."""
    folder = real("dots")
    corners = ["--corners", "33,58 208,61 185,244 56,250", "--size", "240x320"]
    assert run("view", f"{folder}/*.jpg", *corners, "--out", tmp_path / "view").exit_code == 0
    ball = ["--ball-radius-mm", "2.42", "--pixel-size-mm", "0.1", "--reference", tmp_path / "view/bg-0.png"]
    result = succeeded(run("detect", f"{tmp_path}/view/ball-*.png", *ball, "--out", tmp_path / "presses.csv", "--json"))
    rows = [line.split(",") for line in (folder / "presses_after_warp.csv").read_text().splitlines()[1:]]
    labels = {Path(row[0]).stem: (float(row[1]), float(row[2])) for row in rows}
    found = {Path(record["image"]).stem: record for record in json.loads(result.stdout)}
    assert len(found) == 12
    for name, (x, y) in labels.items():  # the labels are of the rim, for orientation
        assert np.hypot(found[name]["center_x_px"] - x, found[name]["center_y_px"] - y) < 13
