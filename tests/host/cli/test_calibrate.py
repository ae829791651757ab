"""`gellight calibrate`: from labelled presses to a bundle, and what it is worth."""

import json
import re
import signal
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gellight.base.errors import BundleError, InputError, TrainingError
from gellight.bundle.bundle import Bundle, load_bundle, save_bundle
from gellight.cli.calibrate import training
from gellight.cli.calibrate.detect import Pressed
from gellight.cli.calibrate.told_ball import told_ball
from gellight.cli.calibrate.training import Recorded, ball_warning, depth_line, which_ball
from gellight.frame_path.pipeline import Reconstructor
from gellight.frames import view
from gellight.frames.frames import CameraFrame
from gellight.frames.image_files import ImageCamera
from gellight.frames.picture import prepared
from gellight.lab.simulator.scene import Press, Scene
from gellight.lab.training import child, cross_validation, folds
from gellight.lab.training.cross_validation import cross_validate
from gellight.lab.training.label_file import read_presses
from gellight.lab.training.presses import Ball
from gellight.lab.training.training import Learning, TrainingOptions, read_reference
from gellight.photometric.lights_file import read_lights
from gellight.reconstruction.errors import surface_errors
from gellight.reconstruction.integration import angle_deg
from sim_reference.camera import CameraResponse, digitise
from tests.helpers.command_line import refused
from tests.helpers.places import real
from tests.helpers.pressed_pictures import BALL, GEOMETRY, photograph, press_into, run, sources
from tests.helpers.pressed_unit import pressed_unit
from tests.helpers.small_bundles import ordinary

REAL = real("gelsight_mini_ball")


@pytest.fixture(scope="module")
def pressed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return press_into(tmp_path_factory.mktemp("pressed"))


@pytest.fixture(scope="module")
def bundle(pressed: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("bundles") / "sensor"
    options = ["--recipe", "fast", "--width", "16", "--sensor", "S1"]
    result = run("fit", *sources(pressed), "--out", out, *options)
    assert result.exit_code == 0, result.output
    return out


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
    balls = Pressed(ball_radius_mm=4.0, pixel_size_mm=0.1).ball, told_ball(4.0, 0.1)
    assert [ball.camera_height_mm for ball in balls] == [45.0, 45.0]
    monkeypatch.setenv("GELLIGHT_GEOMETRY_WINDOW", "true")
    assert told_ball(4.0, 0.1).camera_height_mm == pytest.approx(1.41 * (45 - 8) + 8)
    monkeypatch.setenv("GELLIGHT_GEOMETRY_PERSPECTIVE", "false")
    assert told_ball(4.0, 0.1).camera_height_mm == np.inf


def test_fit_writes_a_bundle_that_says_how_it_came_about(bundle: Path, pressed: Path) -> None:
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


@pytest.mark.parametrize(("named", "warned"), [(3.0, True), (4.0, False), (5.0, True)])
def test_a_ball_that_the_light_contradicts_is_warned_of(pressed: Path, named: float, warned: bool) -> None:
    recorded = Recorded(pressed / "presses.csv", str(pressed / "untouched"), named, 0.2352)
    warning = "".join(ball_warning(which_ball(*recorded.read(), None)["likely_ball_radius_mm"], named))
    assert bool(warning) is warned
    assert not warned or float(warning.split("about ")[1].split(" mm")[0]) == pytest.approx(4.0, rel=0.1)


def test_fit_tells_that_pixels_are_not_square(bundle: Path) -> None:
    written = load_bundle(bundle)
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
    presses, untouched, ball = recorded.read()
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
    done = run("fit", *sources(pressed), "--out", tmp_path / "b", "--recipe", "fast", "--width", "16")
    assert done.exit_code == 0, done.output
    small = load_bundle(tmp_path / "b")
    assert (small.image_shape, small.pixel_size_mm) == ((60, 80), (0.4704, 0.4704))
    judged = run("evaluate", "--calibration", tmp_path / "b", "--presses", pressed / "others.csv", "--json")
    assert json.loads(judged.stdout)["normal_error_deg"]["mean"] < 4
    with prepared(ImageCamera([pressed / "12.png"]), small) as camera:
        frame = Reconstructor(small).reconstruct(camera.read())
    assert frame.depth_mm.shape == (60, 80)
    assert frame.contact.indentation_mm == pytest.approx(1.5, rel=0.15)


def test_the_warning_names_a_small_ball_by_its_size() -> None:
    (warning,) = ball_warning(0.2954, 0.2465)
    assert "named as 0.2465 mm" in warning
    assert "about 0.295 mm" in warning


def test_the_bundle_feels_balls_it_was_not_trained_on(bundle: Path, pressed: Path) -> None:
    result = run("evaluate", "--calibration", bundle, "--presses", pressed / "others.csv", "--json")
    assert result.exit_code == 0, result.output
    figures = json.loads(result.stdout)
    assert [image["image"] for image in figures["images"]] == ["10.png", "11.png", "12.png", "13.png"]
    # Under a flat answer it would be 22 degrees; what is left is noise and the gel that leaves the ball at the rim.
    assert 0 < figures["normal_error_deg"]["median"] <= figures["normal_error_deg"]["mean"] < 3.5
    assert figures["normal_error_deg"]["p95"] < 9
    assert 0 < figures["depth_mae_mm"] < 0.05
    assert 0.5 < figures["contact_iou"] <= 1
    assert figures["felt_ball_radius_mm"] == pytest.approx(4.0, rel=0.1)


def test_evaluate_prints_a_line_an_image(bundle: Path, pressed: Path) -> None:
    result = run("evaluate", "--calibration", bundle, "--presses", pressed / "others.csv")
    assert result.exit_code == 0
    assert len([line for line in result.stdout.splitlines() if ".png" in line]) == 4
    assert "depth error in contact" in result.stdout
    known, kept = map(int, re.search(r"tell of (\d+)% .* at most; (\d+)% of those", result.stdout).groups())
    assert known > 60
    assert kept > 60


def test_evaluate_says_where_nothing_was_pressed(bundle: Path, pressed: Path, tmp_path: Path) -> None:
    x, y = 15.0, 11.0
    contact = photograph(Scene(GEOMETRY, CameraResponse()), Press("BALL", 1.0, x, y), 50, tmp_path / "corner.png")
    circle = f"corner.png,{x / 0.2352 + 79.5},{y / 0.2352 + 59.5},{np.sqrt(contact.sum() / np.pi):.2f}"
    (tmp_path / "corner.csv").write_text(f"image,center_x_px,center_y_px,contact_radius_px\n{circle}\n")
    given = ("evaluate", "--calibration", bundle, "--presses", tmp_path / "corner.csv")
    figures = json.loads(run(*given, "--json").stdout)
    assert figures["not_learnt"] > 0.5
    assert f"the calibration never saw the place or colour of {figures['not_learnt']:.1%}" in run(*given).stdout


def test_wrong_circles_make_a_larger_error(bundle: Path, pressed: Path, tmp_path: Path) -> None:
    lines = (pressed / "others.csv").read_text().splitlines()
    name, x, *rest = lines[1].split(",")
    (pressed / "shifted.csv").write_text("\n".join([lines[0], ",".join([name, str(float(x) + 4), *rest])]))
    errors = []
    for csv in ("shifted.csv", "others.csv"):
        result = run("evaluate", "--calibration", bundle, "--presses", pressed / csv, "--json")
        errors.append(json.loads(result.stdout)["images"][0]["normal_error_deg"]["mean"])
    assert errors[0] > errors[1] + 5


def test_folds_measure_every_press_once(pressed: Path, tmp_path: Path) -> None:
    how = ["--folds", "2", "--epochs", "100", "--width", "8", "--refine", "--out", tmp_path / "out", "--json"]
    result = run("fit", *sources(pressed), *how)
    assert result.exit_code == 0, result.output
    figures = json.loads(result.stdout)["metrics"]["cross_validation"]
    assert len(figures["refined"]["images"]) == 10
    assert [image["image"] for image in figures["images"]] == [f"{number:02}.png" for number in range(10)]
    assert len(figures["training_cpu_seconds"]) == figures["folds"] == 2
    assert 0 < figures["normal_error_deg"]["mean"] < 14  # answering "flat" gives 25


def test_a_ball_of_another_size_is_noticed_by_the_earlier_bundle(bundle: Path, pressed: Path, tmp_path: Path) -> None:
    wrong = ["--ball-radius-mm", "5", "--pixel-size-mm", "0.2352", "--previous", bundle]
    given = ["--presses", pressed / "others.csv", "--reference", pressed / "untouched"]
    result = run("fit", *given, *wrong, "--out", tmp_path / "out")
    assert isinstance(result.exception, InputError)
    assert "said to have a radius of 5 mm" in str(result.exception)
    assert float(str(result.exception).split("a ball of ")[1].split()[0]) == pytest.approx(4.0, rel=0.1)
    assert list(tmp_path.iterdir()) == []


def test_refined_labels_are_in_the_bundle(pressed: Path, tmp_path: Path) -> None:
    result = run(
        "fit",
        *sources(pressed),
        "--out",
        tmp_path / "out",
        "--refine",
        "--largest-normal-error-deg",
        "90",
        "--epochs",
        "1",
        "--width",
        "4",
    )
    assert result.exit_code == 0, result.output
    refinement = load_bundle(tmp_path / "out").metrics["refinement"]
    # The labels of the simulated presses are exact.
    assert refinement["rms_shift_px"] < 0.7
    assert refinement["kept_images"] == []


def test_each_fold_is_measured_by_a_network_that_never_saw_it(pressed: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    seen: list[tuple[set[str], set[str]]] = []
    fit, errors_of = folds.fit, cross_validation.press_errors

    def spying_fit(presses, *rest, **options):  # type: ignore[no-untyped-def]
        seen.append(({press.image.name for press in presses}, set()))
        return fit(presses, *rest, **options)

    def spying_errors(bundle, presses, ball):  # type: ignore[no-untyped-def]
        seen[-1][1].update(press.image.name for press in presses)
        return errors_of(bundle, presses, ball)

    monkeypatch.setattr(folds, "fit", spying_fit)
    monkeypatch.setattr(cross_validation, "press_errors", spying_errors)
    ball, reference = Ball(radius_mm=4, pixel_size_mm=0.2352), read_reference(pressed / "untouched")
    presses = read_presses(pressed / "presses.csv", ball=ball, image_shape=reference.image_shape)
    short = Learning(options=TrainingOptions(epochs=1, width=4))
    cross_validate(presses, reference, ball, folds=2, how=short)
    assert len(seen) == 2
    for trained, measured in seen:
        assert measured
        assert not trained & measured
        assert len(trained | measured) == 10
    with pytest.raises(InputError, match="6 folds of 10 presses: give between 2 and 5"):
        cross_validate(presses, reference, ball, folds=6)


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


def test_an_existing_bundle_is_kept_unless_told_otherwise(bundle: Path, pressed: Path) -> None:
    before = (bundle / "manifest.toml").read_bytes()
    result = run("fit", *sources(pressed), "--out", bundle)
    assert "--overwrite" in refused(result)
    assert (bundle / "manifest.toml").read_bytes() == before


def test_a_place_that_cannot_be_written_is_refused_before_anything_is_learnt(pressed: Path, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("no folder")
    result = run("fit", *sources(pressed), "--out", tmp_path / "file/sensor")
    assert "file/sensor cannot be written (Not a directory)" in refused(result)
    assert "training" not in result.stderr


def test_a_press_file_with_a_fault_leaves_no_bundle(pressed: Path, tmp_path: Path) -> None:
    (pressed / "wrong.csv").write_text("image,center_x_px,center_y_px,contact_radius_px\n00.png,1,1,999\n")
    given = ["--presses", pressed / "wrong.csv", "--reference", pressed / "untouched", *BALL]
    result = run("fit", *given, "--out", tmp_path / "out")
    assert isinstance(result.exception, InputError)
    assert "line 2: contact_radius_px is 999" in str(result.exception)
    assert list(tmp_path.iterdir()) == []


def test_one_press_is_enough_to_feel_and_not_to_know_how_well(pressed: Path, tmp_path: Path) -> None:
    lines = (pressed / "presses.csv").read_text().splitlines()[:2]
    (pressed / "one.csv").write_text("\n".join(lines))
    given = ["--presses", pressed / "one.csv", "--reference", pressed / "untouched", *BALL]
    result = run("fit", *given, "--out", tmp_path / "out", "--width", "4", "--epochs", "1")
    assert result.exit_code == 0, result.output
    assert "one press is all learnt from: how large the errors are, nobody knows" in result.output
    assert "held_out" not in load_bundle(tmp_path / "out").metrics


def test_one_press_begins_with_those_of_a_like_unit(bundle: Path, pressed: Path, tmp_path: Path) -> None:
    lines = (pressed / "presses.csv").read_text().splitlines()[:2]
    (pressed / "first.csv").write_text("\n".join(lines))
    given = ["--presses", pressed / "first.csv", "--reference", pressed / "untouched", *BALL, "--width", "16"]
    errors = []
    for more in ([], ["--like", bundle]):
        result = run("fit", *given, *more, "--out", tmp_path / f"{len(more)}", "--recipe", "fast")
        assert result.exit_code == 0, result.output
        judged = run(
            "evaluate", "--presses", pressed / "others.csv", "--calibration", tmp_path / f"{len(more)}", "--json"
        )
        errors.append(json.loads(judged.stdout)["normal_error_deg"]["mean"])
    assert errors[1] < 0.7 * errors[0]
    assert re.search(r"begun with the presses of S1, which alone are off by \d\d?% of the slopes", result.output)
    assert load_bundle(tmp_path / "2").metrics["like"] == "S1"


def test_a_unit_of_another_kind_is_refused(pressed: Path, tmp_path: Path) -> None:
    pressed_unit(tmp_path / "other")
    result = run("fit", *sources(pressed), "--like", tmp_path / "other", "--out", tmp_path / "out")
    assert isinstance(result.exception, InputError)
    assert "learnt from 3 channels of 80 x 60 px, this unit has 3 of 160 x 120 px: it is no like unit" in str(
        result.exception
    )
    assert not (tmp_path / "out").exists()


def test_an_unknown_recipe_is_refused(pressed: Path, tmp_path: Path) -> None:
    result = run("fit", *sources(pressed), "--out", tmp_path / "out", "--recipe", "slow")
    for found in (result, run("synthetic", "--out", tmp_path / "out", "--recipe", "slow")):
        assert isinstance(found.exception, InputError)
        assert "recipe 'slow': give one of fast, thorough, fine, paper" in str(found.exception)


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


def test_noise_of_one_image_is_the_noise_of_many(pressed: Path) -> None:
    many, one = read_reference(pressed / "untouched"), read_reference(pressed / "untouched/0.png")
    assert (many.frames, one.frames) == (8, 1)
    assert one.noise_grey == pytest.approx(many.noise_grey, rel=0.25)


def test_the_angle_of_nearly_equal_normals_keeps_its_digits() -> None:
    a = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
    b = np.array([[1e-7, 0.0, 1.0], [0.0, 1.0, 0.0]])
    np.testing.assert_allclose(angle_deg(a, b), [np.degrees(1e-7), 90.0], rtol=1e-6)


# ---- fit --lights ----


@pytest.fixture(scope="module")
def earlier(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A bundle of the same unit that knows the light of its LEDs."""
    return Path(save_bundle(ordinary(), tmp_path_factory.mktemp("earlier") / "earlier").source)


def test_the_lights_of_an_earlier_bundle_take_the_light_of_depth_off(
    bundle: Path, earlier: Path, pressed: Path, tmp_path: Path
) -> None:
    how = ["--recipe", "fast", "--width", "16"]
    result = run("fit", *sources(pressed), "--lights", earlier, "--out", tmp_path / "out", *how)
    assert result.exit_code == 0, result.output
    assert "learnt in the light that the gel has at rest" in result.output
    assert "learnt in the light" not in run("fit", *sources(pressed), "--out", tmp_path / "b", "--epochs", "1").output
    made = load_bundle(tmp_path / "out")
    assert made.manifest.light_by_depth
    assert read_lights(made).pattern_residual == read_lights(load_bundle(earlier)).pattern_residual
    # The balls to learn from lay 1.5 mm deep: gentle slopes there are nearer to the LEDs than those of a light touch.
    with_lights, without = (light_touch_deg(one) for one in (made, load_bundle(bundle)))
    assert with_lights < 0.85 * without


def test_the_user_is_told_whether_the_light_of_depth_was_taken_off() -> None:
    known = ordinary()
    without = replace(known, manifest=known.manifest.model_copy(update={"light_by_depth": False}))
    assert "at rest" in depth_line(known)[0]
    assert "in the light of their depth" in depth_line(without)[0]
    unlit = {name: content for name, content in without.files.items() if name != "lights.json"}
    assert depth_line(replace(without, files=unlit)) == []


def light_touch_deg(bundle: Bundle) -> float:
    """Return the error on balls 0.4 mm deep, degrees in contact."""
    scene, reconstructor = Scene(GEOMETRY, CameraResponse()), Reconstructor(bundle)
    errors = []
    for number, (x, y) in enumerate([(0, 0), (-6, 5), (7, -4), (3, 6)]):
        grey, surface = scene.show(Press("BALL", 0.4, x, y))
        image = digitise(grey, 1.0, np.random.default_rng(number))
        depth = reconstructor.reconstruct(CameraFrame(image=image, time_s=0.0, sequence=0, source="balls"))
        errors.append(surface_errors(depth, surface).contact_normal_deg)
    return float(np.mean(errors))


def test_lights_of_another_unit_are_refused(bundle: Path, earlier: Path, pressed: Path, tmp_path: Path) -> None:
    other = load_bundle(earlier)
    save_bundle(other.with_reference(np.ascontiguousarray(other.reference[..., ::-1]), frames=30), tmp_path / "other")
    for given, said in ((bundle, "has no lights.json"), (tmp_path / "other", "was made with another unit"),
                        ("synthetic", "the untouched gel delivers 160x120 pixels")):  # fmt: skip
        result = run("fit", *sources(pressed), "--lights", given, "--out", tmp_path / "out")
        assert isinstance(result.exception, BundleError)
        assert said in str(result.exception)
    assert not (tmp_path / "out").exists()


@pytest.mark.nightly
@pytest.mark.timeout(900)
@pytest.mark.real_images("gelsight_mini_ball")
def test_on_real_presses_the_error_is_what_it_is_worth(tmp_path: Path) -> None:
    """33 hand-labelled presses of a GelSight Mini, whose light drifts by tens of grey levels between frames."""
    given = ["--presses", REAL / "presses.csv", "--reference", REAL / "background.png", "--refine", "--folds", "3"]
    size = ["--ball-radius-mm", "2.35", "--pixel-size-mm", "0.05107"]
    result = run("fit", *given, *size, "--out", tmp_path / "out", "--json")
    assert result.exit_code == 0, result.output
    figures = json.loads(result.stdout)["metrics"]["cross_validation"]
    assert len(figures["images"]) == 33
    assert max(figures["training_cpu_seconds"]) < 60
    assert figures["normal_error_deg"]["mean"] < 6.8
    assert figures["refined"]["normal_error_deg"]["mean"] < 5.4
    assert figures["contact_iou"] > 0.75
