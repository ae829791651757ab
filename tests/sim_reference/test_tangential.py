"""The sheared layer against what is known: the pressed layer, Cerruti, simple shear, Cattaneo and Mindlin."""

import numpy as np
import pytest

from sim_reference.deformation import grid
from sim_reference.fem.tangential import Layer, _Window, at_rest, compliances, drag, rigid_motion
from sim_reference.gel import compliance, press, wave_number
from sim_reference.geometry import SensorGeometry
from sim_reference.objects import object_height

THICKNESS, POISSON = 5.0, 0.49


def mesh(size: int, spacing: float) -> tuple[np.ndarray, np.ndarray]:
    at = grid(size, spacing)
    x, y = np.meshgrid(at, at)
    return x, y


def hertz(size: int, spacing: float, radius: float) -> np.ndarray:
    """Pressure of a ball on a half space, highest 0.05, contact of that radius."""
    return 0.05 * np.sqrt(np.maximum(1 - np.square(np.hypot(*mesh(size, spacing)) / radius), 0))


def test_its_normal_part_is_the_pressed_layer() -> None:
    k = wave_number(64, 0.25)
    k[0, 0] = 1.0
    expected = compliance(64, 0.25, THICKNESS, POISSON)
    found = compliances(k, THICKNESS, POISSON)[2]
    np.testing.assert_allclose(found.ravel()[1:], expected.ravel()[1:], rtol=1e-12)
    pressure = np.random.default_rng(0).random((64, 64))
    traction = np.stack([0 * pressure, 0 * pressure, pressure], axis=2)
    layer = Layer((64, 64), 0.25, THICKNESS, POISSON)
    moved = layer.displacement(traction)
    np.testing.assert_allclose(moved[..., :2], layer.pressed(pressure), atol=1e-12)
    deep = np.fft.irfft2(np.fft.rfft2(pressure) * expected, s=pressure.shape)
    np.testing.assert_allclose(moved[..., 2], deep, atol=1e-12)


def test_work_is_the_same_both_ways_round() -> None:
    # Betti: what load a does on the motion under load b is what b does on the motion under a.
    layer = Layer((48, 40), 0.3, THICKNESS, 0.4)
    a, b = np.random.default_rng(1).normal(size=(2, 48, 40, 3))
    assert (a * layer.displacement(b)).sum() == pytest.approx((b * layer.displacement(a)).sum(), rel=1e-9)


@pytest.mark.parametrize("poisson", [0.3, 0.49])
def test_a_disc_of_traction_on_a_thick_layer_is_cerruti(poisson: float) -> None:
    # Johnson 1985, equation 3.87 for q along x, over a disc by sums; differences, for the grid is periodic.
    size, spacing, radius = 512, 0.1, 2.0
    x, y = mesh(size, spacing)
    traction = np.zeros((size, size, 2))
    traction[..., 0] = np.hypot(x, y) < radius
    moved = Layer((size, size), spacing, 200.0, poisson).sheared(traction)[..., 0]

    def cerruti(at_x: float, at_y: float) -> float:
        r = np.hypot(x - at_x, y - at_y)
        cells = traction[..., 0] * spacing**2 / (2 * np.pi) * ((1 - poisson) / r + poisson * (x - at_x) ** 2 / r**3)
        return float(cells.sum())

    aside = size // 2 + 40
    across, half = moved[size // 2, aside] - moved[aside, size // 2], spacing / 2  # half: no cell of the sum is at 0
    expected = cerruti(x[0, aside] + half, half) - cerruti(half, y[aside, 0] + half)
    assert across == pytest.approx(expected, rel=0.02)


def test_a_wide_load_is_simple_shear() -> None:
    size, spacing = 256, 0.5
    x, y = mesh(size, spacing)
    traction = np.zeros((size, size, 2))
    traction[..., 0] = 0.05 * ((np.abs(x) < 24) & (np.abs(y) < 24))
    moved = Layer((size, size), spacing, THICKNESS, POISSON).sheared(traction)
    assert moved[size // 2, size // 2, 0] == pytest.approx(0.05 * THICKNESS, rel=0.03)


@pytest.mark.parametrize("share", [0.2, 0.5, 0.8])
def test_the_part_that_sticks_is_cattaneos_and_mindlins(share: float) -> None:
    # c = a (1 - Q / (mu P))^(1/3), under the traction mu p minus that of a smaller Hertz contact (Johnson 7.2).
    size, spacing, radius, friction = 128, 0.05, 1.5, 0.5
    layer = Layer((size, size), spacing, 100.0, POISSON)
    pressure = hertz(size, spacing, radius)
    inner = radius * (1 - share) ** (1 / 3)
    pull = friction * (pressure - inner / radius * hertz(size, spacing, inner))
    motion, middle = np.zeros((size, size, 2)), slice(size // 2 - 2, size // 2 + 2)
    motion[..., 0] = layer.sheared(np.stack([pull, 0 * pull], axis=2))[middle, middle, 0].mean()
    dragged = drag(at_rest(pressure, layer), pressure, motion, friction, layer, tolerance=1e-7)
    felt = dragged.traction[..., 0].sum() / (friction * pressure.sum())
    sticking = np.sqrt(dragged.sticks.sum() * spacing**2 / np.pi)
    assert felt == pytest.approx(share, abs=0.002)
    assert sticking == pytest.approx(radius * (1 - felt) ** (1 / 3), rel=0.02)


def test_a_press_spreads_the_gel_and_nothing_pulls() -> None:
    geometry = SensorGeometry()
    spacing, size = 0.25, 192
    at = grid(size, spacing)
    pressed = press(object_height("BALL", at[None, :], at[:, None]), spacing, 1.0, geometry)
    layer = Layer((size, size), spacing, geometry.gel_thickness_mm, geometry.poisson_ratio)
    begin = at_rest(pressed.pressure, layer)
    x, y = mesh(size, spacing)
    outward = (begin.displacement_mm * np.stack([x, y], axis=2)).sum(axis=2) / np.hypot(x, y)
    assert 0.05 < outward.max() < 0.09
    still = drag(begin, pressed.pressure, np.zeros((size, size, 2)), 0.5, layer)
    assert not still.traction.any()


def test_a_drag_that_goes_far_slides_with_all_of_the_friction_back_turns_it_and_a_twist_has_a_torque_alone() -> None:
    layer, pressure, (x, y) = Layer((64, 64), 0.25, THICKNESS, POISSON), hertz(64, 0.25, 2.0), mesh(64, 0.25)
    forth = drag(at_rest(pressure, layer), pressure, rigid_motion(x, y, (2.0, 0.0, 0.0)), 0.4, layer)
    assert forth.traction[..., 0].sum() == pytest.approx(0.4 * pressure.sum(), rel=1e-6)
    assert not forth.sticks.any()
    back = drag(forth, pressure, rigid_motion(x, y, (1.0, 0.0, 0.0)), 0.4, layer)
    assert back.traction[..., 0].sum() < 0
    turned = drag(at_rest(pressure, layer), pressure, rigid_motion(x, y, (0.0, 0.0, 0.05)), 5.0, layer)
    torque = (x * turned.traction[..., 1] - y * turned.traction[..., 0]).sum()
    assert torque > 0
    assert abs(turned.traction.sum(axis=(0, 1))).max() < 1e-6 * torque


@pytest.mark.parametrize("shape", [(48, 40), (41, 37)])
@pytest.mark.parametrize("rows", [slice(7, 8), slice(0, 9), slice(30, 48), slice(5, 36)])
@pytest.mark.parametrize("columns", [slice(3, 14), slice(1, 39)])
def test_a_window_around_a_contact_is_the_whole_grid(shape: tuple[int, int], rows: slice, columns: slice) -> None:
    random, touched = np.random.default_rng(3), np.zeros(shape, bool)
    touched[rows, columns] = random.random(touched[rows, columns].shape) < 0.7
    layer = Layer(shape, 0.4, THICKNESS, POISSON)
    window, traction = _Window(layer, touched), random.normal(size=(*shape, 2)) * touched[..., None]
    np.testing.assert_allclose(window.sheared(traction[window.cut]), layer.sheared(traction)[window.cut], atol=1e-12)
    for _ in range(20):  # by the power iteration towards the traction that moves the contact most
        moved = layer.sheared(traction) * touched[..., None]
        most, traction = np.linalg.norm(moved), moved / np.linalg.norm(moved)
    assert 0.6 * window.stiffest_mm < most <= window.stiffest_mm * (1 + 1e-9)


def test_a_drag_ends_where_a_longer_iteration_does_and_without_contact_at_once() -> None:
    layer, pressure = Layer((64, 64), 0.5, THICKNESS, POISSON), hertz(64, 0.5, 3.0)
    moved = rigid_motion(*mesh(64, 0.5), (0.02, 0.01, 0.004))
    found, longer = (
        drag(at_rest(pressure, layer), pressure, moved, 0.6, layer, tolerance=tolerance) for tolerance in (1e-5, 1e-12)
    )
    assert 0.1 < longer.sticks.sum() / np.count_nonzero(pressure) < 0.9
    assert np.linalg.norm(found.traction - longer.traction) < 1e-4 * np.linalg.norm(longer.traction)
    assert longer.offset_mm[longer.sticks] == pytest.approx(at_rest(pressure, layer).offset_mm[longer.sticks], abs=1e-9)
    assert not drag(at_rest(0 * pressure, layer), 0 * pressure, moved, 0.6, layer).traction.any()
