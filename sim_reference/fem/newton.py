"""Projected Newton's method for the gel against an object: every iterate is free of penetration and inversion.

Each step solves a linear system by conjugate gradients, is cut to what no tetrahedron forbids, and then halved until
the energy falls. Vertices that it would move into the object are lifted out of it, each for itself
(`barrier.Barrier.lift`): if the whole step were cut instead, the first vertex that touches would stop all others.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from sim_reference.deformation import NotConverged
from sim_reference.fem.assembly import Assembler, Pattern
from sim_reference.fem.barrier import Barrier
from sim_reference.fem.friction import Friction
from sim_reference.fem.matrices import cofactors, inner
from sim_reference.fem.mesh import Mesh
from sim_reference.fem.multigrid import Hierarchy, conjugate_gradients
from sim_reference.fem.neo_hookean import NeoHookean

Array = NDArray[np.float64]
TOLERANCE_MM = 2e-5
"""Newton's method ends after a whole step that moves nothing by more"""
ROUNDING_MM = 1e-3 * TOLERANCE_MM
"""a step as short as this ends it even where it was cut: the energy's rounding hides whether it falls"""
MOST_STEPS = 300
"""of a stage: under relief that fills the view, the gel slips outwards from one wave to the next for a hundred steps"""
NEAR_MM = 0.03
"""after a full step shorter than this the Hessian is used as it is, not projected: convergence becomes quadratic"""


@dataclass(frozen=True)
class Step:
    """One step of Newton's method, as it is shown and recorded."""

    number: int
    energy: float
    """after the step, shear moduli times mm3"""
    longest_mm: float
    """how far the step would move the vertex that it moves furthest"""
    share: float
    """how much of the step was taken, above 1 where it was prolonged"""
    min_gap_mm: float
    min_det_f: float
    linear_iterations: int
    projected: bool


@dataclass(frozen=True, eq=False)
class State:
    """The gel's vertices, and where the object is, which the solver leaves as it is."""

    at: Array
    """(N, 3) mm"""
    depth_mm: float
    matrix: Array = field(default_factory=lambda: np.eye(3))
    """(3, 3) see `barrier.Barrier`"""
    shift_mm: Array = field(default_factory=lambda: np.zeros(2))
    """(2,) see `barrier.Barrier`"""

    def moved(self, step: "Change", share: float) -> "State":
        """Return the state after a share of a step."""
        return replace(self, at=self.at + share * step.direction)


@dataclass(frozen=True, eq=False)
class Change:
    """A step of the gel."""

    direction: Array
    """(N, 3) mm"""
    slope: float
    """how fast the energy falls along the step: below 0"""


@dataclass(frozen=True)
class Contact:
    """What acts on the free surface."""

    barrier: Barrier
    friction: Friction | None = None


class Solver:
    """Finds where the gel rests, for one mesh and one material."""

    def __init__(self, mesh: Mesh, elastic: NeoHookean) -> None:
        """Prepare what all presses share."""
        self.mesh, self.elastic = mesh, elastic
        numbers = np.full(len(mesh.vertices), -1)
        numbers[mesh.free] = np.arange(len(mesh.free))
        self._assembler = Assembler(numbers, [elastic.tets, elastic.patch_vertices])
        self._surface_rows = numbers[mesh.surface]
        self._hierarchy = Hierarchy(mesh, self._assembler.pattern)

    @property
    def pattern(self) -> Pattern:
        """Which blocks the matrix over the free vertices has."""
        return self._assembler.pattern

    def solve(
        self,
        state: State,
        contact: Contact,
        *,
        energy_share: float = 0.0,
        on_step: Callable[[Step, State], None] | None = None,
    ) -> State:
        """Return the state of least energy, from one without penetration and inversion.

        It ends after a whole step that moves nothing by more than TOLERANCE_MM, or that was to lower the energy by no
        more than this share of it. Raises NotConverged after MOST_STEPS.
        """
        energy, exact = self._energy(state, contact), False
        if not np.isfinite(energy):
            raise NotConverged("a stage begins with the gel inside out: press less deep, or give a finer resolution")
        for number in range(1, MOST_STEPS + 1):
            change, iterations, exact = self._change(state, contact, exact)
            longest = float(np.abs(change.direction).max())
            state, share, energy = self._descend(state, contact, change, energy)
            step = Step(number, energy, longest, share, self.min_gap(state, contact), self.min_det_f(state),
                        iterations, not exact)  # fmt: skip
            if on_step:
                on_step(step, state)
            if longest < ROUNDING_MM:
                return state
            if share >= 1 and (longest < TOLERANCE_MM or -change.slope / 2 < energy_share * energy):
                return state
            exact = share >= 1 and longest < NEAR_MM
        raise NotConverged(
            f"after {MOST_STEPS} steps the gel still moves by {longest:.1e} mm in a step, wanted {TOLERANCE_MM:.1e}: "
            "press less deep, or give a finer resolution"
        )

    def min_gap(self, state: State, contact: Contact) -> float:
        """Return the smallest gap in mm."""
        return float(_placed(contact.barrier, state).gap(state.at[self.mesh.surface]).min())

    def min_det_f(self, state: State) -> float:
        """Return the smallest volume of a tetrahedron over that at rest."""
        return float(self.elastic.strain(state.at).volume_ratio.min())

    def _energy(self, state: State, contact: Contact) -> float:
        surface = state.at[self.mesh.surface]
        energy = _placed(contact.barrier, state).value(surface)
        if not np.isfinite(energy):
            return np.inf
        if contact.friction:
            energy += contact.friction.value(surface)
        return energy + self.elastic.value(state.at)

    def gradient(self, state: State, contact: Contact) -> Array:
        """Return the derivative of the energy by the vertices (N, 3): 0 at rest, but where the gel is bonded."""
        total = self.elastic.gradient(state.at)
        surface = state.at[self.mesh.surface]
        total[self.mesh.surface] += _placed(contact.barrier, state).gradient(surface)
        if contact.friction:
            total[self.mesh.surface] += contact.friction.gradient(surface)
        return total

    def hessian_blocks(self, state: State, contact: Contact, *, project: bool) -> Array:
        """Return the blocks of the energy's second derivative over the free vertices."""
        blocks = self._assembler.blocks(list(self.elastic.hessians(state.at, project=project)))
        surface = state.at[self.mesh.surface]
        of_contact = _placed(contact.barrier, state).hessian(surface, project=project)
        if contact.friction:
            of_contact += contact.friction.hessian(surface, project=project)
        free = self._surface_rows >= 0
        blocks[self._assembler.pattern.diagonal[self._surface_rows[free]]] += of_contact[free]
        return blocks

    def _change(self, state: State, contact: Contact, exact: bool) -> tuple[Change, int, bool]:
        """Return Newton's step, the linear iterations, and whether the Hessian was exact."""
        blocks = self.hessian_blocks(state, contact, project=not exact)
        matrix = self._assembler.pattern.matrix(blocks)
        precondition = self._hierarchy.solver(blocks)
        gradient = self.gradient(state, contact)
        wanted = -gradient[self.mesh.free].ravel()
        found = conjugate_gradients(matrix, wanted, precondition, 1e-2)
        # Where the gel buckles, a direction of negative curvature is the way down.
        if exact and not found.convex and not float(wanted @ found.vector) > 0:
            return self._change(state, contact, exact=False)
        direction = np.zeros_like(state.at)
        direction[self.mesh.free] = found.vector.reshape(-1, 3)
        return Change(direction, float((gradient * direction).sum())), found.iterations, exact

    def _descend(self, state: State, contact: Contact, change: Change, energy: float) -> tuple[State, float, float]:
        """Halve a step until the energy falls by a ten-thousandth of what its slope promises; prolong it if it pays."""
        # Sums over a million terms are right to about this much; near the end the energy changes by less.
        rounding = 1e-13 * abs(energy)
        share = upright_share(self.elastic, state.at, change.direction)
        for _ in range(40):
            ahead = self._ahead(state, contact, change, share)
            reached = self._energy(ahead, contact)
            if reached <= energy + 1e-4 * share * change.slope + rounding:
                return self._go_further(state, contact, change, (ahead, share, reached), energy + 0.75 * change.slope)
            share /= 2
        raise NotConverged("no step lowers the energy: give a finer resolution or press less deep")

    def _go_further(
        self, state: State, contact: Contact, change: Change, best: tuple[State, float, float], low: float
    ) -> tuple[State, float, float]:
        """Double a whole step for as long as the energy falls, if with it the energy has already fallen below `low`.

        The projected Hessian is too stiff where the gel is close to buckling; then steps are many times too short.
        """
        while best[1] >= 1 and best[2] < low:
            ahead = self._ahead(state, contact, change, 2 * best[1])
            reached = self._energy(ahead, contact)
            if reached >= best[2]:
                break
            best = ahead, 2 * best[1], reached
        return best

    def _ahead(self, state: State, contact: Contact, change: Change, share: float) -> State:
        """Return the state after a share of a step, with no vertex of the surface in the object."""
        ahead, surface = state.moved(change, share), self.mesh.surface
        barrier = _placed(contact.barrier, state)
        ahead.at[surface, 2] += barrier.lift(state.at[surface], share * change.direction[surface])
        return ahead


def upright_share(elastic: NeoHookean, at: Array, step: Array) -> float:
    """Return a share of `step` (N, 3), at most 1, along which no tetrahedron's det F falls below a tenth of what it is.

    det(F + t G) is a cubic in t: its first root is looked for where the coefficients do not rule one out.
    """
    strain, change = elastic.strain(at), elastic.deformation(step)
    of_change = cofactors(change)
    linear, quadratic = inner(strain.cofactors, change), inner(of_change, strain.gradient)
    cubic = np.stack([(change[0] * of_change[0]).sum(axis=0), quadratic, linear, 0.9 * strain.volume_ratio])
    near = np.flatnonzero(np.minimum(cubic[:3], 0).sum(axis=0) + cubic[3] <= 0)
    if not len(near):
        return 1.0
    # 0 = a t^3 + b t^2 + c t + d; with s = 1/t: 0 = s^3 + (c s^2 + b s + a) / d, eigenvalues of its companion.
    companion = np.zeros((len(near), 3, 3))
    companion[:, 0] = (-cubic[2::-1, near] / cubic[3, near]).T
    companion[:, 1, 0] = companion[:, 2, 1] = 1
    roots = np.linalg.eigvals(companion)
    real = np.where(np.abs(roots.imag) < 1e-6 * (1 + np.abs(roots.real)), roots.real, 0)
    return float(min(1.0, 1 / max(real.max(), 1.0)))


def _placed(barrier: Barrier, state: State) -> Barrier:
    return replace(barrier, depth_mm=state.depth_mm, matrix=state.matrix, shift_mm=state.shift_mm)
