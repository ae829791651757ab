"""`gellight calibrate lens`: pictures of a grid in, a bundle with its lens out, or one line that says why not."""

import json
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from gellight.base.errors import BundleError, InputError
from gellight.bundle.bundle import load_bundle
from gellight.reconstruction.lens.undistortion import LensRecord
from tests.helpers.command_line import invoke, refused, succeeded
from tests.helpers.distorted import PIXEL_MM, SHAPE, TrueLens, dimple_picture, pin_picture, untouched
from tests.helpers.linear_sensor import linear_bundle

BARREL = TrueLens(k1=-0.05, centre_px=(331.0, 230.0))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("grid")
    linear_bundle(place / "bundle", SHAPE, pixel_size_mm=(PIXEL_MM, PIXEL_MM))
    half = pin_picture(BARREL, only=(-np.inf, 0.0))
    pictures = {"grid": pin_picture(BARREL, noise=2.0), "half": half, "small": half[::2, ::2]}
    pictures |= {"dimples": dimple_picture(BARREL), "untouched": np.rint(untouched(SHAPE))}
    for name, picture in pictures.items():
        cv2.imwrite(str(place / f"{name}.png"), picture[..., ::-1])
    return place


def run(folder: Path, *arguments: str | Path, out: Path, pitch: str = "2") -> Any:
    given = ["calibrate", "lens", *arguments, "--pitch-mm", pitch, "--calibration", folder / "bundle", "--out", out]
    return invoke(*given)


def test_the_new_bundle_has_the_lens_and_all_the_rest(folder: Path, tmp_path: Path) -> None:
    result = succeeded(
        run(folder, folder / "grid.png", "--overlay", tmp_path / "seen.png", "--json", out=tmp_path / "new")
    )
    said = json.loads(result.stdout)
    assert said["rms_after_px"] < 0.1 < 1 < said["rms_before_px"]
    assert said["rms_before_mm"] == pytest.approx(said["rms_before_px"] * PIXEL_MM, rel=0.01)
    old, new = load_bundle(folder / "bundle"), load_bundle(tmp_path / "new")
    assert {**old.files, "lens.json": new.files["lens.json"]} == new.files
    record = LensRecord.in_bundle(new)
    assert (record.images, record.pitch_mm, record.learnt_from_circles) == (("grid.png",), 2.0, False)
    assert record.k1 == pytest.approx(-0.05, abs=0.002)
    assert cv2.imread(str(tmp_path / "seen.png")).shape == (2 * SHAPE[0], 2 * SHAPE[1], 3)


def test_pins_in_the_gel_are_read_with_a_reference_and_told_in_words(folder: Path, tmp_path: Path) -> None:
    reference = ["--reference", folder / "untouched.png"]
    result = succeeded(run(folder, folder / "dimples.png", *reference, out=tmp_path / "new"))
    assert "off a straight grid" in result.stdout
    assert "um rms" in result.stdout


@pytest.mark.parametrize(
    ("image", "pitch", "error", "said"),
    [
        ("half.png", "2", InputError, "hold no pin"),
        ("small.png", "2", BundleError, "delivers 320x240 pixels"),
        ("grid.png", "2.5", InputError, "give the right pitch"),
        ("grid.png", "-1", InputError, "pitch -1.0 mm"),
    ],
)
def test_what_cannot_be_measured_is_refused_and_nothing_is_written(
    folder: Path, tmp_path: Path, image: str, pitch: str, error: type[Exception], said: str
) -> None:
    result = run(folder, folder / image, out=tmp_path / "new", pitch=pitch)
    assert said in str(result.exception)
    assert isinstance(result.exception, error)
    assert not (tmp_path / "new").exists()


def test_an_existing_bundle_is_kept(folder: Path, tmp_path: Path) -> None:
    kept = load_bundle(folder / "bundle")
    assert "exists: choose another name" in refused(run(folder, folder / "grid.png", out=folder / "bundle"))
    assert load_bundle(folder / "bundle").identity == kept.identity
