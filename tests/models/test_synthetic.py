"""The network of the simulated sensor: labels that are true, a recipe that can be run again, a bundle that fits."""

import json
from dataclasses import replace
from itertools import combinations
from pathlib import Path

import numpy as np
import onnxruntime
import pytest

from gellight.bundle.bundle import load_bundle
from gellight.lab.simulator import scene as gellight_scene
from gellight.lab.simulator.scene import Scene
from gelnet import synthetic
from gelnet.recipes import RECIPES
from gelnet.synthetic import Options, geometry_hash, main, simulated_sensor, table_of_presses
from sim_reference import gel
from sim_reference.camera import CameraResponse
from sim_reference.deformation import Deformation
from sim_reference.geometry import AS_BUILT, SensorGeometry
from tests.helpers.simulated_bundle import evaluate_simulated
from tests.helpers.trainers import TRAINERS

SMALL = SensorGeometry(image_width_px=160, image_height_px=120, pixel_size_mm=0.2352)
FEW = Options(presses=6, rows_per_press=300, epochs=2)


@pytest.fixture(scope="module")
def sensor() -> synthetic.Sensor:
    return simulated_sensor(SMALL, seed=0)


def test_it_learns_from_the_sensor_that_the_host_simulates(sensor: synthetic.Sensor) -> None:
    scene = Scene(SMALL, CameraResponse())
    assert synthetic.BRIGHTEST_GREY == gellight_scene.BRIGHTEST_GREY
    assert sensor.response.exposure == pytest.approx(scene.response.exposure, rel=1e-5)
    assert geometry_hash(SMALL, sensor.response) == geometry_hash(SMALL, scene.response)
    for other in ({"gel_thickness_mm": 4}, {"window": True}, {"perspective": True}):
        assert geometry_hash(SMALL, sensor.response) != geometry_hash(replace(SMALL, **other), sensor.response)
    np.testing.assert_array_equal(sensor.light, scene.light)
    untouched, _ = scene.show(None)
    # The mean of 100 frames of noise 1: a standard error of 0.1 grey levels.
    assert np.abs(sensor.reference - untouched).max() < 0.6
    assert np.abs(sensor.reference - untouched).mean() == pytest.approx(0.1 * np.sqrt(2 / np.pi), rel=0.1)


def test_the_rows_are_the_truth_of_the_pixels_they_name(sensor: synthetic.Sensor) -> None:
    options = replace(FEW, other_share=0.0, deepest_mm=2.0)
    table = table_of_presses(sensor, options, count=4, noise_grey=0.3, seed=9)
    assert table.image_size == (160, 120)
    assert set(table.image) == {0, 1, 2, 3}
    slope = np.abs(table.rows[:, 5:]).max(axis=1)
    # A share in contact, the rest on the skirt and on flat gel; no ball of 4 mm at 2 mm is steeper than 50 degrees.
    assert 0.2 < (slope > 0.1).mean() < 0.9
    assert (slope < 2e-3).any()
    assert slope.max() < 1.2
    # Gel that faces left, away from the right, is brighter where the light comes from: colours follow the slopes.
    steep = slope > 0.1
    assert np.abs(table.rows[steep, :3]).max(axis=1).mean() > 10 * np.abs(table.rows[~steep, :3]).mean()


def test_each_ball_is_pressed_once_into_the_gel_that_is_given_and_photographed_at_several_places(
    sensor: synthetic.Sensor,
) -> None:
    depths = []

    def pressed(height: np.ndarray, spacing_mm: float, depth_mm: float, geometry: SensorGeometry) -> Deformation:
        depths.append(depth_mm)
        return gel.press(height, spacing_mm, depth_mm, geometry)

    options = replace(FEW, places=3)
    table = table_of_presses(sensor, options, count=2, noise_grey=0.3, seed=9, model=pressed)
    assert len(set(depths)) == len(depths) == 2
    assert set(table.image) == set(range(6))
    middles = [np.median(table.rows[table.image == image, 3:5], axis=0) for image in range(3)]
    assert all(np.hypot(*(a - b)) > 3 for a, b in combinations(middles, 2))
    ends = [np.abs(table.rows[table.image == image, 5:]).max() for image in range(6)]
    assert np.ptp(ends[:3]) < 0.1 * np.mean(ends[:3])


def test_a_seed_repeats_its_presses_and_validation_presses_are_no_training_presses(sensor: synthetic.Sensor) -> None:
    def presses(seed: int) -> set[bytes]:
        rows = table_of_presses(sensor, FEW, count=2, noise_grey=0.3, seed=seed).rows
        return {row.tobytes() for row in rows}

    training, validation = (presses(synthetic.SEEDS[name]) for name in ("training", "validation"))
    assert presses(synthetic.SEEDS["training"]) == training
    assert not training & validation


@pytest.mark.parametrize("trainer", TRAINERS)
def test_the_command_writes_everything_the_bundle_needs(
    trainer: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(synthetic, "REFERENCE_FRAMES", 2)
    out = tmp_path / "made"
    arguments = ["--trainer", trainer, "--presses", "4", "--rows-per-press", "200", "--epochs", "2", "--width", "8"]
    assert main(["--out", str(out), *arguments]) == 0
    assert sorted(path.name for path in out.iterdir()) == [
        "network.onnx",
        "provenance.json",
        "reference.npy",
        "training.json",
    ]
    assert [json.loads(line)["epoch"] for line in capsys.readouterr().out.splitlines()] == [1, 2]
    provenance = json.loads((out / "provenance.json").read_text())
    assert provenance["options"]["presses"] == 4
    assert provenance["trainer"].split()[0] == trainer
    assert provenance["validation_normal_error_deg"]["mean"] > 0
    assert len(provenance["light"]) == 12
    assert np.load(out / "reference.npy").shape == (480, 640, 3)


def test_the_recipe_of_the_paper_is_trained_as_the_paper_says() -> None:
    assert Options(recipe="paper").how() == RECIPES["paper"]


def test_the_shipped_network_learns_every_row_of_quiet_pictures(sensor: synthetic.Sensor) -> None:
    recipe = Options().how()
    assert recipe == RECIPES["fine"]
    assert recipe.place_jitter == recipe.dropout == recipe.least_visits == 0
    assert recipe.largest_table >= Options.presses * Options.rows_per_press
    assert FEW.how() == replace(RECIPES["fine"], epochs=2)
    quiet, noisy = (table_of_presses(sensor, FEW, count=1, noise_grey=noise, seed=9).rows for noise in (None, 0.0))
    # Neither noise nor rounding: what rounding alone adds is uniform within half a grey level.
    rounded = noisy[:, :3] - quiet[:, :3]
    np.testing.assert_array_equal(quiet[:, 3:], noisy[:, 3:])
    assert 0.45 < np.abs(rounded).max() <= 0.5001
    assert rounded.std() == pytest.approx(12**-0.5, rel=0.1)


def test_a_wrong_option_is_refused_and_nothing_is_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(synthetic, "REFERENCE_FRAMES", 2)
    few = ["--presses", "0", "--rows-per-press", "50", "--epochs", "1"]
    assert main(["--trainer", "numpy", "--out", str(tmp_path / "made"), *few]) == 2
    assert not (tmp_path / "made").exists()


def test_the_shipped_bundle_was_made_for_this_simulator() -> None:
    bundle = load_bundle("synthetic")
    provenance = json.loads(bundle.files["provenance.json"])
    now = Scene(AS_BUILT, CameraResponse())
    remedy = "the simulated sensor has changed: python -m tests.helpers.simulated_bundle --overwrite --out ..."
    assert provenance["sensor_sha256"] == geometry_hash(now.geometry, now.response), remedy
    assert np.abs(bundle.reference - now.show(None)[0]).mean() < 0.1, remedy
    assert bundle.pixel_size_mm == (0.0588, 0.0588)
    assert "".join(led.colour for led in bundle.manifest.led) == "RRRRGGGGBBBB"
    session = onnxruntime.InferenceSession(bundle.network, providers=["CPUExecutionProvider"])
    assert int(session.get_modelmeta().custom_metadata_map["width"]) == bundle.metrics["training"]["width"]


def test_the_shipped_network_keeps_what_the_model_card_promises() -> None:
    error = evaluate_simulated(load_bundle("synthetic"), presses=3)
    assert error.whole_map_normal_mae_deg <= 0.28
    assert error.contact_depth_mae_mm <= 0.010
    assert error.contact_normal_mae_deg <= 0.5
