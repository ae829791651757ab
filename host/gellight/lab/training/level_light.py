"""Presses as they would look if all of the gel lay at the depth of the gel at rest, for the network to learn from.

A ball shows gentle slopes in its middle, where it is deepest and nearest to the LEDs; the gel around a contact shows
the same slopes higher up. So a network that learns a ball as it looks reads that gel 2.5 % too flat. `led_light` has
the formula; `cast_shadows` takes the light of the felt depth off in the frame path.
"""

from dataclasses import replace
from math import inf

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
    cells = tuple(-(-size // CELL_PX) for size in table.image_size[::-1])
    light = LedLight.of(model, (cells[0], cells[1]))
    rows = table.rows.copy()
    place, slopes = rows[:, COLOURS : COLOURS + 2], rows[:, COLOURS + 2 :]
    x_mm, y_mm = ((place - (np.array(table.image_size) - 1) / 2) * pixel_size_mm).T
    column, row = place.astype(np.intp).T
    shares = light.shares[:, :, row // CELL_PX, column // CELL_PX]
    points = Points.seen_at(x_mm, y_mm, table.depth_mm, camera_height_mm or inf)
    lost = light.lost_by_depth(points, slopes, shares)
    rows[:, :COLOURS] = light.with_light(rows[:, :COLOURS], lost.T, untouched[row, column])
    return replace(table, rows=rows)
