"""The judge of roughness on a few plates: what is told holds the plate, what cannot be felt is refused."""

from functools import partial

import numpy as np
import pytest

from gellight.lab.simulator.objects import sine_plate
from gellight_scan.height_map import HeightMap
from gellight_scan.roughness import Evaluation, ProfileRoughness, profile_roughness
from tests.benchmarks.roughness import END_MM, START_MM, Bench, Judged, line


@pytest.fixture(scope="module")
def bench() -> Bench:
    return Bench()


def judged(bench: Bench, wavelength_mm: float, steepness: float, depth_mm: float) -> Judged:
    def along(surface: HeightMap, how: Evaluation) -> ProfileRoughness:
        return profile_roughness(surface, START_MM, END_MM, how)

    plate = partial(sine_plate, wavelength_mm=wavelength_mm, amplitude_mm=steepness * wavelength_mm)
    return bench.judge(plate, wavelength_mm, 2.5, depth_mm, along)


def test_what_is_felt_is_the_gel_s_surface_and_the_range_holds_the_plate(bench: Bench) -> None:
    assert 0 < bench.error_mm < 0.003
    found = judged(bench, 1.0, 0.02, 0.5)
    assert found.object_um == pytest.approx(2e3 / np.pi * 0.02 * (1 - 0.5 ** (2.5**2)), rel=0.01)
    assert found.felt_um == pytest.approx(found.gel_um, rel=0.05)
    assert isinstance(found.told, ProfileRoughness)
    most = (found.told.ra_mm + found.told.error_mm) / (1 - found.told.blur_share)
    assert found.told.ra_mm - found.told.error_mm < found.object_um / 1e3 < most
    assert "of the plate" in line(found)


@pytest.mark.parametrize(
    ("plate", "reason"),
    [((0.6, 0.02, 0.5), "the coating's blur of 0.1 mm takes"), ((1.0, 0.1, 0.3), "the gel reached")],
)
def test_what_the_blur_takes_and_valleys_that_the_gel_spans_are_refused(
    bench: Bench, plate: tuple[float, float, float], reason: str
) -> None:
    found = judged(bench, *plate)
    assert reason in str(found.told)
    # Measured: .17 beside what the gel reached, where valleys are dimmer than along parallel rays.
    assert found.touched == pytest.approx(found.reached, abs=0.2)
