"""Roughness against formulas and another program's figures; what cannot be told is refused in a sentence."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from gellight.base.errors import InputError
from gellight_scan.filtering import waviness, without_form
from gellight_scan.height_map import HeightMap
from gellight_scan.roughness import Evaluation, area_roughness, profile_roughness
from tests.helpers.command_line import invoke

PIXEL_MM = 0.05
SHAPE = 400, 500
Y, X = (np.mgrid[: SHAPE[0], : SHAPE[1]] - np.array(SHAPE)[:, None, None] / 2 + 0.5) * PIXEL_MM
SHARP = Evaluation(blur_mm=0.0, cutoff_mm=8.0)
BLURRED = Evaluation(blur_mm=0.1)


def surface(height_mm: NDArray[np.floating], error_mm: float = 1e-6) -> HeightMap:
    height = np.asarray(height_mm, np.float32)
    return HeightMap(height, np.where(np.isfinite(height), np.float32(error_mm), height), PIXEL_MM)


def waves(wavelength_mm: float, amplitude_mm: float = 0.01, turn_rad: float = 0.0) -> NDArray[np.floating]:
    return amplitude_mm * np.cos(2 * np.pi * (X * np.cos(turn_rad) + Y * np.sin(turn_rad)) / wavelength_mm)


def test_a_sine_on_a_sphere_has_the_figures_of_a_sine() -> None:
    found = area_roughness(surface(waves(1.0) + 0.3 * X - (X**2 + Y**2) / 200), SHARP)
    assert found.sa_mm == pytest.approx(0.02 / np.pi, rel=0.01)
    assert found.sq_mm == pytest.approx(0.01 / np.sqrt(2), rel=0.01)
    assert found.sz_mm == pytest.approx(0.02, rel=0.03)
    assert (found.ssk, found.sku) == pytest.approx((0.0, 1.5), abs=0.02)
    assert found.wavelength_mm == pytest.approx(1.0, rel=0.01)
    assert found.reached == 1.0
    assert found.area_mm2 == pytest.approx((20 - 8) * (25 - 8), rel=0.02)


def test_a_line_across_the_waves_has_the_figures_of_a_sine() -> None:
    found = profile_roughness(surface(waves(1.0) + 0.1 * X), (-11, 2), (11, 2), replace(SHARP, cutoff_mm=2.5))
    assert found.sections == 5
    passed = 1 - 0.5 ** (2.5**2)
    assert found.ra_mm == pytest.approx(passed * 0.02 / np.pi, rel=0.01)
    assert found.rq_mm == pytest.approx(passed * 0.01 / np.sqrt(2), rel=0.01)
    assert found.rz_mm == pytest.approx(passed * 0.02, rel=0.02)


@pytest.mark.nightly
def test_the_figures_are_those_of_another_program() -> None:
    surfalize = pytest.importorskip("surfalize", reason="the judge from outside is not installed")
    random = np.random.default_rng(3)
    height = waviness(random.normal(size=SHAPE), 12.0) * 0.02 + 0.003 * X**2
    found = area_roughness(surface(height), SHARP)
    flat = without_form(height, "curved")
    inside = (flat - waviness(flat, 8.0 / PIXEL_MM))[80:-80, 80:-80]
    other = surfalize.Surface((inside - inside.mean()) * 1e3, 50.0, 50.0)
    figures = {
        "Sa": found.sa_mm * 1e3,
        "Sq": found.sq_mm * 1e3,
        "Sz": found.sz_mm * 1e3,
        "Ssk": found.ssk,
        "Sku": found.sku,
    }
    for name, value in figures.items():
        assert value == pytest.approx(getattr(other, name)(), rel=2e-3, abs=2e-3), name
    line = profile_roughness(surface(height), (-10.975, 0.025), (10.975, 0.025), replace(SHARP, cutoff_mm=2.5))
    along = without_form(height[200, 30:470], "curved")
    rough = (along - waviness(along, 50.0))[95:345]
    profile = surfalize.Profile(rough * 1e3, 50.0)
    for name, value in {"Ra": line.ra_mm, "Rq": line.rq_mm, "Rz": line.rz_mm}.items():
        assert value * 1e3 == pytest.approx(getattr(profile, name)(), rel=5e-3), name


@pytest.mark.parametrize("error_mm", [0.0005, 0.003])
def test_the_true_figure_lies_within_the_error_whatever_the_errors_are(error_mm: float) -> None:
    random = np.random.default_rng(1)
    for smooth_px in (1.0, 12.0):
        errors = waviness(random.normal(size=SHAPE), smooth_px)
        errors *= error_mm / errors.std()
        true, found = (area_roughness(surface(height, error_mm), SHARP) for height in (waves(2), waves(2) + errors))
        assert found.error_mm == pytest.approx(error_mm)
        assert abs(found.sq_mm - true.sq_mm) <= error_mm
        assert abs(found.sa_mm - true.sa_mm) <= error_mm
        assert abs(found.sz_mm - true.sz_mm) <= found.extremes_error_mm


@pytest.mark.parametrize(("wavelength_mm", "share"), [(0.8, 0.265), (1.0, 0.179), (2.0, 0.048)])
def test_what_the_blur_takes_is_told_and_not_added(wavelength_mm: float, share: float) -> None:
    whole, left = area_roughness(surface(waves(wavelength_mm)), replace(BLURRED, cutoff_mm=8.0)), 1 - share
    assert whole.blur_share == pytest.approx(share, abs=0.008)
    felt = area_roughness(surface(left * waves(wavelength_mm)), replace(BLURRED, cutoff_mm=8.0))
    assert felt.sa_mm == pytest.approx(left * whole.sa_mm, rel=1e-4)
    assert felt.sa_mm / (1 - felt.blur_share) == pytest.approx(0.02 / np.pi, rel=0.02)
    assert felt.finest_mm == pytest.approx(0.534, abs=1e-3)


def test_a_line_along_the_waves_does_not_hide_how_fine_they_are() -> None:
    """Along the line they look six times longer than they are."""
    oblique = surface(waves(0.5, turn_rad=np.radians(80)))
    with pytest.raises(
        InputError, match=r"waves found are 0\.[45]\d mm long, and the coating's blur of 0\.1 mm takes [56]\d%"
    ):
        profile_roughness(oblique, (-11, 0), (11, 0), replace(BLURRED, cutoff_mm=8.0))


@pytest.mark.parametrize(("wavelength_mm", "cutoff_mm"), [(1.0, 2.5), (1.25, 2.5), (1.5, 8.0), (3.0, 8.0)])
def test_the_cutoff_is_the_standard_s_for_these_waves(wavelength_mm: float, cutoff_mm: float) -> None:
    assert area_roughness(surface(waves(wavelength_mm)), BLURRED).cutoff_mm == cutoff_mm


def holed(share: float) -> HeightMap:
    height = waves(2.0)
    height[np.random.default_rng(0).random(SHAPE) < share] = np.nan
    return surface(height)


def test_valleys_that_were_not_reached_are_told_or_refused() -> None:
    assert area_roughness(holed(0.048), BLURRED).reached == pytest.approx(0.952, abs=0.002)
    with pytest.raises(InputError, match="the gel reached 95% of what is evaluated, and valleys are missing"):
        area_roughness(holed(0.052), BLURRED)


@pytest.mark.parametrize(
    ("held", "how"),
    [
        (surface(waves(0.76)), BLURRED),
        (surface(waves(0.26)), SHARP),
        (surface(waves(2.0), error_mm=0.007), BLURRED),
        (surface(waves(2.0)), replace(BLURRED, cutoff_mm=0.76)),
        (surface(waves(3.9)), BLURRED),
    ],
)
def test_what_can_just_be_told_is(held: HeightMap, how: Evaluation) -> None:
    assert area_roughness(held, how).sq_mm > 0


STRIP = surface(np.where(np.abs(Y) < 3, waves(2.0), np.nan))


@pytest.mark.parametrize(
    ("held", "how", "message"),
    [
        (surface(waves(0.73)), BLURRED, r"waves found are 0\.73 mm .* finer than 0\.74 mm; take a gel with a thinner"),
        (surface(waves(0.24)), SHARP, r"waves found are 0\.2\d mm long, fewer than 5 pixels of 0\.05 mm"),
        (
            surface(waves(2.0), error_mm=0.0072),
            BLURRED,
            r"of 7\.1 um rms was found, .* are off by 7\.2 um",
        ),
        (surface(waves(2.0), error_mm=np.inf), BLURRED, "off by inf um"),
        (surface(0 * X), SHARP, "of 0 um rms was found"),
        (surface(np.full(SHAPE, np.nan)), BLURRED, "the map holds no heights"),
        (surface(np.zeros((1, 1))), BLURRED, "the map holds no heights"),
        (STRIP, BLURRED, "a cutoff of 8 mm is too long for this surface: with its run-in it needs 16 mm"),
        (surface(waves(2.0)), replace(BLURRED, cutoff_mm=30.0), "a cutoff of 30 mm is too long"),
        (surface(waves(2.0)), replace(BLURRED, cutoff_mm=0.73), r"give more than 0\.74 mm"),
        (surface(waves(4.3)), BLURRED, "the waves are longer than 4 mm, which is waviness or form"),
    ],
)
def test_what_cannot_be_told_is_refused_in_a_sentence(held: HeightMap, how: Evaluation, message: str) -> None:
    with pytest.raises(InputError, match=message):
        area_roughness(held, how)


@pytest.mark.parametrize(
    ("ends", "message"),
    [
        (
            ((-11, 0), (14, 0)),
            r"none on this map: give two points within 12\.5 mm of its middle in x and 10\.0 mm in y",
        ),
        (((-11, 0), (np.nan, 0)), "none on this map"),
        (((1, 1), (1, 1)), "none on this map"),
        (((-11, 8), (11, 8)), "the gel did not reach the surface along this line"),
        (((-4, 0), (4, 0)), "a cutoff of 8 mm is too long"),
    ],
)
def test_a_line_that_is_none_is_refused(ends: tuple[tuple[float, float], tuple[float, float]], message: str) -> None:
    with pytest.raises(InputError, match=message):
        profile_roughness(STRIP, *ends, BLURRED)


@pytest.mark.parametrize("wrong", [{"blur_mm": np.nan}, {"blur_mm": -1.0}, {"cutoff_mm": np.nan}, {"cutoff_mm": 0.0}])
def test_lengths_that_are_none_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(InputError, match="is none: give"):
        Evaluation(**{"blur_mm": 0.1, **wrong})


# ---- `gellight surface` ----

ALONG = np.arange(-10, 10, 0.1, dtype=np.float32)


@pytest.fixture
def plate(tmp_path: Path) -> Path:
    height = np.broadcast_to(0.02 * np.cos(np.pi * ALONG), (200, 200)).astype(np.float32)
    HeightMap(height, np.full_like(height, 0.001), 0.1).save(tmp_path / "plate.npz")
    return tmp_path / "plate.npz"


def test_an_area_and_a_line_are_measured(plate: Path) -> None:
    area = json.loads(invoke("surface", plate, "--json").stdout)
    assert area["sa_mm"] == pytest.approx(0.04 / np.pi, rel=0.01)
    assert area["error_mm"] == pytest.approx(0.001)
    line = json.loads(invoke("surface", plate, "--line", -9, 1, 9, 1, "--cutoff-mm", 2.5, "--json").stdout)
    assert line["sections"] == 5
    text = invoke("surface", plate, env={"GELLIGHT_GEOMETRY_COATING_SMOOTHING_MM": "0.2"}).stdout
    assert "the coating's blur takes 18%; it is an S-filter of 1.07 mm" in text
    assert "cutoff 8 mm; the gel reached 100.0%" in text


def test_the_map_is_written_and_nothing_replaced_unasked(plate: Path) -> None:
    out = plate.parent / "map.png"
    assert invoke("surface", plate, "--out", out).stdout.startswith("written: ")
    before = out.read_bytes()
    refused = invoke("surface", plate, "--out", out)
    assert "exists: choose another name" in str(refused.exception)
    assert out.read_bytes() == before
    assert invoke("surface", plate, "--out", out, "--overwrite").exit_code == 0


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--cutoff-mm", "-1"), "a cutoff of -1.0 mm is none"),
        (("--frame", "3"), "--frame is of a recording"),
        (("--out", "map.xyz"), "end its name with one of .png"),
    ],
)
def test_rubbish_is_refused_in_a_sentence(plate: Path, words: tuple[str, ...], message: str) -> None:
    done = invoke("surface", plate, *words)
    assert done.exception is not None
    assert message in str(done.exception)


@pytest.mark.parametrize("name", ["none.npz", "none.mcap", "rubbish.npz", "rubbish.mcap"])
def test_a_file_that_is_none_is_refused(tmp_path: Path, name: str) -> None:
    if name.startswith("rubbish"):
        (tmp_path / name).write_bytes(b"rubbish")
    done = invoke("surface", tmp_path / name)
    assert type(done.exception).__name__ == "InputError"
    assert name in str(done.exception)
    assert "Errno" not in str(done.exception)
