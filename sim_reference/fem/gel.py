"""The gel by finite elements, as a `deformation.GelModel`: an object's height map in, the gel's surface out."""

from dataclasses import dataclass, field, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from sim_reference import gel
from sim_reference.deformation import Deformation, NotConverged
from sim_reference.fem.barrier import Barrier
from sim_reference.fem.height_field import HeightField, with_slopes_below
from sim_reference.fem.mesh import gel_mesh
from sim_reference.fem.neo_hookean import NeoHookean
from sim_reference.fem.newton import Solver, State, Step
from sim_reference.fem.pressing import OnStep, Pressing
from sim_reference.fem.sampling import Sampled, sample_surface
from sim_reference.geometry import SensorGeometry

Array = NDArray[np.float64]
INCREMENT_MM = 0.25
"""of a press with friction, which depends on the way"""
STEEPEST_MM = 1.0
"""rise of the object from one vertex to the next: the mesh cannot follow steeper walls, which get a foot"""
LOAD_SHARE, MOST_PRESSES = 0.005, 8
"""how near to a load is near enough, and presses that are tried"""
ABOVE_MM = 1.5
"""of a gel that bulges out: an object further behind the untouched surface than this is not there"""


@dataclass(frozen=True, eq=False)
class FemPress:
    """A press as finite elements found it."""

    surface: Sampled
    """on the object's grid, not coated"""
    depth_mm: float
    """of the object's highest point beyond first touch; the gap is accounted for"""
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
        on_step: OnStep | None = None,
    ) -> FemPress:
        """Press the object to a depth; `on_step` is called after each of Newton's steps.

        Raises ValueError for a press outside 0 to 60 % of the gel's thickness and for what the mesh or the layer
        refuses, NotConverged where no solution was found.
        """
        check_depth(press_depth_mm, geometry)
        solver, bare = solver_of(self, geometry), replace(geometry, coating_smoothing_mm=0.0)
        field = field_of(object_height_mm, spacing_mm, -press_depth_mm - ABOVE_MM, solver.mesh.spacing_mm)
        pressing = Pressing(solver, field, self.friction, on_step)
        pressing.go_to(
            press_depth_mm,
            INCREMENT_MM if self.friction else np.inf,
            lambda depth: gel.press(object_height_mm, spacing_mm, depth, bare),
        )
        pressing.close_gap(press_depth_mm)
        barrier = pressing.barrier
        sampled = sample_surface(solver.mesh, pressing.state.at, barrier, len(object_height_mm), spacing_mm)
        force_n = sampled.force * self.shear_modulus_mpa(geometry)
        depth_mm = pressing.state.depth_mm + pressing.gap_mm
        return FemPress(sampled, depth_mm, force_n, pressing.steps, pressing.state, barrier)

    def press_under(
        self,
        load_n: float,
        object_height_mm: Array,
        spacing_mm: float,
        geometry: SensorGeometry,
        *,
        on_step: OnStep | None = None,
    ) -> FemPress:
        """Press until the gel holds the load, to half a percent: two or three presses, the first as the layer has it.

        Between presses the force is taken for a power of the depth, 1.5 at first (Hertz). Raises as `press`, and
        ValueError for a load that is not above 0, or presses too deep.
        """
        depth, power = depth_under(load_n, object_height_mm, spacing_mm, self, geometry), 1.5
        before: tuple[float, float] | None = None
        for _ in range(MOST_PRESSES):
            pressed = self.press(object_height_mm, spacing_mm, depth, geometry, on_step=on_step)
            if abs(pressed.force_n / load_n - 1) < LOAD_SHARE:
                return pressed
            if before:
                power = float(np.log(pressed.force_n / before[1]) / np.log(depth / before[0]))
            before = depth, pressed.force_n
            depth *= (load_n / pressed.force_n) ** (1 / power)
        raise NotConverged(f"{MOST_PRESSES} presses did not find how deep {load_n:g} N press: give a depth")

    def shear_modulus_mpa(self, geometry: SensorGeometry) -> float:
        """Of the gel."""
        return self.youngs_modulus_mpa / 2 / (1 + geometry.poisson_ratio)


def field_of(object_height_mm: Array, spacing_mm: float, lowest_mm: float, mesh_spacing_mm: float) -> HeightField:
    """Return the object as the mesh can follow it, cut off at `lowest_mm`."""
    limit = STEEPEST_MM / mesh_spacing_mm
    return HeightField(with_slopes_below(np.maximum(object_height_mm, lowest_mm), spacing_mm, limit), spacing_mm)


def check_depth(press_depth_mm: float, geometry: SensorGeometry) -> None:
    """Refuse a press that is no press, or deeper than a gel of tetrahedra can follow."""
    deepest = geometry.deepest_press_mm
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


def depth_under(
    load_n: float,
    object_height_mm: Array,
    spacing_mm: float,
    model: FemGel,
    geometry: SensorGeometry,
    *,
    tolerance: float = 0.02,
) -> float:
    """Return how deep a load presses the object into the linear layer, mm, to a share of `tolerance`.

    Finite elements begin there. Raises ValueError for a load that is not above 0, or presses deeper than finite
    elements can follow.
    """

    def held_n(depth: float) -> float:
        pressed = gel.press(object_height_mm, spacing_mm, depth, geometry)
        return float(pressed.pressure.sum()) * spacing_mm**2 * model.shear_modulus_mpa(geometry)

    deepest = geometry.deepest_press_mm
    most = held_n(deepest)
    if not 0 < load_n <= most:
        raise ValueError(f"load {load_n} N: give above 0 to {most:.3g} N, which presses 60 % of the gel's thickness")
    return float(brentq(lambda depth: held_n(depth) - load_n, 0.0, deepest, rtol=tolerance))
