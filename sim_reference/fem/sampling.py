"""The deformed surface of the mesh on a square grid: the vertices' depths, joined by smooth triangles."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CloughTocher2DInterpolator, LinearNDInterpolator
from scipy.spatial import Delaunay

from sim_reference.deformation import grid
from sim_reference.fem.barrier import Barrier
from sim_reference.fem.mesh import Mesh

Array = NDArray[np.float64]
RIM_SHARE = 0.9
"""of the gel's radius: beyond, the rim follows the tetrahedra, and the surface is continued instead"""


@dataclass(frozen=True, eq=False)
class Sampled:
    """The surface under a press on a grid of n points a side about the object's centre."""

    depth_mm: Array
    """(n, n) mm, positive into the sensor"""
    pressure: Array
    """(n, n) shear moduli, 0 outside the contact"""
    tangential_mm: Array
    """(n, n, 2) mm by which the gel that is here has moved along x and y"""
    force: float
    """sum over the contact, shear moduli times mm2"""


def sample_surface(mesh: Mesh, at: Array, barrier: Barrier, size: int, spacing_mm: float) -> Sampled:
    """Return the surface of the gel with its vertices `at` (N, 3) on a grid of `size` points a side.

    Beyond the rim of the gel the depth at the rim goes on and fades over one thickness, so that no edge is seen where
    a press is shown off the centre.
    """
    surface = at[mesh.surface]
    pressure = barrier.pressure(surface)
    points = grid(size, spacing_mm)
    x, y = np.meshgrid(points, points)
    rim = RIM_SHARE * float(mesh.vertices[mesh.surface, 0].max())
    beyond = np.hypot(x, y) / rim
    inside = np.stack([x, y], axis=2) / np.maximum(beyond, 1)[..., None]
    faded = np.exp(-np.maximum(beyond - 1, 0) * rim / mesh.thickness_mm)
    triangles = Delaunay(surface[:, :2])
    moved = np.column_stack([surface[:, 2], surface[:, :2] - mesh.vertices[mesh.surface, :2]])
    smooth = CloughTocher2DInterpolator(triangles, moved)(inside) * faded[..., None]
    # The contact ends halfway between a vertex that touches and one that does not; the pressure is scaled to the force.
    linear = LinearNDInterpolator(triangles, np.column_stack([pressure, pressure > 0]))(inside)
    spread = np.where((linear[..., 1] > 0.5) & (beyond <= 1), linear[..., 0], 0.0)
    force = float(barrier.area @ pressure)
    total = float(spread.sum()) * spacing_mm**2
    return Sampled(
        depth_mm=smooth[..., 0],
        pressure=spread * (force / total if total else 0.0),
        tangential_mm=smooth[..., 1:],
        force=force,
    )
