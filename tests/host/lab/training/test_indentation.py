"""How deep a ball stands in the gel by its contact circle: limits, another solver, and what is said of real presses."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gellight.base.errors import InputError
from gellight.lab.training.indentation import Indentation, expected_indentation_mm, indentation_of
from gellight.lab.training.presses import Ball, Press, cap_depth_mm
from gellight.lab.training.validation import IndentationFigures
from gellight.reconstruction.force import Layer
from sim_reference import gel
from sim_reference.deformation import grid
from sim_reference.fem.gel import FemGel
from sim_reference.geometry import AS_BUILT

R_MM = 4.0


@pytest.mark.parametrize(("a_mm", "deep_mm"), [(0.5, 0.062829), (1.0, 0.255413), (2.0, 1.098612)])
def test_a_thick_layer_is_sneddons_half_space(a_mm: float, deep_mm: float) -> None:
    """d = a / 2 ln((R + a) / (R - a)), but for the large strain."""
    small_strain = expected_indentation_mm(a_mm, R_MM, Layer(1e4)) / (1 - 0.16 * (a_mm / R_MM) ** 3)
    assert small_strain == pytest.approx(deep_mm, rel=2e-4)


@pytest.mark.nightly
@pytest.mark.parametrize("deep_mm", [0.5, 1.5])
def test_finite_elements_that_yield_without_end_find_the_same(deep_mm: float) -> None:
    """A ball of 2.35 mm in 4.25 mm of gel; their barrier keeps a gap, so their contact is some .03 mm too wide."""
    spacing_mm, radius_mm = 0.0625, 2.35
    at = grid(384, spacing_mm)
    square = at[:, None] ** 2 + at**2
    ball = np.where(square < 0.98 * radius_mm**2, np.sqrt(np.maximum(radius_mm**2 - square, 0)) - radius_mm, -50.0)
    geometry = replace(AS_BUILT, gel_thickness_mm=4.25)
    pressed = FemGel(resolution_mm=0.15, dense_radius_mm=3.0).press(ball, spacing_mm, deep_mm, geometry)
    contact_mm = float(np.sqrt(np.count_nonzero(pressed.surface.pressure > 0) / np.pi)) * spacing_mm
    assert expected_indentation_mm(contact_mm, radius_mm, Layer(4.25)) == pytest.approx(deep_mm, rel=0.06)


def test_a_thin_layer_that_gives_way_is_hertz_without_its_bulge() -> None:
    """Springs side by side: d = a^2 / (2 R) in the limit."""
    over = [expected_indentation_mm(0.5, R_MM, Layer(h, 0.3)) / (0.5**2 / (2 * R_MM)) for h in (1.0, 0.2, 0.05)]
    assert over == sorted(over, reverse=True)
    assert over[-1] == pytest.approx(1, abs=0.04)


@pytest.mark.parametrize("deep_mm", [0.3, 1.0, 1.5])
def test_the_simulators_solver_finds_the_same(deep_mm: float) -> None:
    """It knows the gel on a grid of .05 mm, whose pixels bring 2 % at .3 mm, and the contact by its pressure."""
    spacing_mm = 0.05
    x = (np.arange(400) - 199.5) * spacing_mm
    square = x[:, None] ** 2 + x**2
    ball = np.where(square < 0.9 * R_MM**2, np.sqrt(np.maximum(R_MM**2 - square, 0)) - R_MM, -50.0)
    pressed = gel.press(ball, spacing_mm, deep_mm, AS_BUILT)
    radius_mm = np.sqrt(np.count_nonzero(pressed.pressure > 0) / np.pi) * spacing_mm
    layer = Layer(AS_BUILT.gel_thickness_mm, AS_BUILT.poisson_ratio)
    small_strain = expected_indentation_mm(float(radius_mm), R_MM, layer) / (1 - 0.16 * (radius_mm / R_MM) ** 3)
    assert small_strain == pytest.approx(deep_mm, rel=0.025)


@pytest.mark.parametrize("a_mm", [0.0, 4.0, float("nan")])
def test_a_circle_as_wide_as_the_ball_is_refused(a_mm: float) -> None:
    with pytest.raises(InputError, match="under a ball of 4 mm"):
        expected_indentation_mm(a_mm, R_MM, Layer(4.0))


@pytest.mark.parametrize("height_mm", [np.inf, 50.0])
def test_felt_is_the_lowest_point_of_the_ball_that_fits(height_mm: float) -> None:
    ball = Ball(radius_mm=R_MM, pixel_size_mm=0.05, camera_height_mm=height_mm)
    press = Press(image=Path("p.png"), center_x_px=40, center_y_px=30, contact_radius_px=20)
    cap_mm = np.nan_to_num(cap_depth_mm(press, ball, (61, 81)))
    found = indentation_of(press, ball, cap_mm + 0.25, Layer(4.0))
    assert found.felt_mm == pytest.approx(0.25 + cap_mm.max(), abs=2e-4)
    assert found.expected_mm == pytest.approx(expected_indentation_mm(1.0, R_MM, Layer(4.0)), rel=0.003)


@pytest.mark.parametrize(
    ("shares", "warned"), [([0.84, 0.851, 2.0], False), ([0.849], True), ([1.149], False), ([1.151, 1.0, 3.0], True)]
)
def test_a_median_beyond_15_per_cent_is_a_warning(shares: list[float], warned: bool) -> None:
    figures = IndentationFigures.of([None, *(Indentation(felt_mm=2 * share, expected_mm=2.0) for share in shares)])
    assert figures is not None
    assert figures.alike == pytest.approx(np.mean([0.85 <= share <= 1.15 for share in shares]))
    assert figures.lines()[0].startswith("WARNING") == warned


def test_nothing_is_said_where_nobody_knows_the_gel() -> None:
    assert IndentationFigures.of([None, None]) is None
