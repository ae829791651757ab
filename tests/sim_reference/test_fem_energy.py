"""The energies of the finite-element gel: derivatives against finite differences, and states that are known."""

from dataclasses import replace

import numpy as np
import pytest

from sim_reference.deformation import grid
from sim_reference.fem.assembly import Assembler
from sim_reference.fem.barrier import Barrier
from sim_reference.fem.friction import Friction, friction_of
from sim_reference.fem.height_field import HeightField
from sim_reference.fem.mesh import Mesh, gel_mesh
from sim_reference.fem.neo_hookean import NeoHookean
from sim_reference.geometry import SensorGeometry
from tests.helpers.derivatives import slope

SMALL = replace(SensorGeometry(), gel_diameter_mm=10.0)
MESH = gel_mesh(SMALL, 1.25, 2.0)
COUNT = len(MESH.vertices)
EVERY = np.arange(COUNT)


def deformed(mesh: Mesh, amount_mm: float, seed: int = 0) -> np.ndarray:
    """Vertices moved at random, far from the rest state but without inversion."""
    return mesh.vertices + np.random.default_rng(seed).normal(0, amount_mm, mesh.vertices.shape)


def hessian(energy: NeoHookean, at: np.ndarray, *, project: bool = False) -> np.ndarray:
    assembler = Assembler(EVERY, [energy.tets, energy.patch_vertices])
    shares = list(energy.hessians(at, project=project))
    return assembler.pattern.matrix(assembler.blocks(shares)).toarray()


@pytest.mark.parametrize("patches", [True, False])
@pytest.mark.parametrize("nu", [0.3, 0.49])
def test_the_elastic_energy_has_these_derivatives(nu: float, patches: bool) -> None:
    energy, at = NeoHookean(MESH, nu, patches=patches), deformed(MESH, 0.08)
    assert 0 < energy.strain(at).volume_ratio.min() < 0.8
    for seed in range(3):
        direction = np.random.default_rng(seed).normal(size=at.shape)
        first = slope(energy.value, at, direction)
        assert (energy.gradient(at) * direction).sum() == pytest.approx(first, rel=1e-6)
        second = slope(energy.gradient, at, direction).ravel()
        error = hessian(energy, at) @ direction.ravel() - second
        assert np.abs(error).max() < 1e-6 * np.abs(second).max()


def test_at_rest_however_it_is_turned_there_is_no_energy_and_no_force() -> None:
    turn, _ = np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))
    turn *= np.sign(np.linalg.det(turn))
    energy = NeoHookean(MESH, 0.49)
    for at, most in ((MESH.vertices, 1e-12), (MESH.vertices @ turn.T, 1e-11)):
        assert energy.value(at) == pytest.approx(0, abs=1e-9)
        assert np.abs(energy.gradient(at)).max() < most


def test_patch_test_a_uniform_strain_has_no_inner_forces() -> None:
    strain = np.array([[1.1, 0.05, -0.1], [0.02, 0.9, 0.03], [0.0, 0.08, 1.05]])
    faces = np.sort(np.concatenate([np.delete(MESH.tets, corner, axis=1) for corner in range(4)]), axis=1)
    unique, uses = np.unique(faces, axis=0, return_counts=True)
    inside = np.setdiff1d(np.unique(MESH.tets), unique[uses == 1])
    forces = NeoHookean(MESH, 0.49).gradient(MESH.vertices @ strain.T)
    assert len(inside) > 20
    assert np.abs(forces[inside]).max() < 1e-12 * np.abs(forces).max() * 100


def test_small_strains_are_those_of_linear_elasticity() -> None:
    # sigma = 2 mu e + lambda tr(e): W = mu e:e + lambda/2 tr(e)^2, in units of mu.
    e = 1e-4 * np.array([[1.0, 0.3, 0.2], [0.3, -0.5, 0.1], [0.2, 0.1, 0.8]])
    nu = 0.45
    energy = NeoHookean(MESH, nu)
    expected = energy.volume.sum() * ((e**2).sum() + nu / (1 - 2 * nu) * np.trace(e) ** 2)
    assert energy.value(MESH.vertices @ (np.eye(3) + e)) == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize("nu", [0.3, 0.49])
def test_the_projected_hessian_is_never_negative_and_only_ever_larger(nu: float) -> None:
    energy, at = NeoHookean(MESH, nu), deformed(MESH, 0.08)
    exact, projected = hessian(energy, at), hessian(energy, at, project=True)
    scale = np.abs(projected).max()
    assert np.linalg.eigvalsh(exact).min() < -1e-4 * scale
    assert np.linalg.eigvalsh(projected).min() > -1e-12 * scale
    assert np.linalg.eigvalsh(projected - exact).min() > -1e-12 * scale


def test_an_inverted_tetrahedron_costs_infinitely_much() -> None:
    at = MESH.vertices.copy()
    middle = MESH.surface[np.hypot(*MESH.vertices[MESH.surface, :2].T).argmin()]
    at[middle, 2] += 2 * MESH.thickness_mm
    assert NeoHookean(MESH, 0.3).value(at) == np.inf


@pytest.mark.parametrize("nu", [0.5, 0.6, -0.1, float("nan")])
def test_an_impossible_poisson_ratio_is_refused(nu: float) -> None:
    with pytest.raises(ValueError, match=r"0\.499"):
        NeoHookean(MESH, nu)


RANDOM = np.random.default_rng(1)
AT = grid(40, 0.2)
FIELD = HeightField(0.3 * np.sin(AT)[:, None] * np.cos(0.7 * AT)[None, :], 0.2)
BARRIER = Barrier(FIELD, RANDOM.uniform(0.5, 1.5, 50), 0.2, 5.0, 0.1)


def above_the_object() -> np.ndarray:
    """50 vertices with gaps of 0.02 to 0.3 mm, so most are within the barrier."""
    x, y = RANDOM.uniform(-3, 3, (2, 50))
    return np.stack([x, y, FIELD(x, y) + 0.1 + RANDOM.uniform(0.02, 0.3, 50)], axis=1)


def contact_energies() -> list[Barrier | Friction]:
    at = above_the_object()
    return [BARRIER, friction_of(BARRIER, at, at + RANDOM.normal(0, 0.02, at.shape), 0.4, 0.01)]


@pytest.mark.parametrize("energy", contact_energies(), ids=["barrier", "friction"])
def test_the_energies_of_contact_have_these_derivatives(energy: Barrier | Friction) -> None:
    at, direction = above_the_object(), RANDOM.normal(0, 0.01, (50, 3))
    assert (energy.gradient(at) * direction).sum() == pytest.approx(slope(energy.value, at, direction), rel=1e-6)
    second = slope(energy.gradient, at, direction)
    error = np.einsum("sij,sj->si", energy.hessian(at, project=False), direction) - second
    assert np.abs(error).max() < 1e-6 * np.abs(second).max()
    assert np.linalg.eigvalsh(energy.hessian(at, project=True)).min() > -1e-9


def raised(at: np.ndarray, by_mm: float) -> np.ndarray:
    return at + np.array([0, 0, by_mm])


def test_the_barrier_acts_within_its_distance_and_forbids_the_object() -> None:
    at = np.array([[0.0, 0.0, 0.1 + FIELD(np.zeros(1), np.zeros(1))[0]]])
    one = replace(BARRIER, area=np.ones(1))
    assert one.value(raised(at, 0.2)) == 0
    assert one.value(raised(at, 1e-3)) > one.value(raised(at, 1e-2)) > 0
    assert one.value(raised(at, -1e-3)) == np.inf


def test_a_step_into_the_object_is_lifted_out_of_it_and_others_are_not() -> None:
    at = above_the_object()
    for _ in range(20):
        step = RANDOM.normal(0, 0.5, at.shape)
        lifted = at + step
        lifted[:, 2] += BARRIER.lift(at, step)
        assert BARRIER.gap(lifted).min() > 0
        assert BARRIER.gap(at + step).min() < 0
    assert not BARRIER.lift(at, np.tile([0.0, 0.0, 5.0], (50, 1))).any()


def test_a_lift_changes_small_steps_by_terms_of_second_order() -> None:
    at, step = above_the_object(), RANDOM.normal(0, 1e-4, (50, 3))
    whole, tenth = np.abs(BARRIER.lift(at, step)).max(), np.abs(BARRIER.lift(at, step / 10)).max()
    assert 0 < tenth < whole / 90


def test_friction_pulls_back_with_its_share_of_the_normal_force() -> None:
    flat = Barrier(HeightField(np.zeros((9, 9)), 1.0), np.ones(1), 0.2, 5.0, 0.0)
    at = np.array([[0.0, 0.0, 0.1]])
    friction = friction_of(flat, at, at, 0.4, 0.01)
    assert friction.force == pytest.approx(-flat.gradient(at)[:, 2])
    assert friction.gradient(at + np.array([0.5, 0, 0]))[0] == pytest.approx([0.4 * friction.force[0], 0, 0])
    assert np.abs(friction.gradient(at)).max() == 0


def test_a_step_in_the_object_is_no_wider_than_its_grid_and_rings_nowhere() -> None:
    at = grid(41, 0.1)
    field = HeightField(np.where(at > 0, 1.0, 0.0)[None, :] * np.ones((41, 1)), 0.1)
    x = np.linspace(-1.8, 1.8, 500)
    height = field(x, np.zeros(500))
    assert height.min() == pytest.approx(0, abs=1e-12)
    assert height.max() == pytest.approx(1, abs=1e-12)
    assert height[x < -0.21].max() < 1e-9
    assert np.abs(np.gradient(height, x)).max() <= 1 / 0.1
