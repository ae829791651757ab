"""The force of a ball on the gel, beside a formula: `python -m tests.benchmarks.gel_force`.

Dimitriadis, Horkay, Maresca, Kachar and Chadwick (Biophys. J. 82, 2002) give the force of a sphere of radius R on a
layer of thickness h that is bonded to its support, for small strains. With x = sqrt(R d) / h and Poisson's ratio v,

    F = 8 G sqrt(R) d^1.5 / (3 (1 - v)) * (1 - 2 a x / pi + 4 a^2 x^2 / pi^2 - 8 (a^3 + 4 pi^2 b / 15) x^3 / pi^3
        + 16 a (a^3 + 3 pi^2 b / 5) x^4 / pi^4)
    a = -(1.2876 - 1.4678 v + 1.3442 v^2) / (1 - v),  b = (0.6387 - 1.0277 v + 1.5164 v^2) / (1 - v)

Printed for the elastic layer, and for finite elements by the spacing of the surface and the layers of tetrahedra in the
depth of the gel, which are halved towards the surface; `FemGel` takes 2 or 3.
"""

import time
from dataclasses import replace
from math import pi, sqrt

import pytest

from sim_reference import gel
from sim_reference.deformation import grid
from sim_reference.fem import gel as fem_gel
from sim_reference.fem import mesh
from sim_reference.fem.gel import FemGel
from sim_reference.geometry import SensorGeometry
from sim_reference.objects import object_height

RADIUS_MM = 4.0
"""of BALL"""
SPACING_MM = 1 / 16
AT = grid(384, SPACING_MM)
BALL = object_height("BALL", AT[None, :], AT[:, None])
MODEL = FemGel(resolution_mm=0.4, dense_radius_mm=3.0)
GEOMETRY = replace(SensorGeometry(), gel_diameter_mm=28.0, coating_smoothing_mm=0.0)
DEPTH_MM, RATIOS = 0.4, (0.3, 0.49)
MESHES = ((3, 2), (3, 3), (6, 2))
"""layers, and how often they are halved"""


def formula(depth_mm: float, poisson: float, thickness_mm: float) -> float:
    """Return the force of a shear modulus of 1."""
    x = sqrt(RADIUS_MM * depth_mm) / thickness_mm
    a = -(1.2876 - 1.4678 * poisson + 1.3442 * poisson**2) / (1 - poisson)
    b = (0.6387 - 1.0277 * poisson + 1.5164 * poisson**2) / (1 - poisson)
    bonded = 1 - 2 * a * x / pi + 4 * (a * x / pi) ** 2 - 8 * (a**3 + 4 * pi**2 * b / 15) * (x / pi) ** 3
    bonded += 16 * a * (a**3 + 3 * pi**2 * b / 5) * (x / pi) ** 4
    return 8 / 3 / (1 - poisson) * sqrt(RADIUS_MM) * depth_mm**1.5 * bonded


def by_elements(geometry: SensorGeometry, layers: int, halvings: int) -> float:
    """Return the force by finite elements over the shear modulus."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(mesh, "divisions", lambda wanted: (layers, halvings))
        fem_gel._solver.cache_clear()
        pressed = MODEL.press(BALL, SPACING_MM, DEPTH_MM, geometry)
    fem_gel._solver.cache_clear()
    return pressed.force_n / MODEL.shear_modulus_mpa(geometry)


def main() -> None:
    """Print each force over that of the formula."""
    for poisson in RATIOS:
        geometry, begun = replace(GEOMETRY, poisson_ratio=poisson), time.process_time()
        expected = formula(DEPTH_MM, poisson, geometry.gel_thickness_mm)
        by_layer = gel.press(BALL, SPACING_MM, DEPTH_MM, geometry).pressure.sum() * SPACING_MM**2
        print(f"Poisson's ratio {poisson}, {DEPTH_MM} mm: over the formula's, the layer's {by_layer / expected:.3f}")
        for layers, halvings in MESHES:
            spacing_mm = geometry.gel_thickness_mm / layers / 2**halvings
            force = by_elements(geometry, layers, halvings)
            print(f"  finite elements, {spacing_mm:.2f} mm, {layers} layers: {force / expected:.3f}", flush=True)
        print(f"  {time.process_time() - begun:.0f} s of processor time")


if __name__ == "__main__":
    main()
