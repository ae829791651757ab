"""`gellight calibrate fit --lights`: the light of the depth is taken off, by the lights of an earlier bundle."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gellight.base.errors import BundleError
from gellight.bundle.bundle import Bundle, load_bundle, save_bundle
from gellight.cli.calibrate.training import depth_line
from gellight.frame_path.pipeline import Reconstructor
from gellight.frames.frames import CameraFrame
from gellight.lab.simulator.scene import Press, Scene
from gellight.photometric.lights_file import read_lights
from gellight.reconstruction.errors import surface_errors
from sim_reference.camera import CameraResponse, digitise
from tests.helpers.pressed_pictures import GEOMETRY, run, sources
from tests.helpers.small_bundles import ordinary, with_files


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
