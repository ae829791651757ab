"""How deep a ball stands in the gel by its contact circle, how much slopes beside it count, and steep walls."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from gellight.base.errors import InputError
from gellight.frame_path.pipeline import Reconstructor
from gellight.lab.simulator.scene import Press as Pressed
from gellight.lab.simulator.scene import Scene
from gellight.lab.training.indentation import Indentation, expected_indentation_mm, indentation_of
from gellight.lab.training.presses import Ball, Press, cap_depth_mm
from gellight.lab.training.skirts import find_skirts, skirt_words
from gellight.lab.training.training import fit, read_reference
from gellight.lab.training.validation import IndentationFigures, frame_of
from gellight.reconstruction.force import Layer
from sim_reference import gel
from sim_reference.camera import CameraResponse
from sim_reference.deformation import grid
from sim_reference.fem.gel import FemGel
from sim_reference.geometry import AS_BUILT
from tests.helpers.pressed_pictures import GEOMETRY, photograph

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


# ---- skirts ----


@pytest.mark.parametrize(
    ("felt", "skirt", "share"),
    [
        ([1.76] * 5, 1.0, 0.24),
        ([1.149] * 5, 0.5, 1.0),
        ([1.151] * 5, 0.5, 0.70),
        ([0.851] * 5, 0.5, 1.0),
        ([0.84] * 5, 0.5, 1.32),
        ([0.6] * 5, 0.5, 1.5),
        ([3.0] * 5, 1.0, 0.05),
        ([1.76] * 3, 1.0, 1.0),
        ([1.76] * 4, 1.0, 0.24),
    ],
)
def test_skirts_count_so_much_that_presses_are_felt_as_deep_as_they_are(
    felt: Sequence[float], skirt: float, share: float
) -> None:
    """Presses felt `felt` times as deep as they are, of which `skirt` comes from beside the contact."""

    def errors_at(counted: float) -> list[Any]:
        shares = [one - (1 - counted) * skirt for one in felt]
        return [SimpleNamespace(indentation=Indentation(felt_mm=one, expected_mm=1.0)) for one in shares]

    found = find_skirts(errors_at)
    assert found.share == share
    assert found.errors[0].indentation.felt_mm == pytest.approx(felt[0] - (1 - share) * skirt)
    told = skirt_words({"held_out": found.record()})
    assert [f"{felt[0]:.2f} times as deep" in words for words in told] == ([] if share == 1 else [True])


def test_where_nobody_knows_the_gel_all_slopes_count() -> None:
    errors = [SimpleNamespace(indentation=None)] * 9
    assert find_skirts(lambda counted: errors).share == 1.0  # type: ignore[arg-type, return-value]
    assert skirt_words({"held_out": None}) == []


# ---- walls that are steeper than any press of the ball ----


BALL = Ball(radius_mm=4, pixel_size_mm=GEOMETRY.pixel_size_mm)


@pytest.fixture(scope="module")
def felt(tmp_path_factory: pytest.TempPathFactory) -> tuple[Scene, Path, Reconstructor]:
    """A bundle of ten presses of .4 to 1 mm, whose steepest slope is 0.67."""
    folder, random = tmp_path_factory.mktemp("presses"), np.random.default_rng(2)
    scene = Scene(GEOMETRY, CameraResponse())
    photograph(scene, None, 0, folder / "untouched.png")
    presses = []
    for number in range(10):
        x, y = random.uniform([-12, -9], [12, 9])
        pressed = Pressed("BALL", random.uniform(0.4, 1.0), x, y)
        contact = photograph(scene, pressed, number + 1, folder / f"{number}.png")
        x_px, y_px = x / GEOMETRY.pixel_size_mm + 79.5, y / GEOMETRY.pixel_size_mm + 59.5
        radius_px, path = float(np.sqrt(contact.sum() / np.pi)), folder / f"{number}.png"
        presses.append(Press(image=path, center_x_px=x_px, center_y_px=y_px, contact_radius_px=radius_px))
    bundle = fit(presses, read_reference(folder / "untouched.png"), BALL, folder / "bundle", sensor="walls")
    return scene, folder, Reconstructor(bundle)


@pytest.mark.parametrize(("depth_mm", "least_mm"), [(0.3, 0.29), (0.6, 0.57), (1.0, 0.95)])
def test_a_flat_end_between_upright_walls_is_felt_as_deep_as_it_is(
    felt: tuple[Scene, Path, Reconstructor], depth_mm: float, least_mm: float
) -> None:
    """Where the network learnt the slopes of the presses alone: 0.294, 0.553, 0.830 mm."""
    scene, folder, path = felt
    contact = photograph(scene, Pressed("CYLINDER", depth_mm), 99, folder / "cylinder.png")
    frame = frame_of(Press(image=folder / "cylinder.png", center_x_px=80, center_y_px=60, contact_radius_px=5))
    middle = contact & (np.hypot(*(np.indices(contact.shape) - np.array([59.5, 79.5])[:, None, None])) < 8)
    assert least_mm < float(path.reconstruct(frame).depth_mm[middle].mean()) < 1.04 * depth_mm
