"""Which places and which slopes the ball presses have shown so far, and what is missing most."""

from dataclasses import dataclass
from math import ceil

import numpy as np
from numpy.typing import NDArray

from gellight.calibration.display import Picture
from gellight.calibration.records import CoverageFigures
from gellight.training.presses import Ball, Press, contact_circle

ROWS, COLUMNS = 6, 8
WANTED = 1
"""presses that have to reach each place"""
DIRECTIONS = 8
STEEPNESS_DEG = (0.0, 10.0, 20.0, 30.0, 40.0, 90.0)
STEEP_DEG = 25.0
"""a calibration that knows no steeper slopes is of little use: press deeper"""
_REACHED_SHARE = 0.3
"""of a cell has to be in contact for the press to count there"""


@dataclass(frozen=True, kw_only=True)
class Coverage:
    """Counts of presses by place, and of pixels by slope."""

    places: NDArray[np.int64]
    """(ROWS, COLUMNS) presses that reached each part of the view"""
    slopes: NDArray[np.int64]
    """(DIRECTIONS, bands of STEEPNESS_DEG) labelled pixels"""
    steepest_deg: float
    cells_per_press: float

    def figures(self) -> CoverageFigures:
        """Return the counts as they are kept."""
        return CoverageFigures(
            places=self.places.tolist(),
            slopes=self.slopes.tolist(),
            steepness_deg=STEEPNESS_DEG,
            steepest_deg=round(self.steepest_deg, 1),
        )


def coverage(presses: list[Press], ball: Ball, image_shape: tuple[int, int]) -> Coverage:
    """Count the presses; their contact circles are in pixels of (H, W) pictures."""
    places = np.zeros((ROWS, COLUMNS), np.int64)
    slopes = np.zeros((DIRECTIONS, len(STEEPNESS_DEG) - 1), np.int64)
    reached, steepest = 0, 0.0
    for press in presses:
        cells = _cells(press, image_shape)
        places += cells
        reached += int(cells.sum())
        slopes += _slopes(press, ball)
        steepest = max(steepest, float(np.degrees(np.arcsin(min(press.contact_radius_px / ball.radius_px, 1.0)))))
    return Coverage(
        places=places,
        slopes=slopes,
        steepest_deg=steepest,
        cells_per_press=max(reached / max(len(presses), 1), 1.0),
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


_SIDES: tuple[tuple[str, tuple[slice, slice]], ...] = (
    ("on the left edge", (slice(None), slice(0, 2))),
    ("on the right edge", (slice(None), slice(COLUMNS - 2, COLUMNS))),
    ("on the top edge", (slice(0, 2), slice(2, COLUMNS - 2))),
    ("on the bottom edge", (slice(ROWS - 2, ROWS), slice(2, COLUMNS - 2))),
    ("in the middle", (slice(2, ROWS - 2), slice(2, COLUMNS - 2))),
)


def missing(found: Coverage) -> list[tuple[int, str]]:
    """Return how many more presses are needed where, most first."""
    wanted = []
    for name, cells in _SIDES:
        lacking = int(np.maximum(WANTED - found.places[cells], 0).sum())
        if lacking:
            wanted.append((ceil(lacking / found.cells_per_press), name))
    return sorted(wanted, reverse=True)


def advice(found: Coverage, presses: int, wanted: int, *, settled: bool) -> str:
    """Say what is missing most, or "enough".

    settled: the held-out error no longer falls. Enough is also what was asked for.
    """
    places = missing(found)
    if places and presses >= 3:
        count, name = places[0]
        return f"{count} more press{'es' if count > 1 else ''} {name}"
    if presses >= 3 and found.steepest_deg < STEEP_DEG:
        return f"press deeper: the steepest slope so far is {found.steepest_deg:.0f} degrees"
    if presses >= wanted or (settled and not places):
        return "enough"
    return f"{wanted - presses} more presses anywhere"


def coverage_picture(found: Coverage, image_shape: tuple[int, int]) -> Picture:
    """Draw the counts of places, (H, W, 3): dark where nothing was pressed, green where enough was."""
    share = np.minimum(found.places / 3.0, 1.0)
    colours = np.stack([40 + 20 * share, 40 + 160 * share, 48 + 60 * share], axis=2).astype(np.uint8)
    rows = np.arange(image_shape[0]) * ROWS // image_shape[0]
    columns = np.arange(image_shape[1]) * COLUMNS // image_shape[1]
    return np.asarray(colours[rows[:, None], columns[None, :]])
