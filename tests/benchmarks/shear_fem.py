"""Forces along the gel that dots tell, by drags of the finite-element gel: `python -m tests.benchmarks.shear_fem`.

The gel of `tests.benchmarks.shear` is the layer by which forces are found; here it is Neo-Hookean, of large strain, and
has friction. Three balls are pressed without friction and then dragged with it, some of them twisted, each in one step.
A lattice of dots lies beside each contact as chance has it, and each dot is known to 0.01 mm. Depth is that of the
surface; what pictures leave of it, and perspective, is in `tests.benchmarks.shear`. Young's modulus is from one press.
"""

import sys
import time
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CloughTocher2DInterpolator

from gellight.frames.shear import DotsSeen, Shear
from gellight.reconstruction.force import ForceScale, Layer, indenting
from gellight.reconstruction.shear.felt import Gel, ShearScale, felt_shear
from sim_reference.deformation import NotConverged, grid
from sim_reference.fem.dragging import Dragged, Pose, drag
from sim_reference.fem.gel import FemGel
from sim_reference.geometry import SensorGeometry
from tests.benchmarks.shear import DRAGS

Array = NDArray[np.float64]
GEOMETRY = replace(SensorGeometry(), coating_smoothing_mm=0.0)
GEL, FRICTION, MESH_MM = FemGel(dense_radius_mm=4.0), 0.8, 5 / 16
SPACING_MM = 0.125
AT = grid(320, SPACING_MM)
PRESSES = ((4.0, 0.6), (2.5, 0.6), (7.0, 0.6), (4.0, 1.0), (2.5, 0.8), (7.0, 0.9))
"""radius and depth, mm"""
WEIGHED = 3
"""whose force gives Young's modulus"""
SHAPE, PIXEL_MM = (120, 160), 0.2352
PITCH_MM, COLUMNS, ROWS = 2.0, 9, 7
NOISE_MM = 0.01
MIDDLE_PX = (np.array(SHAPE[::-1]) - 1) / 2


def ball(radius_mm: float) -> Array:
    """Return the upper side of a ball, mm."""
    return np.sqrt(np.maximum(radius_mm**2 - AT[None, :] ** 2 - AT[:, None] ** 2, 0)) - radius_mm


def drags(press: tuple[float, float], random: np.random.Generator) -> Iterator[Dragged]:
    """Yield the press, then its drags; every other one turns too."""
    height, depth = ball(press[0]), press[1]
    start = drag(GEL, height, SPACING_MM, depth, [Pose()], GEOMETRY)[0]
    yield start
    for number in range(DRAGS // len(PRESSES)):
        length, angle, turn = random.uniform(0.1, 0.6), random.uniform(0, 2 * np.pi), random.uniform(-0.15, 0.15)
        pose = Pose((length * np.cos(angle), length * np.sin(angle), 0.0), (0.0, 0.0, turn * (number % 2)))
        rough = replace(GEL, friction=FRICTION)
        try:
            yield drag(rough, height, SPACING_MM, depth, [pose], GEOMETRY, resume=start.checkpoint)[0]
        except NotConverged as error:
            print(f"ball of {press[0]} mm, {pose}: {error}", flush=True)


def depth_map(surface_mm: Array) -> NDArray[np.float32]:
    """Return the depth on the pixels of the picture, mm, of the points (S, 3) of a surface."""
    x, y = ((np.arange(size) - (size - 1) / 2) * PIXEL_MM for size in SHAPE[::-1])
    surface = CloughTocher2DInterpolator(surface_mm[:, :2], surface_mm[:, 2], fill_value=0.0)
    return np.asarray(surface(x[None, :], y[:, None]), np.float32)


def felt(surface_mm: Array, moved_mm: Array, modulus_mpa: float, random: np.random.Generator) -> Shear:
    """Return what dots tell of a surface (S, 3) whose points moved by (S, 3)."""
    lattice = np.meshgrid(np.arange(COLUMNS) - COLUMNS // 2, np.arange(ROWS) - ROWS // 2)
    rest = PITCH_MM * (np.stack(lattice, axis=-1).reshape(-1, 2) + random.uniform(-0.5, 0.5, 2))
    of_gel = CloughTocher2DInterpolator((surface_mm - moved_mm)[:, :2], moved_mm[:, :2])
    now = rest + of_gel(rest) + random.normal(0, NOISE_MM, rest.shape)
    seen = DotsSeen(
        rest_px=rest / PIXEL_MM + MIDDLE_PX, places_px=now / PIXEL_MM + MIDDLE_PX, reasons=np.zeros(len(rest), np.uint8)
    )
    gel = Gel(pixel_size_mm=(PIXEL_MM, PIXEL_MM), camera_height_mm=None, to_gel=lambda px: (px - MIDDLE_PX) * PIXEL_MM)
    layer = Layer(GEOMETRY.gel_thickness_mm, GEOMETRY.poisson_ratio)
    depth = depth_map(surface_mm)
    force = ForceScale(
        layer=layer, youngs_modulus_mpa=modulus_mpa, error_share=0.05, error_floor_n=0.0, heaviest_n=np.inf
    ).force(depth, (PIXEL_MM, PIXEL_MM))
    scale = ShearScale(layer=layer, youngs_modulus_mpa=modulus_mpa, side_scale=1.0, side_error_share=0.2)
    return felt_shear(seen, depth, force, gel, scale)


def main() -> None:
    """Print each drag, then force and torque of all."""
    random, begun = np.random.default_rng(int(sys.argv[1]) if len(sys.argv) > 1 else 11), time.process_time()
    found = [list(drags(press, random)) for press in PRESSES]
    weighed = found[WEIGHED][0]
    layer = Layer(GEOMETRY.gel_thickness_mm, GEOMETRY.poisson_ratio)
    modulus = weighed.force_n[2] / indenting(depth_map(weighed.surface_mm), (PIXEL_MM, PIXEL_MM), layer).integral_mm2
    print(f"{time.process_time() - begun:.0f} s of processor time; Young's modulus {modulus:.4f} MPa")
    told = [
        _judged(press, one, felt(one.surface_mm, one.moved_mm, modulus, random))
        for press, (_, *dragged) in zip(PRESSES, found, strict=True)
        for one in dragged
    ]
    along = np.array([share for share, _, _ in told])
    for name, each in (
        ("force", [np.hypot(1 - share, aside) for share, aside, _ in told]),
        (
            "the same by the constant of the median drag",
            np.hypot(1 - along / np.median(along), [a for _, a, _ in told]),
        ),
        ("torque", [torque for _, _, torque in told]),
    ):
        median, tail = np.percentile(each, (50, 90))
        print(f"{name}: off by {100 * median:.1f} %, p90 {100 * tail:.1f} % of {len(told)} drags")


def _judged(press: tuple[float, float], one: Dragged, shear: Shear) -> tuple[float, float, float]:
    """Return the felt force along the true one and across it, and how far the torque is off, as shares; print them."""
    assert shear.force_n is not None, shear.unknown
    truth, (x, y) = one.force_n[:2], shear.force_n
    whole = float(np.hypot(*truth))
    along, aside = (x * truth[0] + y * truth[1]) / whole**2, (y * truth[0] - x * truth[1]) / whole**2
    # As in `tests.benchmarks.shear`: a quarter of the radius of the contact, within which a torque is none.
    arm = 0.25 * np.sqrt(one.touches.sum() * MESH_MM**2 / np.pi)
    torque = abs(shear.torque_nmm - one.torque_nmm) / max(abs(one.torque_nmm), arm * whole)
    print(
        f"ball of {press[0]} mm, {press[1]} deep, dragged by {np.hypot(*one.pose.move_mm[:2]):.2f} mm, turned by "
        f"{one.pose.turn_rad[2]:+.2f}, {one.sticks.sum() / one.touches.sum():.0%} stick: {whole:.3f} N, felt along it "
        f"{along:.3f}, across {aside:+.3f}; torque {one.torque_nmm:+.3f}, {shear.torque_nmm:+.3f} N mm",
        flush=True,
    )
    return float(along), float(aside), float(torque)


if __name__ == "__main__":
    main()
