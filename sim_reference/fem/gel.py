"""The gel by finite elements, as a `deformation.GelModel`: an object's height map in, the gel's surface out.

A press starts from what the linear layer (`sim_reference.gel`) answers, so Newton's method begins near its end. The
barrier keeps a gap between gel and object; it is closed in two stages, the object held back by the mean gap, so the
gel's surface, not the object's, is at the depth that was asked for.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import RegularGridInterpolator

from sim_reference import gel
from sim_reference.deformation import Deformation, NotConverged, grid
from sim_reference.fem.barrier import Barrier
from sim_reference.fem.friction import friction_of
from sim_reference.fem.height_field import HeightField
from sim_reference.fem.mesh import Mesh, gel_mesh
from sim_reference.fem.neo_hookean import NeoHookean
from sim_reference.fem.newton import Contact, Solver, State, Step
from sim_reference.fem.sampling import Sampled, sample_surface
from sim_reference.geometry import SensorGeometry

Array = NDArray[np.float64]
DEEPEST_SHARE = 0.6
"""of the gel's thickness"""
BARRIER_DISTANCES_MM = (0.02, 0.005)
STIFFNESS = 3.0
"""of the barrier, in shear moduli per barrier distance: a few shear moduli of pressure leave half the distance"""
USUAL_GAP = 0.8
"""mean gap over barrier distance, before it is known"""
ABOVE_MM = 1.5
"""of a gel that bulges out: an object further behind the untouched surface than this is not there"""
STICK_MM = 0.001
"""friction holds within this"""
INCREMENT_MM = 0.25
"""of a press with friction, which depends on the way"""
MOST_LAGS = 20
"""how often friction is evaluated with the contact as it has become"""


@dataclass(frozen=True)
class FemPress:
    """A press as finite elements found it."""

    surface: Sampled
    """on the object's grid, not coated"""
    depth_mm: float
    """how far the object's highest point is beyond first touch"""
    force_n: float
    steps: list[Step] = field(repr=False)
    state: State = field(repr=False)
    barrier: Barrier = field(repr=False)
    """between the object, where it is, and the surface of the mesh"""

    @property
    def min_gap_mm(self) -> float:
        """The smallest gap of all steps."""
        return min(step.min_gap_mm for step in self.steps)

    @property
    def min_det_f(self) -> float:
        """The smallest volume of a tetrahedron over that at rest, of all steps."""
        return min(step.min_det_f for step in self.steps)


@dataclass(frozen=True, kw_only=True)
class FemGel:
    """Presses rigid objects into a Neo-Hookean gel; a `deformation.GelModel`."""

    resolution_mm: float = 0.3
    """between vertices of the surface; the nearest that the gel's thickness can be divided into"""
    dense_radius_mm: float = 17.5
    """of the region with this resolution"""
    friction: float = 0.0
    """coefficient between object and gel"""
    youngs_modulus_mpa: float = 0.2
    """soft silicone; it scales forces, the surface does not depend on it"""
    patches: bool = True
    """false: every tetrahedron keeps its own volume and the gel locks, to see by how much"""

    def __call__(
        self, object_height_mm: Array, spacing_mm: float, press_depth_mm: float, geometry: SensorGeometry
    ) -> Deformation:
        """Return the gel's surface, coated; see `deformation.GelModel`."""
        if press_depth_mm == 0:
            nothing = np.zeros_like(object_height_mm)
            return Deformation(nothing, nothing, spacing_mm)
        return coated(self.press(object_height_mm, spacing_mm, press_depth_mm, geometry), spacing_mm, geometry)

    def press(
        self,
        object_height_mm: Array,
        spacing_mm: float,
        press_depth_mm: float,
        geometry: SensorGeometry,
        *,
        load_n: float | None = None,
        on_step: Callable[[Step, State], None] | None = None,
    ) -> FemPress:
        """Press the object to a depth, or from there on let it sink in until the gel holds `load_n`.

        The object does not tilt. `on_step` is called after each of Newton's steps. Raises ValueError for a press
        outside 0 to 60 % of the gel's thickness, for a load with friction, and for what the mesh or the layer refuses,
        NotConverged where no solution was found.
        """
        check_depth(press_depth_mm, geometry)
        if load_n is not None and (self.friction or not load_n > 0):
            raise ValueError(f"load {load_n} N with friction {self.friction}: give a load above 0 N, without friction")
        solver = solver_of(self, geometry)
        field = HeightField(np.maximum(object_height_mm, -press_depth_mm - ABOVE_MM), spacing_mm)
        pressing = _Pressing(solver, field, self.friction, on_step)
        shear_modulus_mpa = self.youngs_modulus_mpa / 2 / (1 + geometry.poisson_ratio)
        bare = replace(geometry, coating_smoothing_mm=0.0)
        count = int(np.ceil(press_depth_mm / INCREMENT_MM)) if self.friction else 1
        for depth in np.linspace(0, press_depth_mm, count + 1)[1:].tolist():
            pressing.advance(depth, gel.press(object_height_mm, spacing_mm, depth, bare))
        pressing.close_gap(load=None if load_n is None else load_n / shear_modulus_mpa)
        barrier = pressing.barrier
        sampled = sample_surface(solver.mesh, pressing.state.at, barrier, len(object_height_mm), spacing_mm)
        force_n = sampled.force * shear_modulus_mpa
        return FemPress(sampled, pressing.depth_mm, force_n, pressing.steps, pressing.state, barrier)


class _Pressing:
    """A press under way: the state of the gel, and the steps so far."""

    def __init__(
        self, solver: Solver, field: HeightField, friction: float, on_step: Callable[[Step, State], None] | None
    ) -> None:
        self._solver, self._field, self._friction, self._on_step = solver, field, friction, on_step
        self._mesh = solver.mesh
        self.state = State(self._mesh.vertices, 0.0)
        self.steps: list[Step] = []
        self._gap_share = USUAL_GAP
        self._wanted_mm = 0.0
        self._layer = np.zeros(len(self._mesh.vertices))
        self._anchor = self.state.at[self._mesh.surface]
        self._distance_mm = BARRIER_DISTANCES_MM[0]

    @property
    def barrier(self) -> Barrier:
        """The barrier of the mesh's surface against the object where it is."""
        distance = self._distance_mm
        return Barrier(self._field, self._mesh.surface_area, distance, STIFFNESS / distance, self.state.depth_mm)

    @property
    def depth_mm(self) -> float:
        """How deep the gel is pressed: the object, and the mean gap between them, weighted with the force."""
        return self.state.depth_mm + self._gap_share * self._distance_mm

    def advance(self, depth_mm: float, layer: Deformation) -> None:
        """Press to `depth_mm`, beginning with the change of the linear layer since the last increment."""
        # A vertex that touches first now has gone straight to the object: only sideways movement is friction's.
        x, y, _ = self.state.at[self._mesh.surface].T
        self._anchor = np.column_stack([x, y, depth_mm + self._field(x, y)])
        above = depth_above(layer, self._mesh)
        at = self.state.at.copy()
        at[:, 2] += (above - self._layer) * (1 - self._mesh.vertices[:, 2] / self._mesh.thickness_mm)
        self._layer, self._wanted_mm = above, depth_mm
        self.state = State(at, depth_mm)
        self._settle(load=None)

    def close_gap(self, load: float | None) -> None:
        """Narrow the barrier; with `load`, let the object go and hold the load instead."""
        self._distance_mm = BARRIER_DISTANCES_MM[1]
        self._settle(load)

    def _settle(self, load: float | None) -> None:
        """Hold the object back by the gap, and find where the gel rests."""
        self.state = State(self.state.at, self._wanted_mm - self._gap_share * self._distance_mm)
        self.state = State(_cleared(self.state.at, self._mesh, self.barrier), self.state.depth_mm)
        self._solve(Contact(self.barrier, load=load))
        if self._friction:
            self._rub()
        force = self.barrier.area * self.barrier.pressure(self.state.at[self._mesh.surface])
        if force.any():
            gap = self.barrier.gap(self.state.at[self._mesh.surface])
            self._gap_share = float(force @ gap / force.sum()) / self._distance_mm

    def _rub(self) -> None:
        """Evaluate friction with the contact as it is, until that changes nothing."""
        for _ in range(MOST_LAGS):
            before = self.state.at[self._mesh.surface]
            friction = friction_of(self.barrier, before, self._anchor, self._friction, STICK_MM)
            self._solve(Contact(self.barrier, friction))
            moved = float(np.abs(self.state.at[self._mesh.surface] - before).max())
            if moved < STICK_MM:
                return
        raise NotConverged(
            f"friction still moves the gel by {moved:.1e} mm after {MOST_LAGS} evaluations: press less deep, or give a "
            "smaller coefficient"
        )

    def _solve(self, contact: Contact) -> None:
        self.state = self._solver.solve(self.state, contact, on_step=self._record)

    def _record(self, step: Step, state: State) -> None:
        self.steps.append(replace(step, number=len(self.steps) + 1))
        if self._on_step:
            self._on_step(self.steps[-1], state)


def check_depth(press_depth_mm: float, geometry: SensorGeometry) -> None:
    """Refuse a press that is no press, or deeper than a gel of tetrahedra can follow."""
    deepest = DEEPEST_SHARE * geometry.gel_thickness_mm
    if not 0 < press_depth_mm <= deepest:
        raise ValueError(
            f"press depth {press_depth_mm} mm: finite elements go from above 0 to {deepest:g} mm, 60 % of the gel's "
            f"thickness of {geometry.gel_thickness_mm:g} mm"
        )


def solver_of(model: FemGel, geometry: SensorGeometry) -> Solver:
    """Return the solver of this gel; the last two are kept, for presses share them."""
    shape = SensorGeometry(
        gel_thickness_mm=geometry.gel_thickness_mm,
        gel_diameter_mm=geometry.gel_diameter_mm,
        poisson_ratio=geometry.poisson_ratio,
    )
    return _solver(shape, model.resolution_mm, model.dense_radius_mm, model.patches)


@lru_cache(maxsize=2)
def _solver(geometry: SensorGeometry, resolution_mm: float, dense_radius_mm: float, patches: bool) -> Solver:
    mesh = gel_mesh(geometry, resolution_mm, dense_radius_mm)
    return Solver(mesh, NeoHookean(mesh, geometry.poisson_ratio, patches=patches))


def coated(press: FemPress, spacing_mm: float, geometry: SensorGeometry) -> Deformation:
    """Return the surface as the camera sees it, through the coating."""
    depth, pressure = press.surface.depth_mm, press.surface.pressure
    smoothing = gel.coating(len(depth), spacing_mm, geometry.coating_smoothing_mm)
    return Deformation(gel.deflection(depth, smoothing), pressure, spacing_mm)


def depth_above(layer: Deformation, mesh: Mesh) -> Array:
    """Return the layer's depth (N,) mm above each vertex of the mesh; 0 beyond the layer's grid."""
    at = grid(len(layer.depth_mm), layer.spacing_mm)
    depth = RegularGridInterpolator((at, at), layer.depth_mm, bounds_error=False, fill_value=0.0)
    return np.asarray(depth(mesh.vertices[:, 1::-1]))


def _cleared(at: Array, mesh: Mesh, barrier: Barrier) -> Array:
    """Return the vertices, those lifted to a third of the barrier that are inside the object, or all but."""
    at = at.copy()
    at[mesh.surface, 2] += np.maximum(0.3 * barrier.distance_mm - barrier.gap(at[mesh.surface]), 0)
    return at
