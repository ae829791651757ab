"""A press, then a path of rigid motions of the object along the gel: drag, twist, roll, with friction.

Each pose of the path is an increment of friction. A vertex sticks to a point of the object, its anchor, which the
object carries along. Where a vertex has slipped, the anchor follows it at the distance at which friction is full, so
that what a pose has stretched is kept in the next one (the return map of plasticity).
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from sim_reference import gel
from sim_reference.deformation import NotConverged
from sim_reference.fem.barrier import Barrier
from sim_reference.fem.gel import ABOVE_MM, INCREMENT_MM, FemGel, check_depth, field_of, solver_of
from sim_reference.fem.newton import Contact, State
from sim_reference.fem.pressing import STICK_MM, Checkpoint, OnStep, Pressing, cleared
from sim_reference.geometry import SensorGeometry

Array = NDArray[np.float64]
MOST_TILT_RAD = float(np.deg2rad(15))
"""of an object that is rolled"""


@dataclass(frozen=True)
class Pose:
    """Where the object is, from where the press has left it."""

    move_mm: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """along x, y and z; z goes deeper"""
    turn_rad: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """rotation vector about the object's highest point: the third is a twist, the others are rolls"""


@dataclass(frozen=True, eq=False)
class Dragged:
    """The gel at one pose."""

    pose: Pose
    force_n: Array
    """(3,) of the object on the gel"""
    torque_nmm: float
    """about z, at the object's highest point, from x towards y"""
    surface_mm: Array
    """(S, 3) the vertices of the surface"""
    moved_mm: Array
    """(S, 3) how far they have moved from rest"""
    touches: NDArray[np.bool_]
    """(S,)"""
    sticks: NDArray[np.bool_]
    """(S,) where friction is less than what it can be; nowhere without friction"""
    barrier: Barrier
    """between the object, where it is, and the surface of the mesh"""
    checkpoint: Checkpoint
    """what it takes to go on from here"""


class Dragging(Pressing):
    """A press under way that has reached its depth, and is dragged from there."""

    def carry(self, pose: Pose, depth_mm: float) -> None:
        """Bring the object, pressed `depth_mm` deep, to a pose, and find where the gel rests."""
        before, surface = self.barrier, self._mesh.surface
        at = self.state.at[surface]
        moved = replace(
            self.state,
            depth_mm=depth_mm - self.gap_mm + pose.move_mm[2],
            shift_mm=np.array(pose.move_mm[:2]),
            matrix=Rotation.from_rotvec(pose.turn_rad).as_matrix(),
        )
        self._move(moved)
        anchor = self.barrier.world(before.local(_anchored(before, at, self._now.anchor)))
        follows = self.barrier.world(before.local(at)) - at
        self._now = replace(self._now, anchor=anchor, state=self._following(moved, follows, before.gap(at)))
        if self._friction:
            self._rub()
        else:
            self._solve(Contact(self.barrier))
            self._now = replace(self._now, anchor=self.state.at[surface])

    def found(self, pose: Pose, modulus_mpa: float) -> Dragged:
        """Return the gel as it rests now."""
        force = self.force_on() * modulus_mpa
        surface = self.state.at[self._mesh.surface]
        arm = surface - self.barrier.world(np.zeros((1, 3)))
        torque = float((arm[:, 0] * force[:, 1] - arm[:, 1] * force[:, 0]).sum())
        moved = surface - self._mesh.vertices[self._mesh.surface]
        touches = self.barrier.gap(surface) < self.barrier.distance_mm
        slipped = np.linalg.norm(_slipped(self.barrier, surface, self._now.anchor), axis=1)
        sticks = touches & (slipped < STICK_MM) & (self._friction > 0)
        return Dragged(pose, force.sum(axis=0), torque, surface, moved, touches, sticks, self.barrier, self._now)

    def force_on(self) -> Array:
        """Return the force (S, 3) of the object on each vertex, shear moduli times mm2: the gel's own, at rest."""
        force = self._solver.elastic.gradient(self.state.at)
        free = np.zeros(len(force))
        free[self._mesh.free] = 1
        return np.asarray((force * free[:, None])[self._mesh.surface])

    def _following(self, state: State, follows: Array, gap: Array) -> State:
        """Return the state with the contact carried along, and the gel about it the less the further away it is."""
        surface, thickness = self._mesh.surface, self._mesh.thickness_mm
        touching = np.flatnonzero(gap < self.barrier.distance_mm)
        if not len(touching):
            raise NotConverged("the object no longer touches the gel: press deeper or shorten the path")
        points = self._mesh.vertices[surface, :2]
        distance, nearest = cKDTree(points[touching]).query(points)
        share = 1 / (1 + (distance / thickness) ** 2)
        step = (follows[touching[nearest]] * share[:, None])[self._mesh.above]
        at = state.at.copy()
        free = self._mesh.free
        fade = 1 - self._mesh.vertices[free, 2:] / thickness
        at[free] += step[free] * fade
        begun = replace(state, at=cleared(at, self._mesh, self.barrier))
        if self._solver.min_det_f(begun) < 0.1 * self._solver.min_det_f(self.state):
            raise NotConverged("a pose turns the gel inside out: give more poses between, or a finer resolution")
        return begun


def drag(
    model: FemGel,
    object_height_mm: Array,
    spacing_mm: float,
    press_depth_mm: float,
    path: list[Pose],
    geometry: SensorGeometry,
    *,
    on_step: OnStep | None = None,
    resume: Checkpoint | None = None,
) -> list[Dragged]:
    """Press the object to a depth, then take it along the path; return the gel at each pose.

    With `resume`, the checkpoint of an earlier pose, `path` holds what comes after it. Raises ValueError for a depth
    or a tilt that finite elements cannot follow, NotConverged where no solution was found.
    """
    check_depth(press_depth_mm, geometry)
    solver = solver_of(model, geometry)
    lowest = -press_depth_mm - ABOVE_MM - float(np.tan(MOST_TILT_RAD)) * geometry.gel_diameter_mm / 2
    field = field_of(object_height_mm, spacing_mm, lowest, solver.mesh.spacing_mm)
    bare = replace(geometry, coating_smoothing_mm=0.0)
    dragging = Dragging(solver, field, model.friction, on_step, resume)
    if resume is None:
        increment = INCREMENT_MM if model.friction else np.inf
        dragging.go_to(press_depth_mm, increment, lambda depth: gel.press(object_height_mm, spacing_mm, depth, bare))
        dragging.close_gap(press_depth_mm)
    modulus = model.shear_modulus_mpa(geometry)
    found = []
    for pose in path:
        if np.hypot(*pose.turn_rad[:2]) > MOST_TILT_RAD:
            raise ValueError(
                f"a pose rolls the object by more than {np.rad2deg(MOST_TILT_RAD):.0f} degrees: roll it less"
            )
        dragging.carry(pose, press_depth_mm)
        found.append(dragging.found(pose, modulus))
    return found


def _slipped(barrier: Barrier, at: Array, anchor: Array) -> Array:
    """Return how far (S, 3) mm vertices `at` have moved from their anchors along the object's surface."""
    normal = barrier.gap_gradient(at)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    slip = at - anchor
    return np.asarray(slip - (slip * normal).sum(axis=1, keepdims=True) * normal)


def _anchored(barrier: Barrier, at: Array, anchor: Array) -> Array:
    """Return the anchors (S, 3): within the distance of full friction of `at`, at `at` where nothing touches."""
    slip = _slipped(barrier, at, anchor)
    length = np.linalg.norm(slip, axis=1, keepdims=True)
    touching = barrier.gap(at)[:, None] < barrier.distance_mm
    return np.asarray(at - np.where(touching, slip * np.minimum(1, STICK_MM / np.maximum(length, 1e-12)), 0))
