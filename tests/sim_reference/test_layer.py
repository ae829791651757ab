"""The elastic layer against the equations of elasticity, and what the contact solver refuses."""

from collections.abc import Callable

import numpy as np
import pytest

from sim_reference.deformation import NO_OBJECT, NotConverged, grid
from sim_reference.gel import compliance, deflection, press
from sim_reference.geometry import SensorGeometry
from sim_reference.objects import object_height
from sim_reference.surface import press_object

BARE = SensorGeometry(coating_smoothing_mm=0.0)


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


def test_short_waves_do_not_see_the_support_and_long_ones_compress_it() -> None:
    nu = 0.3
    response = compliance(64, 0.5, 5.0, nu)
    k = 2 * np.pi * 20 / 32
    assert response[0, 20] == pytest.approx((1 - nu) / k, rel=1e-9)
    wide = compliance(64, 100.0, 5.0, nu)
    assert wide[0, 1] == pytest.approx(wide[0, 0], rel=1e-3)


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
    here = press(height, 0.375, 0.8, BARE).depth_mm
    there = press(np.roll(height, (7, -4), (0, 1)), 0.375, 0.8, BARE).depth_mm
    assert there == pytest.approx(np.roll(here, (7, -4), (0, 1)), abs=1e-9)


def test_the_gel_bulges_beside_the_object_and_keeps_its_volume() -> None:
    pressed = press(paraboloid(grid(256, 48 / 256), 4.0), 48 / 256, 1.0, SensorGeometry(poisson_ratio=0.499))
    assert pressed.depth_mm.min() < -0.01
    displaced = pressed.depth_mm[pressed.depth_mm > 0].sum()
    assert abs(pressed.depth_mm.sum()) < 0.05 * displaced


def test_a_contact_that_was_not_found_is_not_returned() -> None:
    with pytest.raises(NotConverged, match="coarser grid"):
        press(paraboloid(grid(64, 0.5), 4.0), 0.5, 1.0, BARE, max_iterations=2)


def unsquare(height: np.ndarray) -> np.ndarray:
    return height[:-1]


def unfinished(height: np.ndarray) -> np.ndarray:
    return np.where(height == 0, np.nan, height)


@pytest.mark.parametrize("spoil", [unsquare, unfinished])
def test_an_object_that_is_no_square_of_numbers_is_refused(spoil: Callable[[np.ndarray], np.ndarray]) -> None:
    at = grid(33, 1.0)
    with pytest.raises(ValueError, match="object"):
        press(spoil(paraboloid(at, 4.0)), 1.0, 0.5, BARE)


def test_under_the_ball_the_gel_is_the_ball() -> None:
    pressed = press_object("BALL", 1.0, BARE)
    at = grid(len(pressed.depth_mm), pressed.spacing_mm)
    square = at[None, :] ** 2 + at[:, None] ** 2
    under = square < 1.2**2
    assert pressed.contact[under].all()
    np.testing.assert_allclose(pressed.depth_mm[under], np.sqrt(16 - square[under]) - 3, rtol=0, atol=2e-3)
