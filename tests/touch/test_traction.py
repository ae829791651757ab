"""Springs and traction of a gel that is pulled along."""

from dataclasses import replace

import numpy as np
import pytest

from gellight.base.errors import InputError
from gellight_touch import Felt, TouchSensor
from gellight_touch.springs import Spring, solve
from sim_reference.objects import object_height

STIFFNESS = np.array([100.0, 100.0, 150.0, 2e-3, 1e-3, 5e-4])
SPRING = Spring(
    "gel", 2, 1, np.eye(3), np.zeros(3), np.eye(6), STIFFNESS, np.zeros(6), friction=0.5,
    reach=np.array([0.002, 0.001]), lever=0.002,
)  # fmt: skip


def test_a_gel_pushes_tilts_within_its_contact_and_holds_by_friction() -> None:
    force = np.array([3.0, 4.0, 2.0, -1.0, 1.0, 1.0])
    SPRING.cut(force)
    np.testing.assert_allclose(force, [0.6, 0.8, 2.0, -0.004, 0.002, 0.002])
    kept = force.copy()
    SPRING.cut(kept)
    np.testing.assert_array_equal(kept, force)
    pulled = np.array([1.0, 0.0, -2.0, 0.1, 0.1, 0.1])
    SPRING.cut(pulled)
    np.testing.assert_array_equal(pulled, np.zeros(6))


@pytest.mark.parametrize(
    ("along", "spin", "sticks"), [(0.9, 0.0018, True), (1.0, 0.0, False), (0.0, -0.002, False), (0.0, 0.0, True)]
)
def test_what_is_held_by_all_of_friction_slips(along: float, spin: float, sticks: bool) -> None:
    assert SPRING.sticks(np.array([0.0, along, 2.0, 0.0, 0.0, spin])) is sticks


def test_a_bristle_slips_to_what_friction_holds() -> None:
    bristle = np.array([0.03, -0.04, 10.0])
    SPRING.slip(bristle, np.array([0.0, 0.0, 2.0, 0.0, 0.0, 0.0]))
    np.testing.assert_allclose(bristle, [0.006, -0.008, 4.0])


def test_what_is_not_cut_answers_what_is() -> None:
    """Of two springs at a body of three motions, one would pull: with it cut, the other alone stops the body."""
    rng = np.random.default_rng(0)
    jacobian, inertia = rng.normal(size=(12, 3)) * 0.1, np.diag([50.0, 60.0, 70.0])
    at_rest = [np.array([0.0, 0.0, -5.0, 0.0, 0.0, 0.0]), np.array([0.2, 0.1, 5.0, 1e-4, 0.0, 1e-4])]
    springs = [replace(SPRING, at_rest=one) for one in at_rest]
    moved, free, step_s, loss_s = jacobian @ inertia, np.array([0.1, -0.2, 0.05]), 1e-3, 2e-3
    forces = solve(springs, jacobian, moved, free, step_s, loss_s)
    assert not forces[0].any()
    end = free + step_s * forces.ravel() @ moved
    given = np.concatenate(at_rest) - (step_s + loss_s) * np.tile(STIFFNESS, 2) * (jacobian @ end)
    np.testing.assert_allclose(forces[1], given[6:], rtol=1e-6, atol=1e-9)
    assert given[2] < 0


FRICTION = 0.5


@pytest.fixture(scope="module")
def touch() -> TouchSensor:
    return TouchSensor(size=64)


@pytest.fixture(scope="module")
def felt(touch: TouchSensor) -> Felt:
    at = touch.layer.at_mm
    return touch.feel(-(object_height("BALL", at[None, :], at[:, None]) + 0.9))


def test_far_enough_everything_slips_with_coulombs_force(touch: TouchSensor, felt: Felt) -> None:
    sheared = touch.drag(felt, (5.0, 0.0, 0.0), friction=FRICTION)
    along_x, along_y = sheared.force_n
    assert along_x == pytest.approx(FRICTION * felt.force_n, rel=0.01)
    assert along_y == pytest.approx(0.0, abs=0.01 * felt.force_n)
    assert not sheared.sticks.any()


def test_a_little_sticks_in_the_middle_and_slips_at_the_rim(touch: TouchSensor, felt: Felt) -> None:
    sheared = touch.drag(felt, (0.0, 0.2, 0.0), friction=FRICTION)
    assert 0 < sheared.sticks.sum() < felt.contact.sum()
    assert sheared.sticks[32, 32]
    assert 0 < sheared.force_n[1] < FRICTION * felt.force_n
    assert sheared.tangential_mm[32, 32, 1] == pytest.approx(0.2, abs=0.01)
    length = np.linalg.norm(sheared.traction_mpa, axis=2)
    assert (length <= FRICTION * felt.pressure_mpa * (1 + 1e-6)).all()


def test_the_way_back_pulls_the_other_way(touch: TouchSensor, felt: Felt) -> None:
    out = touch.drag(felt, (5.0, 0.0, 0.0), friction=FRICTION)
    assert touch.drag(felt, (0.0, 0.0, 0.0), friction=FRICTION, before=out).force_n[0] < 0


@pytest.mark.parametrize("friction", [-1.0, np.nan, np.inf])
def test_a_friction_that_is_none_is_refused(touch: TouchSensor, felt: Felt, friction: float) -> None:
    with pytest.raises(InputError, match="Coulomb's coefficient, 0 or more"):
        touch.drag(felt, (0.0, 0.0, 0.0), friction=friction)
    with pytest.raises(InputError, match="Coulomb's coefficient, 0 or more"):
        touch.go_on(felt, np.zeros((64, 64, 2)), friction=friction)
    with pytest.raises(InputError, match="Coulomb's coefficient, 0 or more"):
        touch.pull(felt, (0.0, 0.0), friction=friction)


def test_a_motion_or_load_that_is_none_is_refused(touch: TouchSensor, felt: Felt) -> None:
    with pytest.raises(InputError, match=r"a motion of \(nan, 0.0, 0.0\): give x and y in mm"):
        touch.drag(felt, (np.nan, 0.0, 0.0))
    with pytest.raises(InputError, match="give x and y in mm"):
        touch.drag(felt, (0.1, 0.0))  # type: ignore[arg-type]
    with pytest.raises(InputError, match=r"a load of .* give x and y in N"):
        touch.pull(felt, (np.inf, 0.0))
    for moved_mm in (np.zeros((64, 64)), np.full((64, 64, 2), np.nan)):
        with pytest.raises(InputError, match=r"give \(64, 64, 2\) finite mm"):
            touch.go_on(felt, moved_mm)


@pytest.mark.parametrize("load", [(1.2, 0.3), (-3.0, 1.0), (2.0, -300.0)])
def test_what_is_pulled_harder_than_friction_holds_slips_along_the_load(
    touch: TouchSensor, felt: Felt, load: tuple[float, float]
) -> None:
    most = FRICTION * felt.force_n
    pulled = touch.pull(felt, (load[0] * most, load[1] * most), friction=FRICTION)
    assert np.hypot(*pulled.force_n) == pytest.approx(most, rel=2e-3)
    assert np.arctan2(*pulled.force_n) == pytest.approx(np.arctan2(*load), abs=2e-3)
    assert pulled.torque_nmm == pytest.approx(0.0, abs=1e-3 * most)


def test_a_point_that_cannot_hold_a_torque_holds_a_force(touch: TouchSensor) -> None:
    gap = np.full((64, 64), 1.0)
    gap[32, 32] = -0.01
    felt = touch.feel(gap)
    assert felt.contact.sum() == 1
    pulled = touch.pull(felt, (0.3 * felt.force_n, 0.0), 5.0)
    assert pulled.force_n == pytest.approx((0.3 * felt.force_n, 0.0), rel=2e-3, abs=1e-9)


def test_what_slips_and_turns_pulls_along_what_pulls_it(touch: TouchSensor, felt: Felt) -> None:
    pulled = touch.pull(felt, (0.8 * FRICTION * felt.force_n, 0.4 * FRICTION * felt.force_n), 1.0, friction=FRICTION)
    assert pulled.torque_nmm > 0.1
    assert np.hypot(*pulled.force_n) < 0.9 * FRICTION * felt.force_n
    assert np.arctan2(*pulled.force_n) == pytest.approx(np.arctan2(0.8, 0.4), abs=0.01)


def test_two_objects_carry_a_load_and_a_torque_together(touch: TouchSensor) -> None:
    at = touch.layer.at_mm
    balls = [
        object_height("BALL", at[None, :] - x, at[:, None] - y) + deep for x, y, deep in ((-5, 1, 0.7), (6, -2, 0.4))
    ]
    two = touch.feel(-np.maximum(*balls))
    load, torque_nmm = (0.3 * two.force_n, -0.2 * two.force_n), 1.5 * two.force_n
    pulled = touch.pull(two, load, torque_nmm)
    assert pulled.force_n == pytest.approx(load, abs=2e-3 * two.force_n)
    assert pulled.torque_nmm == pytest.approx(torque_nmm, rel=5e-3)
    assert (np.linalg.norm(pulled.traction_mpa, axis=2) <= 0.8 * two.pressure_mpa * (1 + 1e-6)).all()
