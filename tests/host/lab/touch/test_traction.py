"""Traction along the gel: it sticks, slips at Coulomb's limit, and remembers its path."""

import numpy as np
import pytest

from gellight.base.errors import InputError
from gellight.lab.touch import Felt, TouchSensor
from sim_reference.objects import object_height

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


def test_a_turn_gives_torque_and_no_force(touch: TouchSensor, felt: Felt) -> None:
    sheared = touch.drag(felt, (0.0, 0.0, 0.05), friction=FRICTION)
    assert sheared.torque_nmm > 0
    assert sheared.force_n == pytest.approx((0.0, 0.0), abs=0.01 * felt.force_n)


def test_the_way_back_pulls_the_other_way(touch: TouchSensor, felt: Felt) -> None:
    out = touch.drag(felt, (5.0, 0.0, 0.0), friction=FRICTION)
    assert touch.drag(felt, (0.0, 0.0, 0.0), friction=FRICTION, before=out).force_n[0] < 0


def test_a_motion_that_is_none_is_refused(touch: TouchSensor, felt: Felt) -> None:
    with pytest.raises(InputError, match="friction -1"):
        touch.drag(felt, (0.0, 0.0, 0.0), friction=-1.0)
    with pytest.raises(InputError, match="finite mm and rad"):
        touch.drag(felt, (np.nan, 0.0, 0.0))
