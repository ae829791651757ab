"""Which places and which slopes the ball presses have shown, and what is missing most."""

from math import ceil

import numpy as np
from numpy.typing import NDArray

from gellight.lab.calibration.records import Coverage
from gellight.lab.training.presses import Ball, Press, contact_circle

ROWS, COLUMNS = 6, 8  # chosen: square cells in a picture of 4 : 3
WANTED = 1
"""presses that have to reach each place"""
DIRECTIONS = 8  # chosen: 45 degrees each
STEEPNESS_DEG = (0.0, 10.0, 20.0, 30.0, 40.0, 90.0)  # chosen: borders of the bands that are shown
STEEP_DEG = 25.0
"""a calibration that knows no steeper slopes is of little use: press deeper"""
_REACHED_SHARE = 0.3
"""of a cell has to be in contact for the press to count there"""


def coverage(presses: list[Press], ball: Ball, image_shape: tuple[int, int]) -> Coverage:
    """Count the presses; their contact circles are in pixels of (H, W) pictures."""
    places = np.zeros((ROWS, COLUMNS), np.int64)
    slopes = np.zeros((DIRECTIONS, len(STEEPNESS_DEG) - 1), np.int64)
    for press in presses:
        places += _cells(press, image_shape)
        slopes += _slopes(press, ball)
    steepest = max((press.contact_radius_px / ball.radius_px for press in presses), default=0.0)
    return Coverage(
        places=places.tolist(),
        slopes=slopes.tolist(),
        steepness_deg=STEEPNESS_DEG,
        steepest_deg=round(float(np.degrees(np.arcsin(min(steepest, 1.0)))), 1),
    )


def _cells(press: Press, image_shape: tuple[int, int]) -> NDArray[np.int64]:
    """(ROWS, COLUMNS) 1 where the contact fills enough of a cell."""
    contact = contact_circle(press, image_shape)
    rows, columns = np.indices(image_shape)
    row, column = rows * ROWS // image_shape[0], columns * COLUMNS // image_shape[1]
    counted = np.bincount((row * COLUMNS + column).ravel(), weights=contact.ravel(), minlength=ROWS * COLUMNS)
    cell_px = image_shape[0] * image_shape[1] / (ROWS * COLUMNS)
    # A small ball in a large cell counts in the cell that holds most of it.
    enough = min(_REACHED_SHARE * cell_px, 0.5 * max(counted.max(), 1))
    return np.asarray(counted >= enough, np.int64).reshape(ROWS, COLUMNS)


def _slopes(press: Press, ball: Ball) -> NDArray[np.int64]:
    """(DIRECTIONS, bands) pixels of the contact circle by the slope that the ball gives them."""
    reach = int(press.contact_radius_px)
    y, x = np.mgrid[-reach : reach + 1, -reach : reach + 1]
    distance = np.hypot(x, y)
    inside = distance < press.contact_radius_px
    steep = np.degrees(np.arcsin(np.minimum(distance[inside] / ball.radius_px, 1.0)))
    turn = np.arctan2(-y[inside], x[inside]) % (2 * np.pi)
    edges = [np.linspace(0, 2 * np.pi, DIRECTIONS + 1), np.array(STEEPNESS_DEG)]
    return np.asarray(np.histogram2d(turn, steep, bins=edges)[0], np.int64)


_SIDES: tuple[tuple[str, tuple[slice, slice]], ...] = (  # chosen: an edge is two cells wide
    ("on the left edge", (slice(None), slice(0, 2))),
    ("on the right edge", (slice(None), slice(COLUMNS - 2, COLUMNS))),
    ("on the top edge", (slice(0, 2), slice(2, COLUMNS - 2))),
    ("on the bottom edge", (slice(ROWS - 2, ROWS), slice(2, COLUMNS - 2))),
    ("in the middle", (slice(2, ROWS - 2), slice(2, COLUMNS - 2))),
)


def _missing(found: Coverage, presses: int) -> list[tuple[int, int, str]]:
    """Return how many more presses are needed, for how many empty places of the map, and where; most first."""
    places = np.array(found.places)
    cells_per_press = max(places.sum() / max(presses, 1), 1.0)
    lacking = {name: int(np.maximum(WANTED - places[cells], 0).sum()) for name, cells in _SIDES}
    return sorted(
        ((ceil(cells / cells_per_press), cells, name) for name, cells in lacking.items() if cells), reverse=True
    )


def advice(found: Coverage, presses: int, wanted: int, *, settled: bool) -> str:
    """Say what is missing most, or "enough".

    settled: the held-out error no longer falls. Enough is also what was asked for.
    """
    places = _missing(found, presses)
    if places and presses >= 3:
        count, cells, name = places[0]
        empty = f"{cells} place{'s are' if cells > 1 else ' is'} empty {name}"
        return f"{empty}: about {count} more press{'es' if count > 1 else ''}"
    if presses >= 3 and found.steepest_deg < STEEP_DEG:
        return f"press deeper: the steepest slope yet is {found.steepest_deg:.0f} degrees"
    if presses >= wanted or (settled and not places):
        return "enough"
    return f"{wanted - presses} more presses anywhere"
