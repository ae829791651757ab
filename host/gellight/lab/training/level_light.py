"""What measured lights add to presses, for the network to learn from.

The presses are shown as they would look if all of the gel lay at the depth of the gel at rest (`at_rest_depth`).

A ball shows gentle slopes in its middle, where it is deepest and nearest to the LEDs; the gel around a contact shows
the same slopes higher up. So a network that learns a ball as it looks reads that gel 2.5 % too flat. `led_light` has
the formula; `cast_shadows` takes the light of the felt depth off in the frame path.

And the lights show slopes that no press had, all over the view (`with_lights`): `gelnet.lit` fits to the presses what
the gel shows otherwise. A press shows its steepest slopes in a few places only; learnt from presses alone, slopes of
balls 2 mm deep elsewhere are wrong by twice as much.
"""

from collections.abc import Mapping
from dataclasses import replace
from math import inf
from typing import NamedTuple

import numpy as np

from gellight.bundle.bundle import Bundle
from gellight.lab.training.presses import Floats
from gellight.lab.training.table import COLOURS, PressTable
from gellight.photometric.light_model import LightModel
from gellight.photometric.lights_file import read_lights
from gellight.photometric.solver import Points
from gellight.reconstruction.gelnet import CELL_PX
from gellight.reconstruction.led_light import LedLight
from gellight.watch.other_unit import UnitCheck

LIT_ROWS = 300_000
"""that the lights show, twice as many as 40 presses have; with half as many, balls 2 mm deep are .1 degrees worse"""
EVEN_SHARE, STEEPEST_RAD = 0.3, 1.1
"""of these rows, as many slope by any angle up to this one, the others by those of the presses"""


class TrainingData(NamedTuple):
    """What a network learns from."""

    table: PressTable
    like: PressTable | None = None
    """of a like unit"""
    lit: Mapping[str, Floats] | None = None
    """what the lights show, for `gelnet.lit`. "lit_rows": (M, 7) rows of a matt gel, at random places with random
    slopes; "lit", "like_lit": (N, 3) change of the colours of each row of a table, of such a gel"""


def lights_of_unit(bundle: Bundle, untouched: Floats) -> LightModel:
    """Return the light of the LEDs that an earlier bundle of a unit knows.

    untouched: (H, W, 3) picture of the gel of the unit at rest, grey levels. Raises BundleError where the bundle knows
    no LEDs, or is of pictures of another size or of another unit.
    """
    bundle.check_fits("the untouched gel", (untouched.shape[0], untouched.shape[1]))
    UnitCheck(bundle).refuse(np.clip(np.rint(untouched), 0, 255).astype(np.uint8))
    return read_lights(bundle)


def at_rest_depth(
    table: PressTable,
    model: LightModel,
    untouched: Floats,
    pixel_size_mm: tuple[float, float],
    camera_height_mm: float = 0.0,
) -> PressTable:
    """Return the table with the colours that its slopes have at the depth of the gel at rest.

    untouched: (H, W, 3) picture of the gel at rest, grey levels. camera_height_mm: as in the manifest. A table that
    does not know its depth stays as it is.
    """
    if table.depth_mm is None:
        return table
    light, rows = _light(model, table), table.rows.copy()
    slopes = rows[:, COLOURS + 2 :]
    points, shares, rest = _seen(light, rows, untouched, pixel_size_mm, table.depth_mm, camera_height_mm)
    lost = light.lost_by_depth(points, slopes, shares)
    rows[:, :COLOURS] = light.with_light(rows[:, :COLOURS], lost.T, rest)
    return replace(table, rows=rows)


def with_lights(
    table: PressTable,
    like: PressTable | None,
    model: LightModel | None,
    untouched: Floats,
    pixel_size_mm: tuple[float, float],
    camera_height_mm: float = 0.0,
) -> TrainingData:
    """Return both tables as `at_rest_depth` does, and what the lights show; as they are without lights or a depth."""
    if model is None or table.depth_mm is None:
        return TrainingData(table, like)
    seen = model, untouched, pixel_size_mm
    level, begun = at_rest_depth(table, *seen, camera_height_mm), like and at_rest_depth(like, *seen, camera_height_mm)
    return TrainingData(level, begun, _lit(level, begun, *seen))


def _lit(
    table: PressTable,
    like: PressTable | None,
    model: LightModel,
    untouched: Floats,
    pixel_size_mm: tuple[float, float],
) -> dict[str, Floats]:
    random, light = np.random.default_rng(0), _light(model, table)
    angle = np.arctan(np.hypot(*table.rows[:, COLOURS + 2 :].T))
    even = random.random(LIT_ROWS) < EVEN_SHARE
    angle = np.where(even, random.uniform(0, STEEPEST_RAD, LIT_ROWS), random.choice(angle[angle > 0], LIT_ROWS))
    along = random.uniform(0, 2 * np.pi, LIT_ROWS)
    rows = np.zeros((LIT_ROWS, COLOURS + 4), np.float32)
    rows[:, COLOURS : COLOURS + 2] = random.integers(0, table.image_size, (LIT_ROWS, 2))
    rows[:, COLOURS + 2 :] = (np.tan(angle) * (np.cos(along), np.sin(along))).T

    def colours(of: Floats) -> Floats:
        points, shares, rest = _seen(light, of, untouched, pixel_size_mm, np.zeros(len(of), np.float32))
        more = light.lit(points, of[:, COLOURS + 2 :], shares).T - 1
        return light.with_light(np.zeros_like(rest), more, rest)

    rows[:, :COLOURS] = colours(rows)
    return {"lit_rows": rows, "lit": colours(table.rows), **({"like_lit": colours(like.rows)} if like else {})}


def _light(model: LightModel, table: PressTable) -> LedLight:
    height, width = (-(-size // CELL_PX) for size in table.image_size[::-1])
    return LedLight.of(model, (height, width))


def _seen(
    light: LedLight, rows: Floats, untouched: Floats, pixel_size_mm: tuple[float, float], depth_mm: Floats,
    camera_height_mm: float = 0.0,
) -> tuple[Points, Floats, Floats]:  # fmt: skip
    """Return the points of rows, the share (K, 3, N) of each LED in their light at rest, and that light (N, 3)."""
    place = rows[:, COLOURS : COLOURS + 2]
    x_mm, y_mm = ((place - (np.array(untouched.shape[1::-1]) - 1) / 2) * pixel_size_mm).T
    column, row = place.astype(np.intp).T
    points = Points.seen_at(x_mm, y_mm, depth_mm, camera_height_mm or inf)
    return points, light.shares[:, :, row // CELL_PX, column // CELL_PX], untouched[row, column]
