"""The springs of gels: what is cut, what sticks, and that all that is not cut agrees."""

from dataclasses import replace

import numpy as np
import pytest

from gellight_touch.springs import Spring, solve

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
