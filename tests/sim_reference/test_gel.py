"""The gel against what is known of elastic contact: Hertz, the bonded layer, complementarity, convergence."""

from dataclasses import replace

import numpy as np
import pytest

from sim_reference.deformation import NO_OBJECT, Deformation, grid
from sim_reference.gel import compliance, deflection, press
from sim_reference.geometry import SensorGeometry
from sim_reference.objects import OBJECT_NAMES, ObjectParameters, object_height
from sim_reference.surface import GRID_EXTENT_MM, press_object

GEOMETRY = replace(SensorGeometry(), coating_smoothing_mm=0.0)
BALL_RADIUS = 4.0


def ball(size: int, extent_mm: float, radius_mm: float = BALL_RADIUS) -> np.ndarray:
    at = grid(size, extent_mm / size)
    r = np.hypot(at[None, :], at[:, None])
    return np.where(r < radius_mm, np.sqrt(np.maximum(radius_mm**2 - r**2, 0)) - radius_mm, NO_OBJECT)


def force(deformation: Deformation) -> float:
    """Total force in units of (shear modulus) mm^2."""
    return float(deformation.pressure.sum() * deformation.spacing_mm**2)


def hertz_force(depth_mm: float, radius_mm: float, poisson_ratio: float) -> float:
    """4/3 E* sqrt(R) d^1.5 with E* = 2 mu / (1 - nu), in units of mu mm^2 (Johnson 1985, equation 4.22)."""
    return 4 / 3 * 2 / (1 - poisson_ratio) * radius_mm**0.5 * depth_mm**1.5


def test_a_ball_on_a_thick_layer_is_hertz() -> None:
    thick = replace(GEOMETRY, gel_thickness_mm=30.0, poisson_ratio=0.3)
    depth, extent, size = 0.1, 90.0, 1024
    pressed = press(ball(size, extent, radius_mm=10.0), extent / size, depth, thick)
    contact_radius = np.sqrt(pressed.contact.sum() * pressed.spacing_mm**2 / np.pi)
    # The contact is 1 mm in radius, a thirtieth of the layer: a few percent remain of the support and of the grid.
    assert force(pressed) == pytest.approx(hertz_force(depth, 10.0, 0.3), rel=0.06)
    assert contact_radius == pytest.approx(np.sqrt(10.0 * depth), rel=0.05)


def test_the_support_stiffens_a_thin_layer_as_dimitriadis_found() -> None:
    # Dimitriadis et al., Biophys. J. 82 (2002), equation 12: bonded incompressible layer, chi = sqrt(R d) / h.
    depth = 0.2
    chi = np.sqrt(BALL_RADIUS * depth) / GEOMETRY.gel_thickness_mm
    factor = 1 + 1.133 * chi + 1.283 * chi**2 + 0.769 * chi**3 + 0.0975 * chi**4
    pressed = press(ball(512, 48.0), 48.0 / 512, depth, replace(GEOMETRY, poisson_ratio=0.499))
    assert force(pressed) == pytest.approx(hertz_force(depth, BALL_RADIUS, 0.5) * factor, rel=0.05)


@pytest.mark.parametrize("name", OBJECT_NAMES)
def test_nothing_penetrates_and_nothing_pulls(name: str) -> None:
    at = grid(256, GRID_EXTENT_MM / 256)
    height = object_height(name, at[None, :], at[:, None])
    pressed = press(height, GRID_EXTENT_MM / 256, 0.8, GEOMETRY)
    gap = pressed.depth_mm - (height + 0.8)
    assert pressed.pressure.min() == 0
    assert gap.min() > -0.005, "the gel may not be inside the object"
    assert np.abs(gap[pressed.contact]).max() < 0.005, "where it presses, it touches"
    assert pressed.depth_mm.max() == pytest.approx(0.8 + height.max(), abs=0.01)


def test_pressing_deeper_needs_more_force() -> None:
    forces = [force(press_object("BALL", depth, GEOMETRY, size=256)) for depth in (0.25, 0.5, 1.0, 2.0)]
    assert forces == sorted(forces)
    assert forces[0] > 0


def test_an_untouched_gel_stays_flat() -> None:
    pressed = press_object("BALL", 0.0, GEOMETRY, size=129)
    assert not pressed.depth_mm.any()
    assert not pressed.contact.any()


def test_a_finer_grid_changes_less_and_less() -> None:
    depth = {size: press_object("BALL", 1.0, GEOMETRY, size=size).depth_mm for size in (128, 256, 512)}

    def means(size: int) -> np.ndarray:
        return depth[size].reshape(128, size // 128, 128, size // 128).mean(axis=(1, 3))

    assert np.abs(means(512) - means(256)).mean() < 0.5 * np.abs(means(256) - means(128)).mean()


def test_deflections_superpose() -> None:
    response = compliance(64, 0.5, 5.0, 0.49)
    one, other = np.random.default_rng(0).random((2, 64, 64))
    both = deflection(one + 2 * other, response)
    assert both == pytest.approx(deflection(one, response) + 2 * deflection(other, response), abs=1e-12)


def test_uniform_pressure_compresses_uniaxially() -> None:
    # u = p h (1 - 2 nu) / (2 mu (1 - nu)): no lateral strain under a bonded support.
    response = compliance(32, 1.0, 5.0, 0.3)
    assert deflection(np.ones((32, 32)), response) == pytest.approx(5 * 0.4 / (2 * 0.7))


def test_a_short_wave_does_not_feel_the_support() -> None:
    # Half space: u = p (1 - nu) / (mu k).
    size, spacing = 64, 0.1
    k = 2 * np.pi * 8 / (size * spacing)
    pressure = np.broadcast_to(np.cos(k * np.arange(size) * spacing), (size, size))
    response = compliance(size, spacing, 5.0, 0.49)
    assert deflection(pressure, response) == pytest.approx(pressure * 0.51 / k, rel=1e-6, abs=1e-9)


@pytest.mark.parametrize("depth", [-0.1, 3.1, float("nan")])
def test_an_impossible_press_is_refused(depth: float) -> None:
    with pytest.raises(ValueError, match="press depth"):
        press_object("BALL", depth, GEOMETRY, size=64)


def test_an_unknown_object_is_refused_with_the_known_ones() -> None:
    with pytest.raises(ValueError, match=r"'CUBE'.*BALL, TSTEP"):
        press_object("CUBE", 0.5, GEOMETRY, size=64)


@pytest.mark.parametrize("name", OBJECT_NAMES)
def test_every_object_has_its_highest_point_at_zero_and_its_relief(name: str) -> None:
    at = np.linspace(-20, 20, 1201)
    height = object_height(name, at[None, :], at[:, None])
    there = height > NO_OBJECT / 2
    assert height[there].max() == pytest.approx(0, abs=0.01)
    expected = {"BALL": 4.0, "BSWAVE": 2.0}.get(name, ObjectParameters().relief_mm)
    assert -height[there].min() == pytest.approx(expected, abs=0.15)
    reach = np.hypot(at[None, :], at[:, None])[there].max()
    assert reach == pytest.approx(4.0 if name == "BALL" else 17.5, abs=0.1)
