"""`gellight calibrate list`, `install`, `restore` from the outside."""

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import Result

from gellight.base.errors import BundleError, CameraError
from gellight.bundle.bundle import load_bundle, write_bundle
from gellight.photometric.lights_file import read_lights
from gellight.sensor.discovery import discover
from tests.helpers import simulated_bundle
from tests.helpers.command_line import invoke, succeeded


def gellight(*arguments: str) -> Result:
    return invoke("calibrate", *arguments)


def made(folder: Path, sensor: str, mark: str, name: str = "") -> Path:
    synthetic = load_bundle("synthetic")
    write_bundle(
        folder,
        sensor=sensor,
        name=name,
        reference=synthetic.reference,
        reference_frames=10,
        noise_grey=1.0,
        pixel_size_mm=(0.0588, 0.0588),
        network=synthetic.network,
        metrics={"verification": {"depth_mm": 0.01, "normal_deg": 1.0}, "test": {"depth_mm": 0.01}},
        extra_files={"mark": mark.encode()},
    )
    return folder


def test_bundles_are_installed_listed_and_restored(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("platformdirs.user_data_path", lambda *_: tmp_path)
    assert "no bundles in" in gellight("list").stdout
    sensor = ("--sensor", "sim://?board=0")
    first, second = made(tmp_path / "first", "simulated", "1"), made(tmp_path / "second", "simulated", "2")
    for bundle in (first, second):
        done = succeeded(gellight("install", str(bundle), *sensor))
        assert "it has no board" in done.stdout
    done = gellight("restore", *sensor, "--json")
    assert json.loads(done.stdout)["identity"] == load_bundle(first).identity
    listed = json.loads(gellight("list", "--json").stdout)["bundles"]
    assert {entry["identity"]: entry["in_service"] for entry in listed} == {
        load_bundle(first).identity: True,
        load_bundle(second).identity: False,
    }
    assert f"* {'simulated':<20} {load_bundle(first).identity}" in gellight("list").stdout
    other = made(tmp_path / "other", "GL-9", "3")
    done = gellight("install", str(other), *sensor)
    assert isinstance(done.exception, BundleError)


def test_a_name_for_people_is_listed_and_changes_nothing_else(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("platformdirs.user_data_path", lambda *_: tmp_path)
    bundle = made(tmp_path / "mine", "simulated", "1", name="left finger")
    assert gellight("install", str(bundle), "--sensor", "sim://?board=0").exit_code == 0
    assert gellight("list").stdout.rstrip().endswith("left finger")
    listed = json.loads(gellight("list", "--name", "left finger", "--json").stdout)["bundles"]
    assert [(entry["sensor"], entry["name"], entry["in_service"]) for entry in listed] == [
        ("simulated", "left finger", True)
    ]
    assert json.loads(gellight("list", "--name", "right finger", "--json").stdout)["bundles"] == []


@pytest.mark.parametrize("verb", [["install", "BUNDLE"], ["restore"], ["lights", "--out", "lit"], []])
def test_without_a_sensor_no_verb_takes_the_simulated_one(
    verb: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("platformdirs.user_data_path", lambda *_: tmp_path / "data")
    monkeypatch.setattr("platformdirs.user_config_path", lambda *_: tmp_path / "config")
    monkeypatch.delenv("GELLIGHT_SENSOR_URL", raising=False)
    monkeypatch.setattr("gellight.sensor.connection.discover", lambda **_: discover(sysfs=tmp_path, dev=tmp_path))
    bundle = made(tmp_path / "mine", "simulated", "1")
    refused = gellight(*(str(bundle) if word == "BUNDLE" else word for word in verb)).exception
    assert isinstance(refused, CameraError)
    assert "are plugged in: check the cable, or take the simulated sensor (--sensor sim://)" in str(refused)


def test_the_bundle_of_the_simulated_sensor_has_its_lights(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(simulated_bundle, "LIGHT_FRAMES", 2)
    now, shipped = simulated_bundle.lights_of_simulated_sensor(), read_lights(load_bundle("synthetic"))
    for kind, pattern in shipped.patterns.items():
        apart = now.patterns[kind] - pattern
        # The shipped LEDs are dimmed to one grey, and the first coefficient is the brightness.
        np.testing.assert_allclose(apart[:, 1:], 0, atol=0.05)  # of two frames each
