"""Plates whose roughness is known."""

import numpy as np
import pytest

from gellight.lab.simulator.objects import FLAT_MM, PLATE_MM, object_height
from sim_reference.deformation import NO_OBJECT, grid

AT = grid(601, 0.05)
X, Y = AT[None, :], AT[:, None]
FLAT = np.hypot(X, Y) < FLAT_MM


@pytest.mark.parametrize(("wavelength", "amplitude"), [(0.5, 0.01), (2.0, 0.04)])
def test_a_sine_plate_has_waves_of_its_length_and_amplitude(wavelength: float, amplitude: float) -> None:
    height = object_height(f"SINE-{wavelength}-{amplitude}", X, Y)
    row = height[300, np.abs(AT) < 10]
    assert height.max() == height[300, 300] == 0
    assert np.ptp(row) == pytest.approx(2 * amplitude, rel=1e-9)
    crests = np.flatnonzero((row[1:-1] > row[:-2]) & (row[1:-1] > row[2:]))
    assert np.diff(crests).mean() * 0.05 == pytest.approx(wavelength, rel=0.01)


def test_a_random_relief_has_its_rms_and_no_waves_outside_its_band() -> None:
    height = object_height("ROUGH-0.02-1-4", X, Y)
    assert height[FLAT].std() == pytest.approx(0.02, rel=0.1)
    assert abs(height.max()) < 0.0005
    part = height[150:451, 150:451]
    windowed = (part - part.mean()) * np.hanning(301)[:, None] * np.hanning(301)
    power = np.abs(np.fft.rfft2(windowed)) ** 2
    waves = np.hypot(np.fft.rfftfreq(301, 0.05)[None, :], np.fft.fftfreq(301, 0.05)[:, None])
    assert power[(waves > 1 / 4.8) & (waves < 1.2)].sum() > 0.97 * power.sum()


def test_the_relief_is_the_same_wherever_it_is_asked_for() -> None:
    whole = object_height("ROUGH-0.02-1-4", X, Y)
    part = object_height("ROUGH-0.02-1-4", X[:, 200:300], Y[250:260])
    np.testing.assert_array_equal(part, whole[250:260, 200:300])


def test_the_edge_is_rounded_and_ends() -> None:
    height = object_height("SINE-1-0.01", X, Y)
    assert (height[np.hypot(X, Y) >= PLATE_MM] == NO_OBJECT).all()
    edge = height[300, (AT > FLAT_MM) & (AT < PLATE_MM - 0.1)]
    assert -0.8 < edge.min() < -0.6
    assert np.abs(np.diff(edge)).max() < 0.05


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("SINE-0.2-0.01", "0.5 to 12 mm long"),
        ("SINE-2-0", "up to 0.5 mm"),
        ("SINE-2-9", "up to 0.5 mm"),
        ("SINE-2", "no relief 'SINE-2': give SINE-WAVELENGTH-AMPLITUDE"),
        ("SINE-nan-0.1", "no relief"),
        ("ROUGH-0.01-4-1", "0.5 to 12 mm"),
        ("ROUGH-0.01-1-99", "0.5 to 12 mm"),
        ("ROUGH-1-2-3-4", "no relief"),
    ],
)
def test_what_is_no_relief_is_refused(name: str, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        object_height(name, X, Y)
