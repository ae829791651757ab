"""Marker dots on a gel that is pressed and dragged: where its camera sees them."""

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates

from gellight.lab.simulator.printed_dots import PrintedDots, seen_px
from gellight_touch.layer import Floats
from sim_reference.geometry import SensorGeometry


def dots_px(
    dots: PrintedDots, depth_mm: Floats, tangential_mm: Floats, at_mm: NDArray[np.float64], geometry: SensorGeometry
) -> NDArray[np.float64]:
    """Return (N, 2) x, y px of the dots that have not come off.

    depth_mm (n, n) and tangential_mm (n, n, 2) are the gel's on a grid with coordinates `at_mm` (n,); beside the grid
    it rests.
    """
    places = dots.places_mm[dots.printed]
    moved = np.stack([_sampled(tangential_mm[..., axis], places, at_mm) for axis in (0, 1)], axis=1)
    now = places + moved
    return seen_px(now, _sampled(depth_mm, now, at_mm), geometry)


def _sampled(values: Floats, places_mm: NDArray[np.float64], at_mm: NDArray[np.float64]) -> NDArray[np.float64]:
    """(N,) values (n, n) at places x, y, linear between the points of the grid."""
    rows_columns = (places_mm[:, ::-1].T - at_mm[0]) / (at_mm[1] - at_mm[0])
    return np.asarray(map_coordinates(np.asarray(values, np.float64), rows_columns, order=1))
