"""The view of a gel that is seen from the side, from a square grid on it: pins, or marker dots of known pitch."""

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import InputError
from gellight.frames.view import View
from gellight.lab.optics.lens.lattice import find_lattice
from gellight.lab.optics.lens.pins import find_pins, spots

LEAST_POINTS = 9
_LARGEST_MISS = 0.15
"""of the spacing: a grid whose points lie farther from where the view puts them is no square grid, or was misread"""


def view_of_grid(image: NDArray[np.uint8], spacing_px: float, pitch_mm: float, pixel_size_mm: float) -> View:
    """Return the view in which the grid in a (H, W, 3) picture is square, with half a pitch around it.

    spacing_px: of two neighbours in the picture, roughly. Raises InputError where no grid is found.
    """
    lattices = [
        find_lattice(points)
        for contrast in spots(image.astype(np.float32), spacing_px)
        if len(points := find_pins(contrast, spacing_px)) >= LEAST_POINTS
    ]
    lattice = max(lattices, key=lambda found: len(found.points), default=None)
    if lattice is None or len(lattice.points) < LEAST_POINTS or np.ptp(lattice.places, axis=0).min() < 2:
        raise InputError(
            f"no grid of at least 3 x 3 points, about {spacing_px:g} px apart, was found: give their distance in px, "
            "or the four corners of the view"
        )
    wide = pitch_mm / pixel_size_mm
    first = lattice.places.min(axis=0)
    wanted = (lattice.places - first + 0.5) * wide - 0.5
    columns, rows = (np.ptp(lattice.places, axis=0) + 1).tolist()
    shape = (round(rows * wide), round(columns * wide))
    view = View.of_points(lattice.points, wanted, (image.shape[0], image.shape[1]), shape)
    miss = float(np.sqrt(((view.places(lattice.points) - wanted) ** 2).sum(axis=1).mean()))
    if miss > _LARGEST_MISS * wide:
        raise InputError(
            f"the {len(lattice.points)} points found miss a square grid by {miss:.1f} px: give the distance of "
            "neighbours in px more exactly, or the four corners of the view"
        )
    return view
