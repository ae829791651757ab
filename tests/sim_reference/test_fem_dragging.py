"""A finite-element gel dragged by what is pressed into it: no drag changes nothing, and forces balance."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from sim_reference.deformation import grid
from sim_reference.fem.dragging import Dragged, Pose, drag
from sim_reference.fem.gel import FemGel, solver_of
from sim_reference.geometry import SensorGeometry
from sim_reference.objects import object_height

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
