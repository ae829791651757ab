"""Depth by labels that are too wide, and by the light's radius: `python -m tests.benchmarks.radius [RESPONSE]`.

Layer presses are photographed through the measured light of a real sensor (`measured_response`). Twelve presses of a
ball of 4 mm are learnt from, with circles 14 % wider than the contact and centres a pixel off, as hands draw them;
eight presses of two other balls and four of two other shapes judge. A polynomial takes the place of the network,
because its fit is exact. The true surface says where the gel is at rest.
"""

import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gellight.lab.report.pictures import write_png
from gellight.lab.training.baselines import fit_polynomial
from gellight.lab.training.labelling.refinement import Refined, refine
from gellight.lab.training.presses import Press
from gellight.lab.training.table import PressTable, TableOptions, build_table
from gellight.lab.training.training import HAND_DRAWN, Reference, read_reference
from gellight.reconstruction.integration import integrate
from gellight.reconstruction.light_drift import difference_of
from gellight.reconstruction.smoothing import Smoother
from sim_reference.objects import ObjectParameters
from sim_reference.surface import Surface, press_object, sample
from tests.benchmarks.measured_response import BALL, GEOMETRY, NAMES, REACH_MM, MeasuredResponse

TOO_WIDE = 1.14
DEPTHS_MM = (0.25, 0.5, 0.75, 1.0)
BALLS_MM = (2.5, 7.0)
SHAPES = ("TSTEP", "SCROWN")
SHAPE_DEPTHS_MM = (0.3, 0.6)
SHAPES_AT_MM = (0.5, -0.4)


@dataclass(frozen=True, kw_only=True, eq=False)
class World:
    """One sensor: what is learnt from, and what judges."""

    reference: Reference
    presses: list[Press]
    """with circles that are too wide"""
    surfaces: list[Surface]
    """of these presses"""
    true_radii_px: list[float]
    judges: dict[str, list[tuple[Surface, NDArray[np.uint8]]]]
    """surface and picture of each press, by what is pressed"""


def world(response: MeasuredResponse, place: Path, random: np.random.Generator) -> World:
    """Press, and photograph."""
    for number in range(4):
        write_png(place / f"untouched-{number}.png", response.photograph(None, random))
    balls = [press_object("BALL", depth, GEOMETRY) for depth in (0.5, 1.0, 1.6)]
    presses, surfaces, radii = [], [], []
    for number in range(12):
        x, y = random.uniform(-1, 1, 2) * REACH_MM
        surface = sample(balls[number % 3], GEOMETRY, x, y)
        write_png(place / f"press-{number:02}.png", response.photograph(surface, random))
        surfaces.append(surface)
        radii.append(float(np.sqrt(surface.contact.sum() / np.pi)))
        press = Press(
            image=place / f"press-{number:02}.png",
            center_x_px=x / BALL.pixel_size_mm + (GEOMETRY.image_width_px - 1) / 2 + random.normal(),
            center_y_px=y / BALL.pixel_size_mm + (GEOMETRY.image_height_px - 1) / 2 + random.normal(),
            contact_radius_px=min(TOO_WIDE * radii[-1], 0.97 * BALL.radius_px),
        )
        presses.append(press)
    return World(
        reference=read_reference(f"{place}/untouched-*.png"),
        presses=presses,
        surfaces=surfaces,
        true_radii_px=radii,
        judges=_judges(response, random),
    )


def _judges(
    response: MeasuredResponse, random: np.random.Generator
) -> dict[str, list[tuple[Surface, NDArray[np.uint8]]]]:
    things = [(f"ball {radius:g} mm", "BALL", ObjectParameters(calibration_ball_radius_mm=radius), DEPTHS_MM)
              for radius in BALLS_MM]  # fmt: skip
    things += [(name, name, ObjectParameters(region_diameter_mm=8.0), SHAPE_DEPTHS_MM) for name in SHAPES]
    found: dict[str, list[tuple[Surface, NDArray[np.uint8]]]] = {}
    for label, name, parameters, depths in things:
        for depth in depths:
            x, y = random.uniform(-0.3, 0.3, 2) * REACH_MM if name == "BALL" else SHAPES_AT_MM
            surface = sample(press_object(name, depth, GEOMETRY, parameters=parameters), GEOMETRY, float(x), float(y))
            found.setdefault(label, []).append((surface, response.photograph(surface, random)))
    return found


def with_true_slopes(of: World, table: PressTable) -> PressTable:
    """Return a table whose slopes are those of the surface: no label can be better."""
    rows = table.rows.copy()
    for number, surface in enumerate(of.surfaces):
        mine = table.image == number
        columns, lines = rows[mine, 3:5].astype(int).T
        rows[mine, 5:] = surface.gradient_map[lines, columns]
    return replace(table, rows=rows)


def judged(of: World, table: PressTable) -> dict[str, tuple[float, float, float, float]]:
    """Return by what is pressed: depth over truth, slope of the one against the other, mean and largest error, mm.

    Depth is that of the deepest place; errors are means over the contact of a press.
    """
    reference, smoother = of.reference.image, Smoother()
    polynomial = fit_polynomial(table)
    figures = {}
    for label, seen in of.judges.items():
        felt, right, errors = [], [], []
        for surface, image in seen:
            slopes, _ = smoother.prefilter(polynomial.gradient_map(difference_of(image, reference, follow_light=False)))
            depth = integrate(slopes, BALL.pixel_size_mm, at_rest=surface.depth_mm < 0.005)
            felt.append(float(depth.max()))
            right.append(float(surface.depth_mm.max()))
            errors.append(float(np.abs(depth - surface.depth_mm)[surface.contact].mean()))
        ratio = float(np.mean(np.divide(felt, right)))
        figures[label] = ratio, float(np.polyfit(right, felt, 1)[0]), float(np.mean(errors)), max(errors)
    return figures


def ways(of: World) -> tuple[Refined, dict[str, PressTable]]:
    """Return the refined circles, and the table that is learnt from in each way."""

    def table(presses: Sequence[Press], options: TableOptions) -> PressTable:
        return build_table(presses, of.reference.image, BALL, options)

    refined = refine(of.presses, of.reference.image, BALL)
    as_wide = [replace(press, contact_radius_px=press.contact_radius_px / refined.radius_share)
               for press in refined.presses]  # fmt: skip
    tables = {
        "as they are, every pixel": table(of.presses, TableOptions()),
        "as they are, a quarter of the rim": table(of.presses, HAND_DRAWN),
        "refined, mean radius of the labels": table(as_wide, TableOptions()),
        "refined, radius of the light": table(refined.presses, HAND_DRAWN),
    }
    return refined, {**tables, "the same, with true slopes": with_true_slopes(of, table(refined.presses, HAND_DRAWN))}


def main() -> None:
    """Print the table of each response named, or of all."""
    for name in sys.argv[1:] or NAMES:
        with tempfile.TemporaryDirectory() as place:
            of = world(MeasuredResponse.read(name), Path(place), np.random.default_rng(0))
            refined, tried = ways(of)
            shares = np.divide([press.contact_radius_px for press in refined.presses], of.true_radii_px)
            print(f"\n{name}: radius of the light over the true one {shares.mean():.3f} +- {shares.std():.3f}")
            print("depth over truth, slope, mean error mm, largest: " + "; ".join(of.judges))
            for way, table in tried.items():
                figures = judged(of, table).values()
                text = "; ".join(f"{a:.3f} {b:.3f} {c:.4f} {d:.4f}" for a, b, c, d in figures)
                print(f"{way:36}{text}", flush=True)


if __name__ == "__main__":
    main()
