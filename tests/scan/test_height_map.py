"""A map of heights, its file, and one press as a map; the Gaussian filter against its formula; form."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gellight.base.errors import InputError
from gellight.frames.frames import TactileFrame
from gellight.frames.measures import ErrorBounds
from gellight.lab.simulator.objects import FLAT_MM, sine_plate
from gellight_scan.filtering import beyond_run_in, finest_mm, transmission, waviness, without_form
from gellight_scan.height_map import HeightMap, load_height_map, map_of_press
from sim_reference import gel
from sim_reference.deformation import grid
from sim_reference.geometry import SensorGeometry, pixel_grid
from sim_reference.surface import Surface, sample
from tests.helpers.tactile import tactile


@pytest.mark.parametrize(
    ("height", "error", "pixel_mm", "what"),
    [
        ((3, 4), (4, 3), 0.02, "shape"),
        ((12,), (12,), 0.02, "shape"),
        ((0, 4), (0, 4), 0.02, "shape"),
        ((3, 4), (3, 4), 0.0, "0.0 mm"),
        ((3, 4), (3, 4), float("nan"), "nan mm"),
    ],
)
def test_what_is_no_map_is_refused(height: tuple[int], error: tuple[int], pixel_mm: float, what: str) -> None:
    with pytest.raises(InputError, match=what):
        HeightMap(np.zeros(height, np.float32), np.zeros(error, np.float32), pixel_mm)


def test_a_field_that_is_missing_is_named(tmp_path: Path) -> None:
    np.savez(tmp_path / "other.npz", height_mm=np.zeros((2, 2)))
    with pytest.raises(InputError, match="error_mm"):
        load_height_map(tmp_path / "other.npz")


def test_a_device_is_no_map() -> None:
    """It would be read for ever. Whatever else is no map, tests/fuzz reads."""
    with pytest.raises(InputError, match=r"/dev/zero is no map of heights .*no regular file.*`gellight scan` writes"):
        load_height_map(Path("/dev/zero"))


@pytest.mark.parametrize("wavelength_mm", [1.0, 2.5, 4.0, 8.0])
def test_a_wave_passes_as_the_standard_has_it(wavelength_mm: float) -> None:
    """ISO 16610-21: exp(-pi (alpha c / l)^2) with alpha = sqrt(ln 2 / pi), so 2^-(c / l)^2."""
    x = np.arange(4000) * 0.02
    let_through = waviness(np.cos(2 * np.pi * x / wavelength_mm), 2.5 / 0.02)[1000:3000]
    assert np.abs(let_through).max() == pytest.approx(0.5 ** ((2.5 / wavelength_mm) ** 2), abs=5e-4)


@pytest.mark.nightly
def test_areas_are_filtered_as_another_program_does() -> None:
    filtering = pytest.importorskip("surfalize.filter", reason="the judge from outside is not installed")
    surfalize = pytest.importorskip("surfalize")
    height = np.random.default_rng(0).normal(size=(120, 150)).cumsum(axis=0)
    other = filtering.GaussianFilter(800.0, "lowpass")(surfalize.Surface(height, 50.0, 50.0)).data
    inside = beyond_run_in(np.isfinite(height), 16)
    inside[:16], inside[-16:], inside[:, :16], inside[:, -16:] = (False,) * 4  # it mirrors at the border
    assert np.abs(waviness(height, 16.0) - other)[inside].max() < 2e-4 * np.ptp(height)


def test_missing_heights_have_no_weight() -> None:
    height = np.full((60, 60), 3.0)
    height[20:25, 30:38] = np.nan
    found = waviness(height, 10.0)
    assert np.array_equal(np.isnan(found), np.isnan(height))
    assert np.nanmax(np.abs(found - 3.0)) < 1e-12


def test_half_a_cutoff_along_the_outline_is_run_in_and_a_hole_is_none() -> None:
    known = np.zeros((50, 70), bool)
    known[5:45, 10:60] = True
    known[20:22, 30:33] = False
    inside = beyond_run_in(known, 12)
    expected = np.zeros_like(known)
    expected[11:39, 16:54] = True
    assert np.array_equal(inside, expected)
    assert beyond_run_in(np.ones(100, bool), 20).sum() == 80


@pytest.mark.parametrize(("form", "left"), [("none", 1.0), ("plane", 0.1), ("curved", 1e-9)])
def test_the_form_is_taken_off_where_heights_are_known(form: str, left: float) -> None:
    y, x = np.mgrid[:40, :50] / 50.0
    height = 5 + 3 * x - 2 * y + x**2 - 0.5 * y**2 + 0.3 * x * y
    height[3, 4] = np.nan
    found = without_form(height, form)
    assert np.isnan(found[3, 4])
    assert (np.nanmax(np.abs(found)) < left) == (form == "curved")
    assert np.nanmax(np.abs(found)) > 0.05 or form == "curved"


def test_an_unknown_form_is_refused() -> None:
    with pytest.raises(InputError, match="no form 'cube' can be taken off: choose one of none, plane, curved"):
        without_form(np.zeros(9), "cube")


def test_what_a_blur_takes() -> None:
    assert transmission(finest_mm(0.1, 0.3), 0.1) == pytest.approx(0.7)
    assert finest_mm(0.1, 0.3) == pytest.approx(0.744, abs=1e-3)
    x = np.arange(4000) * 0.01
    kernel = np.exp(-((np.arange(-60, 61) * 0.01 / 0.1) ** 2) / 2)
    blurred = np.convolve(np.cos(2 * np.pi * x), kernel / kernel.sum(), "valid")
    assert np.abs(blurred).max() == pytest.approx(transmission(1.0, 0.1), abs=1e-3)


GEOMETRY = SensorGeometry(image_width_px=320, image_height_px=240, pixel_size_mm=0.1176)
PIXEL = (GEOMETRY.pixel_size_mm,) * 2
NEAR = np.hypot(*pixel_grid(GEOMETRY)) < FLAT_MM - 1


def pressed(wavelength_mm: float, steepness: float, depth_mm: float) -> Surface:
    at = grid(256, 0.2)
    plate = sine_plate(at[None, :], at[:, None], wavelength_mm, steepness * wavelength_mm)
    return sample(gel.press(plate, 0.2, depth_mm, GEOMETRY), GEOMETRY, 0.0, 0.0)


def frame(bounds: ErrorBounds | None = None) -> TactileFrame:
    true = pressed(2.0, 0.02, 0.5)
    felt = tactile(true.depth_mm, true.gradient_map, true.contact)
    felt.__dict__["error_bounds"] = bounds
    return felt


def test_a_press_is_a_map_of_what_was_reached_with_the_errors_that_are_told() -> None:
    felt = frame()
    found = map_of_press(felt, PIXEL, 0.002)
    assert np.array_equal(found.height_mm[found.reached], felt.depth_mm[found.reached])
    assert np.array_equal(np.isfinite(found.error_mm), found.reached)
    assert found.error_mm[found.reached].max() == np.float32(0.002)
    assert found.reached[NEAR].all()
    assert found.pixel_mm == PIXEL[0]


def test_the_errors_of_the_bundle_are_taken_where_it_knows_them() -> None:
    bound = np.full((240, 320), 1.645e-3, np.float32)
    bound[:, 150:] = np.inf
    found = map_of_press(frame(ErrorBounds(normal_deg=bound, shape_mm=bound)), PIXEL)
    assert not found.reached[:, 150:].any()
    assert found.error_mm[found.reached] == pytest.approx(1e-3)


def test_what_makes_no_map_is_refused() -> None:
    felt = frame()
    with pytest.raises(InputError, match=r"pixels of 0\.1 x 0\.12 mm are not square"):
        map_of_press(felt, (0.1, 0.12), 0.002)
    assert map_of_press(felt, (0.1, 0.10045), 0.002).pixel_mm == 0.1
    with pytest.raises(InputError, match="are not square"):
        map_of_press(felt, (0.1, 0.10055), 0.002)
    with pytest.raises(InputError, match="the bundle does not know by how much its depth is off: say it"):
        map_of_press(felt, PIXEL)
    nothing = replace(felt, depth_mm=np.zeros((240, 320), np.float32))
    with pytest.raises(InputError, match="nothing touches the gel in this frame"):
        map_of_press(nothing, PIXEL, 0.002)
