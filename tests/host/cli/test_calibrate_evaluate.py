"""What a bundle is worth: `gellight calibrate evaluate`, and networks that did not see what judges them."""

import json
import re
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gellight.bundle.bundle import Bundle, load_bundle, save_bundle
from gellight.cli.running.training import depth_line
from gellight.frame_path.pipeline import Reconstructor
from gellight.frames.frames import CameraFrame
from gellight.frames.image_files import read_image
from gellight.lab.report.pictures import write_png
from gellight.lab.simulator.scene import Press, Scene
from gellight.lab.training import folds
from gellight.lab.training.label_file import read_presses
from gellight.lab.training.labelling.refinement import refine
from gellight.lab.training.presses import Ball
from gellight.lab.training.training import Learning, TrainingOptions, read_reference
from gellight.lab.training.validation import PressError, press_errors, summarised
from gellight.photometric.lights_file import read_lights
from gellight.reconstruction.errors import surface_errors
from sim_reference.camera import CameraResponse, digitise
from tests.helpers.command_line import refused, succeeded
from tests.helpers.places import real
from tests.helpers.pressed_pictures import GEOMETRY, photograph, run, sources
from tests.helpers.small_bundles import ordinary, with_files


def test_the_bundle_feels_balls_it_was_not_trained_on(bundle: Path, pressed: Path) -> None:
    result = succeeded(run("evaluate", "--calibration", bundle, "--presses", pressed / "others.csv", "--json"))
    figures = json.loads(result.stdout)
    assert [image["image"] for image in figures["images"]] == ["10.png", "11.png", "12.png", "13.png"]
    # Under a flat answer it would be 22 degrees; what is left is noise and the gel that leaves the ball at the rim.
    assert 0 < figures["normal_error_deg"]["median"] <= figures["normal_error_deg"]["mean"] < 3.5
    assert figures["normal_error_deg"]["p95"] < 9
    assert 0 < figures["depth_mae_mm"] < 0.05
    assert 0.5 < figures["contact_iou"] <= 1
    assert figures["felt_ball_radius_mm"] == pytest.approx(4.0, rel=0.1)


def test_evaluate_prints_a_line_an_image(bundle: Path, pressed: Path) -> None:
    result = succeeded(run("evaluate", "--calibration", bundle, "--presses", pressed / "others.csv"))
    assert len([line for line in result.stdout.splitlines() if ".png" in line]) == 4
    assert "depth error in contact" in result.stdout
    known, kept = map(int, re.search(r"tell of (\d+)% .* at most; (\d+)% of those", result.stdout).groups())
    assert known > 60
    assert kept > 60


def test_a_circle_without_a_ball_is_named_beside_the_others(bundle: Path, pressed: Path, tmp_path: Path) -> None:
    """In one picture the light changed the other way, as in a dent."""
    shutil.copytree(pressed, tmp_path / "pressed")
    labels, image = tmp_path / "pressed/others.csv", tmp_path / "pressed/12.png"
    untouched = read_image(tmp_path / "pressed/untouched/0.png").astype(float)
    write_png(image, np.clip(2 * untouched - read_image(image), 0, 255).astype(np.uint8))
    given = ("evaluate", "--calibration", bundle, "--presses", labels)
    figures = json.loads(run(*given, "--json").stdout)
    assert figures["no_ball_felt"] == ["12.png"]
    assert figures["felt_ball_radius_mm"] == pytest.approx(4.0, rel=0.1)
    assert "WRONG LABEL: 12.png: no ball is felt in its circle" in run(*given).stdout


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


def test_no_fold_is_judged_by_what_its_network_saw(pressed: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    seen: list[set[str]] = []
    fit = folds.fit

    def spying_fit(presses, *rest, **options):  # type: ignore[no-untyped-def]
        seen.append({press.image.name for press in presses})
        return fit(presses, *rest, **options)

    monkeypatch.setattr(folds, "fit", spying_fit)
    ball, reference = Ball(radius_mm=4, pixel_size_mm=0.2352), read_reference(pressed / "untouched")
    presses = read_presses(pressed / "presses.csv", ball=ball, image_shape=reference.image_shape)
    short = Learning(options=TrainingOptions(epochs=1, width=4))
    for number, fold in enumerate(folds.trained_folds(presses, reference, ball, 2, short)):
        judged = {press.image.name for press in fold.held_out}
        assert judged
        assert not seen[number] & judged
        assert len(seen[number] | judged) == 10
    assert len(seen) == 2


REAL = real("gelsight_mini_ball")


@pytest.mark.nightly
@pytest.mark.timeout(900)
@pytest.mark.real_images("gelsight_mini_ball")
def test_on_real_presses_the_error_is_what_it_is_worth() -> None:
    """33 hand-labelled presses of a GelSight Mini, whose light drifts by tens of grey levels between frames."""
    ball, reference = Ball(radius_mm=2.35, pixel_size_mm=0.05107), read_reference(str(REAL / "background.png"))
    presses = read_presses(REAL / "presses.csv", ball=ball, image_shape=reference.image_shape)
    refined = refine(presses, reference.image, ball).presses
    how, errors = Learning(options=TrainingOptions(recipe="thorough")), list[PressError]()
    for fold in folds.trained_folds(refined, reference, ball, 3, how):
        errors += press_errors(fold.bundle, fold.held_out, ball)
    figures = summarised(errors)
    assert len(figures.images) == 33
    assert figures.normal_error_deg.mean < 5
    assert figures.depth_mae_mm < 0.06
    assert figures.contact_iou > 0.75


# ---- fit --lights: the light of the depth is taken off, by the lights of an earlier bundle ----


@pytest.fixture(scope="module")
def earlier(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A bundle of the same unit, without a window, that knows the light of its LEDs."""
    lights = json.loads(ordinary().files["lights.json"])
    lights["ring"]["window_mm"] = 0.0
    straight = with_files(ordinary(), "ordinary", lights__json=json.dumps(lights).encode())
    return Path(save_bundle(straight, tmp_path_factory.mktemp("earlier") / "earlier").source)


def test_the_lights_of_an_earlier_bundle_take_the_light_of_depth_off(
    bundle: Path, earlier: Path, pressed: Path, tmp_path: Path
) -> None:
    how = ["--recipe", "fast", "--width", "16", "--epochs", "4"]  # of the 300,000 rows that lights show
    result = succeeded(run("fit", *sources(pressed), "--lights", earlier, "--out", tmp_path / "out", *how))
    assert "learnt in the light that the gel has at rest" in result.output
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
        assert said in refused(result)
    assert not (tmp_path / "out").exists()
