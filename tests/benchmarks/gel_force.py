"""The force of a ball on the gel, judged by another method: `python -m tests.benchmarks.gel_force`.

The judge is `tests.helpers.rings`: the same Neo-Hookean gel by other elements, whose forces do not change by a
thousandth with their size. Beside it stands a formula for small strains: Dimitriadis, Horkay, Maresca, Kachar and
Chadwick (Biophys. J. 82, 2002) give the force of a sphere of radius R on a layer of thickness h that is bonded to its
support. With x = sqrt(R d) / h and Poisson's ratio v,

    F = 8 G sqrt(R) d^1.5 / (3 (1 - v)) * (1 - 2 a x / pi + 4 a^2 x^2 / pi^2 - 8 (a^3 + 4 pi^2 b / 15) x^3 / pi^3
        + 16 a (a^3 + 3 pi^2 b / 5) x^4 / pi^4)
    a = -(1.2876 - 1.4678 v + 1.3442 v^2) / (1 - v),  b = (0.6387 - 1.0277 v + 1.5164 v^2) / (1 - v)

A ball ten times as large, pressed a tenth as deep, touches as much and strains a tenth: there the rings agree with the
formula, and what is left at 0.4 mm is large strain.
"""

import time
from dataclasses import replace
from math import pi, sqrt

from sim_reference import gel
from sim_reference.deformation import grid
from sim_reference.fem.gel import FemGel
from sim_reference.geometry import SensorGeometry
from sim_reference.objects import object_height
from tests.helpers.rings import force_of_ball

RADIUS_MM = 4.0
"""of BALL"""
SPACING_MM = 1 / 16
AT = grid(384, SPACING_MM)
BALL = object_height("BALL", AT[None, :], AT[:, None])
MODEL = FemGel(dense_radius_mm=6.0)
GEOMETRY = replace(SensorGeometry(), coating_smoothing_mm=0.0)
DEPTHS_MM, RATIOS = (0.4, 1.0), (0.3, 0.49)
RESOLUTIONS_MM = (0.6, 0.4, 0.3, 0.2)


def formula(ball_mm: float, depth_mm: float, poisson: float, thickness_mm: float) -> float:
    """Return the force of a shear modulus of 1."""
    x = sqrt(ball_mm * depth_mm) / thickness_mm
    a = -(1.2876 - 1.4678 * poisson + 1.3442 * poisson**2) / (1 - poisson)
    b = (0.6387 - 1.0277 * poisson + 1.5164 * poisson**2) / (1 - poisson)
    bonded = 1 - 2 * a * x / pi + 4 * (a * x / pi) ** 2 - 8 * (a**3 + 4 * pi**2 * b / 15) * (x / pi) ** 3
    bonded += 16 * a * (a**3 + 3 * pi**2 * b / 5) * (x / pi) ** 4
    return 8 / 3 / (1 - poisson) * sqrt(ball_mm) * depth_mm**1.5 * bonded


def main() -> None:
    """Print each force over that of the rings."""
    for poisson in RATIOS:
        geometry, thickness = replace(GEOMETRY, poisson_ratio=poisson), GEOMETRY.gel_thickness_mm
        small = 10 * RADIUS_MM, DEPTHS_MM[0] / 10
        share = formula(*small, poisson, thickness) / force_of_ball(*small, poisson, thickness)
        print(f"Poisson's ratio {poisson}, small strain: the formula's force over that of the rings {share:.3f}")
        for depth in DEPTHS_MM:
            truth = force_of_ball(RADIUS_MM, depth, poisson, thickness)
            by_layer = gel.press(BALL, SPACING_MM, depth, geometry).pressure.sum() * SPACING_MM**2
            print(f"{depth} mm: formula {formula(RADIUS_MM, depth, poisson, thickness) / truth:.3f}, "
                  f"layer {by_layer / truth:.3f}; finite elements:")  # fmt: skip
            for resolution in RESOLUTIONS_MM:
                begun = time.process_time()
                force = replace(MODEL, resolution_mm=resolution).press(BALL, SPACING_MM, depth, geometry).surface.force
                print(f"  {resolution} mm: {force / truth:.3f}, {time.process_time() - begun:.0f} s", flush=True)


if __name__ == "__main__":
    main()
