"""The pressed object as an affine body: derivatives, the bound on its steps, and how it stands under a load."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from sim_reference.deformation import NotConverged, grid
from sim_reference.fem.affine_body import RIGIDITY, Load, gradient_by_object, hessians_by_object, rotation, tilt_rad
from sim_reference.fem.barrier import Barrier
from sim_reference.fem.gel import FemGel, FemPress, solver_of
from sim_reference.fem.height_field import HeightField
from sim_reference.fem.leaning import check_tilt, lean_under
from sim_reference.fem.newton import Contact
from sim_reference.geometry import SensorGeometry
from sim_reference.objects import object_height
from tests.helpers.derivatives import slope

RANDOM = np.random.default_rng(3)
FIELD_AT = grid(40, 0.2)
FIELD = HeightField(0.3 * np.sin(FIELD_AT)[:, None] * np.cos(0.7 * FIELD_AT)[None, :], 0.2)
MATRIX = rotation(np.array([0.1, -0.06])) + 0.02 * RANDOM.normal(size=(3, 3))
PIVOT = np.array([0.7, -0.4, 0.0])
LEANING = Barrier(FIELD, RANDOM.uniform(0.5, 1.5, 50), 0.2, 5.0, 0.1, MATRIX, PIVOT)

GEOMETRY = replace(SensorGeometry(), coating_smoothing_mm=0.0, gel_diameter_mm=24.0)
SPACING = 0.125
AT = grid(256, SPACING)
GEL = FemGel(resolution_mm=0.6, dense_radius_mm=4.5)
FINE = FemGel(resolution_mm=0.4, dense_radius_mm=2.5)


def above_the_object() -> np.ndarray:
    """50 vertices with gaps of 0.02 to 0.3 mm, so most are within the barrier."""
    x, y = RANDOM.uniform(-3, 3, (2, 50))
    return LEANING.world(np.stack([x, y, FIELD(x, y) + RANDOM.uniform(0.02, 0.3, 50)], axis=1))


def moved(barrier: Barrier, q: np.ndarray) -> Barrier:
    """The barrier with its object moved along z and turned by q (12,), less its movement aside."""
    return replace(barrier, depth_mm=barrier.depth_mm + q[2], matrix=barrier.matrix + q[3:].reshape(3, 3))


def of_both(step: np.ndarray, at: np.ndarray) -> tuple[Barrier, np.ndarray]:
    """The barrier and the vertices after a step of both (50 * 3 + 12); aside, the gel moves the other way instead."""
    q = step[-12:]
    return moved(LEANING, q), at + step[:-12].reshape(-1, 3) - [q[0], q[1], 0]


def test_the_barrier_has_these_derivatives_by_the_gel_and_by_the_object() -> None:
    at = above_the_object()

    def value(step: np.ndarray) -> float:
        barrier, vertices = of_both(step, at)
        return barrier.value(vertices)

    def gradient(step: np.ndarray) -> np.ndarray:
        barrier, vertices = of_both(step, at)
        return np.concatenate([barrier.gradient(vertices).ravel(), gradient_by_object(barrier, vertices)])

    by_object, coupling = hessians_by_object(LEANING, at, project=False)
    nothing = np.zeros(162)
    for _ in range(5):
        direction = RANDOM.normal(0, 0.01, 162)
        dx, dq = direction[:-12].reshape(-1, 3), direction[-12:]
        assert gradient(nothing) @ direction == pytest.approx(slope(value, nothing, direction), rel=1e-6)
        of_gel = np.einsum("sij,sj->si", LEANING.hessian(at, project=False), dx) + coupling @ dq
        of_object = np.einsum("siq,si->q", coupling, dx) + by_object @ dq
        second = slope(gradient, nothing, direction)
        error = np.concatenate([of_gel.ravel(), of_object]) - second
        assert np.abs(error).max() < 1e-6 * np.abs(second).max()


def test_projected_the_barrier_is_convex_in_gel_and_object_together() -> None:
    at = above_the_object()
    for project in (True, False):
        of_gel = LEANING.hessian(at, project=project)
        by_object, coupling = hessians_by_object(LEANING, at, project=project)
        whole = np.zeros((162, 162))
        for vertex in range(50):
            rows = slice(3 * vertex, 3 * vertex + 3)
            whole[rows, rows] = of_gel[vertex]
            whole[rows, -12:], whole[-12:, rows] = coupling[vertex], coupling[vertex].T
        whole[-12:, -12:] = by_object
        assert (np.linalg.eigvalsh(whole)[0] > -1e-9 * np.abs(whole).max()) == project


def test_the_energy_of_the_object_has_these_derivatives() -> None:
    load = Load(30.0, tilts=True)
    q = np.concatenate([[0.0, 0.0, 0.4], MATRIX.ravel()])

    def value(q: np.ndarray) -> float:
        return load.value(q[2], q[3:].reshape(3, 3))

    def gradient(q: np.ndarray) -> np.ndarray:
        return load.gradient(q[3:].reshape(3, 3))

    direction = RANDOM.normal(0, 0.1, 12)
    assert gradient(q) @ direction == pytest.approx(slope(value, q, direction), rel=1e-6)
    error = load.hessian(MATRIX, project=False) @ direction - slope(gradient, q, direction)
    assert np.abs(error).max() < 1e-6 * np.abs(gradient(q)).max()
    assert np.linalg.eigvalsh(load.hessian(0.9 * np.eye(3), project=False))[0] < 0
    assert np.linalg.eigvalsh(load.hessian(0.9 * np.eye(3), project=True))[0] > -1e-9 * RIGIDITY


def test_a_rotation_costs_no_energy_and_gives_a_level_plane_its_slopes() -> None:
    matrix = rotation(np.array([0.1, -0.06]))
    assert Load(0.0).value(0.0, matrix) < 1e-20
    assert np.linalg.det(matrix) == pytest.approx(1)
    for along in (np.eye(3)[0], np.eye(3)[1]):
        turned = matrix @ along
        assert turned[2] == pytest.approx(turned[:2] @ [0.1, -0.06])
    assert tilt_rad(matrix) == pytest.approx(np.arctan(np.hypot(0.1, 0.06)))


def test_a_step_of_an_object_that_turns_is_followed_by_a_lift_out_of_it() -> None:
    for _ in range(20):
        at = above_the_object()
        step, q = RANDOM.normal(0, 0.2, at.shape), RANDOM.normal(0, 0.1, 12)
        after, lifted = moved(LEANING, q), at + step
        assert after.gap(lifted).min() < 0
        lifted[:, 2] += LEANING.lift(at, step, after)
        # The object's height field is curved, and a lift along z goes a little along it.
        assert after.gap(lifted).min() > -0.01


def test_a_lift_out_of_an_object_that_turns_changes_small_steps_by_terms_of_second_order() -> None:
    at, step, q = above_the_object(), RANDOM.normal(0, 1e-4, (50, 3)), RANDOM.normal(0, 1e-4, 12)
    whole, tenth = (np.abs(LEANING.lift(at, s * step, moved(LEANING, s * q))).max() for s in (1.0, 0.1))
    assert 0 < tenth < whole / 90


@cache
def press(name: str, force_n: float, at_mm: tuple[float, float] | None, depth_mm: float) -> FemPress:
    height = object_height(name, AT[None, :], AT[:, None])
    gel = FINE if name == "BALL" else GEL
    return gel.press(height, SPACING, depth_mm, GEOMETRY, load_n=force_n, free_at_mm=at_mm)


def off_centre() -> FemPress:
    return press("CYLINDER", 3.0, (0.5, 0.0), 0.3)


def centred() -> FemPress:
    return press("CYLINDER", 3.0, (0.0, 0.0), 0.3)


def test_the_gel_holds_the_load_where_it_acts() -> None:
    pressed = off_centre()
    solver = solver_of(GEL, GEOMETRY)
    surface = pressed.state.at[solver.mesh.surface]
    force = -pressed.barrier.gradient(surface)
    arm = pressed.barrier.local(surface) @ pressed.state.matrix.T - pressed.state.matrix @ pressed.barrier.pivot
    assert pressed.force_n == pytest.approx(3.0, rel=1e-3)
    assert force[:, 2].sum() * GEL.shear_modulus_mpa(GEOMETRY) == pytest.approx(3.0, rel=1e-3)
    # Moments about the load's point, over the load's about the object's middle.
    moments = np.cross(arm, force).sum(axis=0)[:2] / (force[:, 2].sum() * 0.5)
    assert np.abs(moments).max() < 1e-3
    assert np.abs(solver.gradient(pressed.state, Contact(pressed.barrier))[solver.mesh.free]).max() < 1e-3


def test_an_object_tilts_towards_a_load_beside_its_middle_and_not_under_one_in_it() -> None:
    towards_x = off_centre().barrier.world(np.array([[1.0, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0]]))[:, 2]
    assert towards_x[0] - towards_x[1] > 2 * np.sin(np.deg2rad(2))
    assert abs(towards_x[2] - towards_x[3]) < 0.02 * (towards_x[0] - towards_x[1])
    assert centred().tilt_rad < np.deg2rad(0.05)
    assert np.abs(centred().centre_mm[:2]).max() < 0.001


@pytest.mark.nightly
def test_a_ball_turns_until_the_load_acts_through_its_centre() -> None:
    # Without friction the gel presses a ball through its centre, so the load's point comes to lie above that.
    pressed = press("BALL", 0.5, (0.0, -0.2), 0.4)
    assert pressed.tilt_rad == pytest.approx(np.arctan(0.2 / 4.0), rel=0.01)
    centre = pressed.barrier.world(np.array([[0.0, 0.0, -4.0]]))[0]
    assert centre[:2] == pytest.approx([0.0, -0.2], abs=0.001)
    assert pressed.force_n == pytest.approx(0.5, rel=1e-3)


def test_the_object_stays_rigid() -> None:
    matrix = off_centre().state.matrix
    assert np.abs(matrix @ matrix.T - np.eye(3)).max() < 1e-4


def test_nothing_penetrates_or_inverts_at_any_step_of_an_object_that_tilts() -> None:
    assert len(off_centre().steps) > 5
    assert off_centre().min_gap_mm > 0
    assert off_centre().min_det_f > 0.3


@pytest.mark.parametrize(("force_n", "depth_mm"), [(0.2, 0.3), pytest.param(0.8, 0.6, marks=pytest.mark.nightly)])
def test_under_a_centred_load_a_free_ball_sinks_in_as_deep_as_a_guided_one(force_n: float, depth_mm: float) -> None:
    free, guided = press("BALL", force_n, (0.0, 0.0), depth_mm), press("BALL", force_n, None, depth_mm)
    assert free.depth_mm == pytest.approx(guided.depth_mm, rel=0.01)
    assert free.force_n == pytest.approx(guided.force_n, rel=1e-3)
    assert guided.tilt_rad == 0


def test_an_object_that_falls_over_is_refused_with_what_works() -> None:
    at = grid(128, 0.5)
    punch = object_height("CYLINDER", at[None, :], at[:, None])
    with pytest.raises(NotConverged, match="nearer to the middle"):
        lean_under(Load(45.0, (4.5, 0.0), tilts=True), punch, 0.5, 0.3, GEOMETRY)
    check_tilt(np.deg2rad(14.9))
    with pytest.raises(NotConverged, match="15 degrees or more"):
        check_tilt(np.deg2rad(15.1))


@pytest.mark.parametrize(
    ("force_n", "at_mm", "reason"),
    [(None, (0.0, 0.0), "needs a load"), (1.0, (30.0, 0.0), "within 12 mm"), (1.0, (float("nan"), 0.0), "within 12")],
)
def test_a_load_that_cannot_be_is_refused_with_what_works(
    force_n: float | None, at_mm: tuple[float, float], reason: str
) -> None:
    flat = np.zeros((256, 256))
    with pytest.raises(ValueError, match=reason):
        GEL.press(flat, SPACING, 0.3, GEOMETRY, load_n=force_n, free_at_mm=at_mm)
