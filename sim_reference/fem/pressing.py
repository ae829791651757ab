"""One press from its beginning to its end, in increments and stages that Newton's method solves one after the other.

An increment starts with what the linear layer (`sim_reference.gel`) answers: Newton's method begins near its end. The
barrier keeps a gap between gel and object. It is narrowed from one stage to the next, and the object is held back by
the mean gap, so that the gel's surface, not the object's, is at the depth that was asked for.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import RegularGridInterpolator

from sim_reference.deformation import Deformation, NotConverged, grid
from sim_reference.fem.barrier import LEAST_UPRIGHT, Barrier
from sim_reference.fem.friction import friction_of
from sim_reference.fem.height_field import HeightField
from sim_reference.fem.mesh import Mesh
from sim_reference.fem.newton import Contact, Solver, State, Step

Array = NDArray[np.float64]
BARRIER_DISTANCES_MM = (0.02, 0.005)
"""of the barrier: in every increment, and at the end"""
STIFFNESS = 3.0
"""of the barrier, in shear moduli per barrier distance: a few shear moduli of pressure leave half the distance"""
USUAL_GAP = 0.8
"""mean gap over barrier distance, before it is known"""
STICK_MM = 0.001
"""friction holds within this"""
LEAST_INCREMENT_MM = 0.001
BEGINNING_SHARE = 1e-3
"""of the energy: what only begins the next stage ends with a step that lowers it by no more"""
MOST_LIFTS = 50
"""how often the gel is lifted out of an object that is turned"""
MOST_LAGS = 20
"""how often friction is evaluated with the contact as it has become"""


@dataclass(frozen=True, eq=False)
class Checkpoint:
    """A press after one of its stages: what it takes to go on from there."""

    state: State
    increment_mm: float
    """depth at the end of the increment under way, 0 before the first"""
    narrow: bool
    """all increments are done, and the gap is being closed"""
    gap_share: float
    """mean gap over barrier distance at the end of the last stage"""
    anchor: Array
    """(S, 3) where the surface would be had it stuck to the object in this increment"""
    layer_mm: Array
    """(N,) depth of the linear layer above each vertex in this increment"""


OnStep = Callable[[Step], None]


class Pressing:
    """A press under way: the state of the gel, and the steps so far."""

    def __init__(
        self,
        solver: Solver,
        field: HeightField,
        friction: float,
        on_step: OnStep | None,
        resume: Checkpoint | None = None,
    ) -> None:
        """Start with the gel at rest, or go on from `resume`."""
        self._solver, self._field, self._friction, self._on_step = solver, field, friction, on_step
        self._mesh = solver.mesh
        at = self._mesh.vertices
        at_rest = Checkpoint(State(at, 0.0), 0.0, False, USUAL_GAP, at[self._mesh.surface], np.zeros(len(at)))
        self._now = resume or at_rest
        self.steps: list[Step] = []

    @property
    def state(self) -> State:
        """The gel as it is."""
        return self._now.state

    @property
    def barrier(self) -> Barrier:
        """The barrier of the mesh's surface against the object where it is."""
        area, state, distance = self._mesh.surface_area, self.state, BARRIER_DISTANCES_MM[self._now.narrow]
        at = (state.depth_mm, state.matrix, state.shift_mm)
        return Barrier(self._field, area, distance, STIFFNESS / distance, *at)

    @property
    def gap_mm(self) -> float:
        """Mean gap between gel and object, weighted with the force."""
        return self._now.gap_share * self.barrier.distance_mm

    def go_to(self, depth_mm: float, increment_mm: float, layer: Callable[[float], Deformation]) -> None:
        """Press to `depth_mm` in increments of at most `increment_mm`, beginning each with the layer's change in it.

        An increment that would turn a tetrahedron inside out is halved. Raises NotConverged where none is small enough.
        """
        while (reached := self._now.increment_mm) < depth_mm:
            count = max(1.0, np.ceil((depth_mm - reached) / increment_mm - 1e-9))
            ahead = depth_mm if count == 1 else reached + (depth_mm - reached) / count
            while (begun := self._begun(ahead, layer)) is None:
                ahead = (reached + ahead) / 2
                if ahead - reached < LEAST_INCREMENT_MM:
                    raise NotConverged(
                        f"at {reached:.3f} mm the gel turns inside out: press less deep, or give a finer resolution"
                    )
            self._now = begun
            self._settle(begun.increment_mm)

    def _begun(self, depth_mm: float, layer: Callable[[float], Deformation]) -> Checkpoint | None:
        """Return an increment's first state, None if it has tetrahedra inside out, or all but."""
        above = depth_above(layer(depth_mm), self._mesh)
        at = self.state.at.copy()
        at[:, 2] += (above - self._now.layer_mm) * (1 - self._mesh.vertices[:, 2] / self._mesh.thickness_mm)
        object_mm = depth_mm - self.gap_mm
        at = cleared(at, self._mesh, replace(self.barrier, depth_mm=object_mm))
        before = self._solver.min_det_f(self.state)
        begun = replace(self.state, at=at, depth_mm=object_mm)
        if self._solver.min_det_f(begun) < 0.1 * before:
            return None
        # A vertex that touches first now has gone straight to the object: friction is for sideways movement.
        x, y, _ = self.state.at[self._mesh.surface].T
        anchor = np.column_stack([x, y, depth_mm + self._field(x, y)])
        return replace(self._now, state=begun, increment_mm=depth_mm, anchor=anchor, layer_mm=above)

    def close_gap(self, depth_mm: float) -> None:
        """Narrow the barrier and the gaps within it by moving object and gel: every pressure stays what it is."""
        before, wide = self.state, self.barrier
        self._now = replace(self._now, narrow=True)
        share = self.barrier.distance_mm / wide.distance_mm
        surface = before.at[self._mesh.surface]
        gap, upright = wide.gap(surface), np.maximum(wide.gap_gradient(surface)[:, 2], LEAST_UPRIGHT)
        forward = self._now.gap_share * (1 - share) * wide.distance_mm
        at = before.at.copy()
        moved = np.where(gap < wide.distance_mm, forward - (1 - share) * gap / upright, 0)
        at[:, 2] += moved[self._mesh.above] * (1 - self._mesh.vertices[:, 2] / self._mesh.thickness_mm)
        self._move(replace(before, at=at, depth_mm=before.depth_mm + forward))
        self._settle(depth_mm)

    def _settle(self, depth_mm: float) -> None:
        """Hold the object back by the gap, and find where the gel rests."""
        self._move(replace(self.state, depth_mm=depth_mm - self.gap_mm))
        self._move(replace(self.state, at=cleared(self.state.at, self._mesh, self.barrier)))
        # What is friction or the last stage is built upon this; else it is where the next stage begins.
        exact = self._now.narrow or self._friction
        self._solve(Contact(self.barrier), 0.0 if exact else BEGINNING_SHARE)
        if self._friction:
            self._rub()
        surface = self.state.at[self._mesh.surface]
        if not self._friction:
            # Friction that begins after this finds nothing that pulls.
            self._now = replace(self._now, anchor=surface)
        force = self.barrier.area * self.barrier.pressure(surface)
        if force.any():
            gap = float(force @ self.barrier.gap(surface) / force.sum())
            self._now = replace(self._now, gap_share=gap / self.barrier.distance_mm)

    def _rub(self) -> None:
        """Evaluate friction with the contact as it is, until that changes nothing."""
        for _ in range(MOST_LAGS):
            before = self.state.at[self._mesh.surface]
            friction = friction_of(self.barrier, before, self._now.anchor, self._friction, STICK_MM)
            self._solve(Contact(self.barrier, friction))
            moved = float(np.abs(self.state.at[self._mesh.surface] - before).max())
            if moved < STICK_MM:
                return
        raise NotConverged(
            f"friction still moves the gel by {moved:.1e} mm after {MOST_LAGS} evaluations: press less deep, or give a "
            "smaller coefficient"
        )

    def _solve(self, contact: Contact, energy_share: float = 0.0) -> None:
        self._move(self._solver.solve(self.state, contact, energy_share=energy_share, on_step=self._record))

    def _move(self, state: State) -> None:
        self._now = replace(self._now, state=state)

    def _record(self, step: Step, state: State) -> None:
        self._move(state)
        self.steps.append(replace(step, number=len(self.steps) + 1))
        if self._on_step:
            self._on_step(self.steps[-1])


def depth_above(layer: Deformation, mesh: Mesh) -> Array:
    """Return the layer's depth (N,) mm above each vertex of the mesh; 0 beyond the layer's grid."""
    at = grid(len(layer.depth_mm), layer.spacing_mm)
    depth = RegularGridInterpolator((at, at), layer.depth_mm, bounds_error=False, fill_value=0.0)
    return np.asarray(depth(mesh.vertices[:, 1::-1]))


def cleared(at: Array, mesh: Mesh, barrier: Barrier) -> Array:
    """Return the vertices, with the gel lifted where its surface is inside the object, or all but.

    What lies below goes along, less the deeper it is: a surface that is lifted alone turns tetrahedra inside out.
    """
    at, fade = at.copy(), 1 - mesh.vertices[:, 2] / mesh.thickness_mm
    wanted = 0.3 * barrier.distance_mm
    # Once is enough under an object that is not turned.
    for _ in range(MOST_LIFTS):
        lift = np.maximum(wanted - barrier.gap(at[mesh.surface]), 0)
        at[:, 2] += lift[mesh.above] * fade
        if lift.max() < 0.5 * wanted:
            return at
    raise NotConverged("the turned object hangs over the gel beside it: turn it less in each pose")
