"""`gellight calibrate list`, `install`, `restore` from the outside."""

import json
from pathlib import Path

import pytest
from click.testing import Result
from typer.testing import CliRunner

from gellight.base.errors import BundleError
from gellight.bundle.bundle import load_bundle, write_bundle
from gellight.cli.main import app


def gellight(*arguments: str) -> Result:
    return CliRunner().invoke(app, ["calibrate", *arguments])


def made(folder: Path, sensor: str, mark: str) -> Path:
    synthetic = load_bundle("synthetic")
    write_bundle(
        folder,
        sensor=sensor,
        reference=synthetic.reference,
        reference_frames=10,
        noise_grey=1.0,
        pixel_size_mm=(0.0588, 0.0588),
        network=synthetic.network,
        metrics={"verification": {"depth_mm": 0.01, "normal_deg": 1.0}},
        extra_files={"mark": mark.encode()},
    )
    return folder


def test_bundles_are_installed_listed_and_restored(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("platformdirs.user_data_path", lambda *_: tmp_path)
    assert "no bundles in" in gellight("list").stdout
    sensor = ("--sensor", "sim://?board=0")
    first, second = made(tmp_path / "first", "simulated", "1"), made(tmp_path / "second", "simulated", "2")
    for bundle in (first, second):
        done = gellight("install", str(bundle), *sensor)
        assert done.exit_code == 0, done.output
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
    assert "is the bundle of sensor 'GL-9', this is 'simulated': nothing was replaced" in str(done.exception)
