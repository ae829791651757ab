"""`gellight calibrate fit`: from labelled presses to a bundle."""

import csv
import json
import re
import signal
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from unittest.mock import Mock

import numpy as np
import pytest

from gellight.base.errors import TrainingError
from gellight.bundle.bundle import Bundle, load_bundle
from gellight.cli.calibrate.told_ball import told_ball
from gellight.cli.calibrate.training_options import Recorded
from gellight.cli.running import training
from gellight.frame_path.pipeline import Reconstructor
from gellight.frames import view
from gellight.frames.image_files import ImageCamera
from gellight.frames.picture import prepared
from gellight.lab.training import child
from gellight.lab.training.label_file import read_presses
from gellight.lab.training.presses import Ball, Press
from gellight.reconstruction.integration import angle_deg
from tests.helpers.command_line import refused, succeeded
from tests.helpers.pressed_pictures import BALL, run, sources


def test_the_settings_tell_how_high_the_camera_stands(
    pressed: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    quick = ["--recipe", "fast", "--width", "1", "--epochs", "1", "--largest-normal-error-deg", "90"]
    for told_mm, words in ((0.0, "seen from far away"), (45.0, "seen from 45.0 mm above the gel")):
        if told_mm:
            monkeypatch.setenv("GELLIGHT_GEOMETRY_CAMERA_HEIGHT_MM", f"{told_mm}")
        result = run("fit", *sources(pressed), "--out", tmp_path / f"{told_mm}", *quick)
        assert words in result.stdout
        assert load_bundle(tmp_path / f"{told_mm}").manifest.camera_height_mm == told_mm
    assert told_ball(4.0, 0.1).camera_height_mm == 45.0
    monkeypatch.setenv("GELLIGHT_GEOMETRY_WINDOW", "true")
    assert told_ball(4.0, 0.1).camera_height_mm == pytest.approx(1.41 * (45 - 8) + 8)
    monkeypatch.setenv("GELLIGHT_GEOMETRY_PERSPECTIVE", "false")
    assert told_ball(4.0, 0.1).camera_height_mm == np.inf


def test_fit_writes_a_bundle_that_says_how_it_came_about_and_how_square_pixels_are(bundle: Path, pressed: Path) -> None:
    written = load_bundle(bundle)
    assert written.manifest.sensor == "S1"
    assert written.manifest.reference_frames == 8
    assert written.manifest.noise_grey == pytest.approx(np.sqrt(1 + 1 / 12), abs=0.1)
    assert written.pixel_size_mm == (0.2352, 0.2352)
    record = written.metrics["training"]
    assert (record["recipe"], record["width"], record["images"]) == ("fast", 16, 10)
    assert record["losses"][-1] < record["losses"][0]
    assert set(written.presses()) == {"rows", "image", "image_size", "depth_mm"}
    assert [path.name for path in bundle.parent.iterdir()] == [bundle.name]
    assert written.metrics["pixel_ratio"]["ratio"] == pytest.approx(1, abs=0.03)
    assert not any("not square" in line for line in training._fit_lines(written))
    (line,) = training._pixel_warning({"ratio": 1.08, "error": 0.002}, written.image_shape)
    assert "1.080 +- 0.002 times as high as wide" in line
    assert "--size 160x130" in line


@pytest.fixture
def too_large(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pictures of 160 x 120 px are taken for large."""
    monkeypatch.setattr(view, "MOST_PX", 100)


@pytest.mark.usefixtures("too_large")
def test_large_pictures_are_learnt_from_at_half_their_size(pressed: Path) -> None:
    recorded = Recorded(pressed / "presses.csv", str(pressed / "untouched"), 4.0, 0.2352)
    presses, untouched, ball = training.read(recorded)
    as_taken = read_presses(
        pressed / "presses.csv", ball=Ball(radius_mm=4.0, pixel_size_mm=0.2352), image_shape=(120, 160)
    )
    assert untouched.image.shape == (60, 80, 3)
    assert ball.pixel_size_mm == pytest.approx(0.4704)
    for one, taken in zip(presses, as_taken, strict=True):
        assert one.center_x_px == pytest.approx((taken.center_x_px + 0.5) / 2 - 0.5)
        assert one.contact_radius_px == pytest.approx(taken.contact_radius_px / 2)
        means = taken.picture().reshape(60, 2, 80, 2, 3).mean(axis=(1, 3))
        np.testing.assert_allclose(one.picture(), means, atol=0.51)


@pytest.mark.nightly
@pytest.mark.usefixtures("too_large")
def test_a_bundle_of_large_pictures_takes_them_as_they_are(pressed: Path, tmp_path: Path) -> None:
    succeeded(run("fit", *sources(pressed), "--out", tmp_path / "b", "--recipe", "fast", "--width", "16"))
    small = load_bundle(tmp_path / "b")
    assert (small.image_shape, small.pixel_size_mm) == ((60, 80), (0.4704, 0.4704))
    judged = run("evaluate", "--calibration", tmp_path / "b", "--presses", pressed / "others.csv", "--json")
    assert json.loads(judged.stdout)["normal_error_deg"]["mean"] < 4
    with prepared(ImageCamera([pressed / "12.png"]), small) as camera:
        frame = Reconstructor(small).reconstruct(camera.read())
    assert frame.depth_mm.shape == (60, 80)
    assert frame.contact.indentation_mm == pytest.approx(1.5, rel=0.15)


def test_refined_labels_are_in_the_bundle(pressed: Path, tmp_path: Path) -> None:
    quick = ["--largest-normal-error-deg", "90", "--epochs", "1", "--width", "4"]
    succeeded(run("fit", *sources(pressed), "--out", tmp_path / "out", "--refine", *quick))
    refinement = load_bundle(tmp_path / "out").metrics["refinement"]
    # The labels of the simulated presses are exact.
    assert refinement["rms_shift_px"] < 0.7
    assert refinement["kept_images"] == []


@pytest.mark.parametrize(("mean_deg", "verdict"), [(13.9, 0), (14.1, 1), (24.0, 1)])
def test_a_bundle_that_is_no_good_is_told_and_ends_with_1(
    mean_deg: float, verdict: int, bundle: Path, pressed: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = load_bundle(bundle)
    judged = {**made.metrics["held_out"], "normal_error_deg": {"mean": mean_deg, "median": 1.0, "p95": 30.0}}
    made = made.with_files({"metrics.json": json.dumps({**made.metrics, "held_out": judged}).encode()})
    monkeypatch.setattr(training, "fit_judged", lambda *_, **__: made)
    result = run("fit", *sources(pressed), "--out", tmp_path / "out")
    assert result.exit_code == verdict
    assert ("NOT GOOD" in result.stdout) == bool(verdict)


@pytest.mark.parametrize(("keep", "learnt", "word"), [((), 9, "LEFT OUT: 04.png"), (("--keep",), 10, "WRONG LABEL")])
def test_a_label_beside_its_ball_is_told_and_left_out_unless_it_is_kept(
    keep: tuple[str, ...], learnt: int, word: str, pressed: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rows = list(csv.DictReader((pressed / "presses.csv").read_text().splitlines()))
    rows[4]["center_x_px"] = str(float(rows[4]["center_x_px"]) + 0.6 * float(rows[4]["contact_radius_px"]))
    labels = [",".join(rows[0]), *(",".join(row.values()) for row in rows)]
    (pressed / "one_moved.csv").write_text("\n".join(labels))
    given: list[int] = []

    def learning(presses: Sequence[Press], *_: object, extra_metrics: Mapping[str, object], **__: object) -> Bundle:
        given.append(len(presses))
        return Mock(metrics=extra_metrics)

    monkeypatch.setattr(training, "fit_judged", learning)
    monkeypatch.setattr(training, "_pixels", lambda *_: {})
    monkeypatch.setattr(training, "_fit_lines", lambda written: training.contradicted_lines(written.metrics))
    options = ["--presses", pressed / "one_moved.csv", "--reference", pressed / "untouched", *BALL]
    result = succeeded(run("fit", *options, "--out", tmp_path / "out", *keep))
    assert given == [learnt]
    assert word in result.stdout


def test_what_exists_and_what_cannot_be_written_are_refused_before_work(
    bundle: Path, pressed: Path, tmp_path: Path
) -> None:
    before = (bundle / "manifest.toml").read_bytes()
    result = run("fit", *sources(pressed), "--out", bundle)
    assert "--overwrite" in refused(result)
    assert (bundle / "manifest.toml").read_bytes() == before
    (tmp_path / "file").write_text("no folder")
    result = run("fit", *sources(pressed), "--out", tmp_path / "file/sensor")
    assert "file/sensor cannot be written (Not a directory)" in refused(result)
    assert "training" not in result.stderr


def test_one_press_is_enough_to_feel_and_not_to_know_how_well(pressed: Path, tmp_path: Path) -> None:
    lines = (pressed / "presses.csv").read_text().splitlines()[:2]
    (pressed / "one.csv").write_text("\n".join(lines))
    given = ["--presses", pressed / "one.csv", "--reference", pressed / "untouched", *BALL]
    result = succeeded(run("fit", *given, "--out", tmp_path / "out", "--width", "4", "--epochs", "1"))
    assert "one press is all learnt from: how large the errors are, nobody knows" in result.output
    assert "held_out" not in load_bundle(tmp_path / "out").metrics


def test_one_press_begins_with_those_of_a_like_unit(bundle: Path, pressed: Path, tmp_path: Path) -> None:
    lines = (pressed / "presses.csv").read_text().splitlines()[:2]
    (pressed / "first.csv").write_text("\n".join(lines))
    given = ["--presses", pressed / "first.csv", "--reference", pressed / "untouched", *BALL, "--width", "16"]
    errors = []
    for more in ([], ["--like", bundle]):
        result = succeeded(run("fit", *given, *more, "--out", tmp_path / f"{len(more)}", "--recipe", "fast"))
        judged = run(
            "evaluate", "--presses", pressed / "others.csv", "--calibration", tmp_path / f"{len(more)}", "--json"
        )
        errors.append(json.loads(judged.stdout)["normal_error_deg"]["mean"])
    assert errors[1] < 0.7 * errors[0]
    assert re.search(r"begun with the presses of S1, which alone are off by \d\d?% of the slopes", result.output)
    assert load_bundle(tmp_path / "2").metrics["like"] == "S1"


@pytest.mark.parametrize(
    ("script", "message"),
    [
        ("import sys; sys.exit('gelnet.train: no rows')", "training failed with status 1: gelnet.train: no rows"),
        ("import os; os.kill(os.getpid(), 9)", f"ended by signal {int(signal.SIGKILL)}"),
        ("import nowhere_to_be_found", "cannot start .*nowhere_to_be_found.*: reinstall gellight"),
    ],
)
def test_a_child_that_fails_says_why(script: str, message: str) -> None:
    with pytest.raises(TrainingError, match=message):
        child._run_child([sys.executable, "-c", script], child.silent)


def test_what_a_library_prints_beside_the_progress_of_a_child_ends_nothing() -> None:
    told: list[tuple[int, int, float]] = []
    said = ["MKL WARNING: old processor", "7", '{"epoch": 1}', '{"epoch": 1, "epochs": 2, "loss": 0.5}']
    child._run_child([sys.executable, "-c", f"print({chr(10).join(said)!r})"], lambda *step: told.append(step))
    assert told == [(1, 2, 0.5)]


def test_the_angle_of_nearly_equal_normals_keeps_its_digits() -> None:
    a = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
    b = np.array([[1e-7, 0.0, 1.0], [0.0, 1.0, 0.0]])
    np.testing.assert_allclose(angle_deg(a, b), [np.degrees(1e-7), 90.0], rtol=1e-6)
