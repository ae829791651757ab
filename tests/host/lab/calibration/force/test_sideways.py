"""The constant of forces along the gel: from readings that are known, and refused where they cannot be."""

from pathlib import Path

import numpy as np
import pytest

from gellight.base.errors import InputError
from gellight.bundle.bundle import load_bundle
from gellight.lab.calibration.force.adding import measure_force
from gellight.lab.calibration.force.record import ForceReadings
from gellight.lab.calibration.force.sideways import LEAST_SHARE, fit_side
from gellight.lab.report.pictures import write_png
from gellight.opening import open_camera
from gellight.reconstruction.force import Layer

FOUND = np.array([[0.2, 0.1], [-0.3, 0.05], [0.1, -0.4], [0.0, 0.0]])


def test_the_constant_and_its_error_are_those_of_the_readings() -> None:
    exact = fit_side(1.3 * FOUND, FOUND, "f.csv")
    assert exact.side_scale == pytest.approx(1.3)
    assert exact.side_error_share == pytest.approx(LEAST_SHARE)
    off = fit_side(1.3 * FOUND * np.array([[1.1], [0.9], [1.0], [1.0]]), FOUND, "f.csv")
    assert 0.08 < off.side_error_share < 0.12


def test_what_a_load_cell_shows_of_presses_that_pull_nothing_is_no_pull() -> None:
    """It never shows 0; of 0.008 N beside 0.4 N nobody can tell the direction."""
    noise, felt = np.random.default_rng(0).normal(0, [[[0.008]], [[0.02]]], (2, 20, 2))
    fit = fit_side(np.vstack([1.3 * FOUND, noise]), np.vstack([FOUND, felt]), "f.csv")
    assert fit == fit_side(1.3 * FOUND, FOUND, "f.csv")


@pytest.mark.parametrize(
    ("side_n", "reason"),
    [
        (-FOUND, "y down"),
        (FOUND[:, ::-1], "one constant leaves"),
        (FOUND * np.array([[1.0], [0], [0], [0]]), "1 readings pull"),
    ],
)
def test_what_one_constant_cannot_explain_is_refused(side_n: np.ndarray, reason: str) -> None:
    with pytest.raises(InputError, match=reason):
        fit_side(side_n, FOUND, "f.csv")


@pytest.mark.parametrize("text", ["image,force_n,side_x_n\n1,1,1", "unix_s,force_n,side_x_n,side_y_n\n1,1,1,1"])
def test_half_a_force_and_one_without_pictures_are_refused(text: str, tmp_path: Path) -> None:
    path = tmp_path / "f.csv"
    path.write_text(text)
    with pytest.raises(InputError, match="side_y_n"):
        ForceReadings.read(path)


def test_pictures_of_a_pulled_gel_give_the_constant_of_the_simulated_one(tmp_path: Path) -> None:
    lines = ["image,force_n,side_x_n,side_y_n"]
    with open_camera("sim://?programme=0&board=0&dots=9x7") as camera:
        assert camera.stage is not None
        bundle = load_bundle("synthetic").with_files(camera.picture_files)
        for number, (x, y) in enumerate([(0.3, 0.0), (0.0, -0.4), (-0.3, 0.3)]):
            camera.stage.press("BALL", 0.8 + 0.1 * number, 0.5, 0.2)
            camera.stage.drag(x, y)
            frame = camera.read()
            assert frame.truth is not None
            assert frame.truth.shear is not None
            write_png(tmp_path / f"{number}.png", frame.image)
            normal_n = (0.835, 1.004, 1.187)[number]
            along = ",".join(f"{one:.4f}" for one in frame.truth.shear.force_n)
            lines.append(f"{number}.png,{normal_n},{along}")
    path = tmp_path / "f.csv"
    path.write_text("\n".join(lines))
    record = measure_force(bundle, path, None, Layer(5.0, 0.49), 40.0)
    assert record.side_scale == pytest.approx(1.0, abs=0.1)
    assert record.side_error_share < 0.12
    with pytest.raises(InputError, match="calibrate this gel with --dots"):
        measure_force(load_bundle("synthetic"), path, None, Layer(5.0, 0.49), 40.0)
