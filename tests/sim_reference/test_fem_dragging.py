"""A finite-element gel dragged by what is pressed into it: no drag changes nothing, and forces balance."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from sim_reference import gel
from sim_reference.deformation import grid
from sim_reference.fem.dragging import Dragged, Pose, drag
from sim_reference.fem.gel import FemGel, solver_of
from sim_reference.geometry import SensorGeometry
from sim_reference.objects import object_height

pytestmark = pytest.mark.nightly
GEOMETRY = replace(SensorGeometry(), coating_smoothing_mm=0.0)
SPACING = 0.25
AT = grid(128, SPACING)
BALL = object_height("BALL", AT[None, :], AT[:, None])
SMOOTH = FemGel(resolution_mm=1.0, dense_radius_mm=2.0)
DEPTH = 0.4


@cache
def pressed() -> Dragged:
    return drag(SMOOTH, BALL, SPACING, DEPTH, [Pose()], GEOMETRY)[0]


@cache
def pulled(x_mm: float, friction: float) -> Dragged:
    """Return the gel pressed without friction, then dragged with it."""
    rough, start = replace(SMOOTH, friction=friction), pressed().checkpoint
    return drag(rough, BALL, SPACING, DEPTH, [Pose((x_mm, 0.0, 0.0))], GEOMETRY, resume=start)[0]


def test_without_a_drag_the_press_is_the_press() -> None:
    press = SMOOTH.press(BALL, SPACING, DEPTH, GEOMETRY)
    assert pressed().force_n[2] == pytest.approx(press.force_n, rel=1e-3)
    assert np.abs(pressed().force_n[:2]).max() < 5e-3 * press.force_n
    surface = solver_of(SMOOTH, GEOMETRY).mesh.surface
    assert np.abs(pressed().surface_mm - press.state.at[surface]).max() < 1e-3


def test_the_support_holds_what_drags() -> None:
    solver, one = solver_of(SMOOTH, GEOMETRY), pulled(0.05, 0.4)
    bonded = np.setdiff1d(np.arange(len(solver.mesh.vertices)), solver.mesh.free)
    held = -solver.elastic.gradient(one.checkpoint.state.at)[bonded].sum(axis=0)
    np.testing.assert_allclose(held * SMOOTH.shear_modulus_mpa(GEOMETRY), one.force_n, atol=5e-3 * one.force_n[2])


FLAT = np.sqrt(30.0**2 - AT[None, :] ** 2 - AT[:, None] ** 2) - 30.0
"""a ball that slopes by no more than 0.06 where it touches: friction along it is friction along the gel"""
FLAT_DEPTH = 0.1


def slid(pose: Pose) -> Dragged:
    start = drag(SMOOTH, FLAT, SPACING, FLAT_DEPTH, [Pose()], GEOMETRY)[0].checkpoint
    return drag(replace(SMOOTH, friction=0.4), FLAT, SPACING, FLAT_DEPTH, [pose], GEOMETRY, resume=start)[0]


def test_what_slides_pulls_with_all_of_the_friction() -> None:
    one = slid(Pose((0.3, 0.0, 0.0)))
    assert not one.sticks.any()
    assert one.force_n[0] == pytest.approx(0.4 * one.force_n[2], rel=0.02)


def test_what_turns_in_place_turns_against_all_of_the_friction() -> None:
    # The layer's pressure, at full slip everywhere but in the middle.
    one = slid(Pose(turn_rad=(0.0, 0.0, 0.4)))
    pressure = gel.press(FLAT, SPACING, FLAT_DEPTH, GEOMETRY).pressure
    arm = (pressure * np.hypot(AT[None, :], AT[:, None])).sum() / pressure.sum()
    assert np.abs(one.force_n[:2]).max() < 5e-3 * one.force_n[2]
    assert one.torque_nmm == pytest.approx(0.4 * one.force_n[2] * arm, rel=0.05)
