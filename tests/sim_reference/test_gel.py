"""The gel against Hertz, the bonded layer and the equations of elasticity; complementarity, convergence, refusals."""

from dataclasses import replace

import numpy as np
import pytest

from sim_reference.deformation import NO_OBJECT, Deformation, NotConverged, grid
from sim_reference.gel import compliance, deflection, press
from sim_reference.geometry import SensorGeometry
from sim_reference.objects import OBJECT_NAMES, object_height
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


@pytest.mark.parametrize(
    ("name", "depth", "said"),
    [("BALL", -0.1, "press depth"), ("BALL", 3.1, "press depth"), ("BALL", np.nan, "press depth"),
     ("CUBE", 0.5, "'CUBE'.*BALL, TSTEP")],
)  # fmt: skip
def test_an_impossible_press_is_refused(name: str, depth: float, said: str) -> None:
    with pytest.raises(ValueError, match=said):
        press_object(name, depth, GEOMETRY, size=64)


def paraboloid(at: np.ndarray, radius: float) -> np.ndarray:
    """What Hertz takes for a sphere."""
    square = at[None, :] ** 2 + at[:, None] ** 2
    return np.where(square < radius**2, -square / (2 * radius), NO_OBJECT)


def layer_response(k: float, h: float, nu: float) -> float:
    """Depth per pressure cos(kx) of a bonded layer in units of 1 / mu: Airy's stress function, solved numerically.

    phi(z) is a sum of e^(kz), e^(-kz), z e^(kz), z e^(-kz). Plane strain gives u_x ~ (1 - nu) phi'' + nu k^2 phi and
    u_z = ((1 - nu) phi''' - (2 - nu) k^2 phi') / (2 mu k^2); both vanish at z = 0. At z = h the shear phi' is 0 and the
    pressure k^2 phi is 1.
    """

    def derivatives(z: float) -> list[np.ndarray]:
        def nth(n: int, s: float) -> list[float]:
            return [s**n * np.exp(s * z), (s**n * z + n * s ** (n - 1)) * np.exp(s * z)]

        return [np.array(nth(n, k) + nth(n, -k)) for n in range(4)]

    def depth(d: list[np.ndarray]) -> np.ndarray:
        return ((1 - nu) * d[3] - (2 - nu) * k**2 * d[1]) / (2 * k**2)

    bottom, top = derivatives(0.0), derivatives(h)
    conditions = np.array([(1 - nu) * bottom[2] + nu * k**2 * bottom[0], depth(bottom), top[1], k**2 * top[0]])
    return abs(float(depth(top) @ np.linalg.solve(conditions, [0, 0, 0, 1])))


@pytest.mark.parametrize("nu", [0.0, 0.3, 0.49])
@pytest.mark.parametrize("column", [1, 3, 10])
def test_the_layer_answers_as_the_equations_of_elasticity_say(nu: float, column: int) -> None:
    response = compliance(64, 1.0, 5.0, nu)
    assert response[0, column] == pytest.approx(layer_response(2 * np.pi * column / 64, 5.0, nu), rel=1e-9)


def test_depth_is_linear_in_pressure_and_moves_with_it() -> None:
    rng = np.random.default_rng(0)
    response = compliance(32, 0.5, 5.0, 0.49)
    p, q = rng.random((2, 32, 32))
    both = deflection(2 * p + q, response)
    assert both == pytest.approx(2 * deflection(p, response) + deflection(q, response), abs=1e-12)
    assert deflection(np.roll(p, (3, -5), (0, 1)), response) == pytest.approx(
        np.roll(deflection(p, response), (3, -5), (0, 1)), abs=1e-12
    )


def test_a_press_looks_the_same_everywhere() -> None:
    at = grid(128, 0.375)
    height = object_height("BALL", at[None, :], at[:, None])
    here = press(height, 0.375, 0.8, GEOMETRY).depth_mm
    there = press(np.roll(height, (7, -4), (0, 1)), 0.375, 0.8, GEOMETRY).depth_mm
    assert there == pytest.approx(np.roll(here, (7, -4), (0, 1)), abs=1e-9)


def test_the_gel_bulges_beside_the_object_and_keeps_its_volume() -> None:
    pressed = press(paraboloid(grid(256, 48 / 256), 4.0), 48 / 256, 1.0, SensorGeometry(poisson_ratio=0.499))
    assert pressed.depth_mm.min() < -0.01
    displaced = pressed.depth_mm[pressed.depth_mm > 0].sum()
    assert abs(pressed.depth_mm.sum()) < 0.05 * displaced


def test_a_contact_that_was_not_found_is_not_returned() -> None:
    with pytest.raises(NotConverged, match="coarser grid"):
        press(paraboloid(grid(64, 0.5), 4.0), 0.5, 1.0, GEOMETRY, max_iterations=2)


def test_an_object_that_is_no_square_of_numbers_is_refused() -> None:
    height = paraboloid(grid(33, 1.0), 4.0)
    for spoilt in (height[:-1], np.where(height == 0, np.nan, height)):
        with pytest.raises(ValueError, match="object"):
            press(spoilt, 1.0, 0.5, GEOMETRY)


def test_under_the_ball_the_gel_is_the_ball() -> None:
    pressed = press_object("BALL", 1.0, GEOMETRY)
    at = grid(len(pressed.depth_mm), pressed.spacing_mm)
    square = at[None, :] ** 2 + at[:, None] ** 2
    under = square < 1.2**2
    assert pressed.contact[under].all()
    np.testing.assert_allclose(pressed.depth_mm[under], np.sqrt(16 - square[under]) - 3, rtol=0, atol=2e-3)
