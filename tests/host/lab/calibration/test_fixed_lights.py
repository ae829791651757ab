"""The guided routine on a camera whose lights are simply on, with a pixel size that is known already."""

from pathlib import Path
from typing import Any

import pytest

from gellight.base.errors import InputError
from gellight.bundle.bundle import load_bundle
from gellight.lab.calibration.choices import RoutineOptions
from gellight.lab.calibration.presets import PRESETS, preset_called
from gellight.lab.calibration.routine import Routine
from gellight.lab.simulator.virtual_hand import hand_of
from gellight.opening import open_camera
from tests.helpers.calibration_routine import options as short_options

PIXEL_MM = 0.2352
SMALL = {"image_width_px": 160, "image_height_px": 120, "pixel_size_mm": PIXEL_MM}
URL = "sim://?fps=500&board=0"


def options(folder: Path, **changes: Any) -> RoutineOptions:
    return short_options(folder, **{"pixel_size_mm": PIXEL_MM, **changes})


@pytest.mark.nightly
def test_no_ring_and_no_cylinder_are_needed(tmp_path: Path) -> None:
    with open_camera(URL, geometry=SMALL) as camera:
        assert camera.ring is None
        routine = Routine(camera, options(tmp_path), tmp_path / "state", hand=hand_of(camera))
        routine.act("start")
        routine.join(200)
        shown = routine.snapshot()
    assert shown["step"] == "finished", shown["problem"]
    assert shown["verdict"]["passed"]
    assert shown["figures"]["pixel_size"] == {"x_mm": PIXEL_MM, "y_mm": PIXEL_MM, "pixel_size_mm": PIXEL_MM}
    assert shown["figures"]["prepare"].get("led") is None
    bundle = load_bundle(tmp_path / "bundle")
    assert bundle.pixel_size_mm == pytest.approx((PIXEL_MM, PIXEL_MM))
    assert bundle.colours is None
    assert "nothing measured it" in bundle.files["report.html"].decode()


def test_a_calibration_goes_on_with_the_pixel_size_it_was_begun_with(tmp_path: Path) -> None:
    with open_camera(URL, geometry=SMALL) as camera:
        Routine(camera, options(tmp_path), tmp_path / "state")
        with pytest.raises(InputError, match=r"begun with pixel_size_mm 0.2352, not None"):
            Routine(camera, options(tmp_path, pixel_size_mm=None), tmp_path / "state")


@pytest.mark.parametrize("wrong", [0.0, -1.0, float("nan")])
def test_a_pixel_without_a_size_is_refused(tmp_path: Path, wrong: float) -> None:
    with pytest.raises(InputError, match="pixel_size_mm"):
        options(tmp_path, pixel_size_mm=wrong)


def test_presets_are_known_by_name_and_documented() -> None:
    assert preset_called("gelsight-mini").ball_radius_mm == 2.35
    with pytest.raises(InputError, match="did you mean gelsight-mini"):
        preset_called("gelsight")
    pages = ("other-sensors.md", "gelsight-mini.md", "digit.md")
    docs = "".join((Path(__file__).parents[4] / "docs" / page).read_text() for page in pages)
    for preset in PRESETS:
        assert f"`{preset.name}`" in docs
        assert preset.view_mm is None or f"{preset.view_mm[0]:g} x {preset.view_mm[1]:g} mm" in docs
        assert preset.ball_radius_mm is None or f"{preset.ball_radius_mm:g} mm" in docs
