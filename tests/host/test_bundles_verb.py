"""`gellight calibrate list`, `install`, `restore` from the outside."""

import json
import os
import subprocess
import sys
from pathlib import Path

from gellight.calibration import load_calibration, write_calibration

ROOM = Path(__file__).parents[2]


def gellight(home: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "XDG_DATA_HOME": str(home), "OPENBLAS_NUM_THREADS": "1"}
    code = "from gellight.cli.main import run; run()"
    command = [sys.executable, "-c", code, "calibrate", *arguments]
    return subprocess.run(command, capture_output=True, text=True, env=environment, check=False)


def made(folder: Path, sensor: str, mark: str) -> Path:
    synthetic = load_calibration("synthetic")
    write_calibration(
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


def test_bundles_are_installed_listed_and_restored(tmp_path: Path) -> None:
    assert "no bundles in" in gellight(tmp_path, "list").stdout
    sensor = ("--sensor", "sim://?board=0")
    first, second = made(tmp_path / "first", "simulated", "1"), made(tmp_path / "second", "simulated", "2")
    for bundle in (first, second):
        done = gellight(tmp_path, "install", str(bundle), *sensor)
        assert done.returncode == 0, done.stderr
        assert "it has no board" in done.stdout
    done = gellight(tmp_path, "restore", *sensor, "--json")
    assert json.loads(done.stdout)["identity"] == load_calibration(first).identity
    listed = json.loads(gellight(tmp_path, "list", "--json").stdout)["bundles"]
    assert {entry["identity"]: entry["in_service"] for entry in listed} == {
        load_calibration(first).identity: True,
        load_calibration(second).identity: False,
    }
    assert f"* {'simulated':<20} {load_calibration(first).identity}" in gellight(tmp_path, "list").stdout
    other = made(tmp_path / "other", "GL-9", "3")
    done = gellight(tmp_path, "install", str(other), *sensor)
    assert done.returncode == 2
    assert "is the bundle of sensor 'GL-9', this is 'simulated': nothing was replaced" in done.stderr
