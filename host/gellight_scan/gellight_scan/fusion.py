"""All presses as one map of heights.

Each press is laid on the grid of the part where its gel reached it, and levelled (see levelling.py). Then heights are
averaged, by their stated errors and less towards the border of a press.

A press is bent by a little, and all presses of a sensor alike; laid beside each other, those that are bent to a
paraboloid bend the map by as much everywhere, and nothing in them tells that from a bent part. So a flat part is taken
to be flat as a whole: the plane and the paraboloid that most of it lies on are taken off.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates

from gellight_scan.contact_view import BASE_MM, ContactView
from gellight_scan.height_map import HeightMap
from gellight_scan.levelling import OUTLIER, Laid, levelled, overlaps
from gellight_scan.tracking.rigid import carried, inverse

Array = NDArray[np.float64]
Floats = NDArray[np.float32]
FADES_MM = 2.0
"""towards the border of a press its weight goes down to nothing"""
LOOKS = 4
"""steps in which the height above a point of the grid is found"""
FORM_PX, FORM_ROUNDS = 50_000, 20
"""pixels that the form of a map is found by, and rounds in which letters on a plate lose their weight"""


@dataclass(frozen=True, eq=False)
class Fused:
    """A map, and how well its presses agree."""

    height_map: HeightMap
    seen: NDArray[np.bool_]
    """(H, W) where any press was; what was seen and not reached lies too deep"""
    seam_mm: float
    """rms difference of two presses where both reached the part; NaN where none overlap"""
    origin_mm: tuple[float, float]
    """x and y of the first pixel, in the axes of the first press"""

    @property
    def size_mm(self) -> tuple[float, float]:
        """Width and height of the map."""
        height, width = self.seen.shape
        return width * self.height_map.pixel_mm, height * self.height_map.pixel_mm

    @property
    def reached(self) -> float:
        """Share of what was seen that the gel reached."""
        return float(self.height_map.reached.sum() / max(self.seen.sum(), 1))


@dataclass(frozen=True, eq=False)
class Grid:
    """The pixels of a map."""

    x_mm: Array
    y_mm: Array

    @classmethod
    def around(cls, views: Mapping[int, ContactView], poses: Mapping[int, Array], pixel_mm: float) -> "Grid":
        """Return the grid that holds every press."""
        corners = np.concatenate([carried(poses[number], corners_mm(view)) for number, view in views.items()])
        (x, y), (far_x, far_y) = corners[:, :2].min(axis=0), corners[:, :2].max(axis=0)
        return cls(np.arange(x, far_x, pixel_mm), np.arange(y, far_y, pixel_mm))

    def window(self, corners: Array) -> tuple[slice, slice]:
        """Return the rows and columns between corners (4, 3)."""
        ends = [
            np.searchsorted(at, (corners[:, axis].min(), corners[:, axis].max()))
            for at, axis in ((self.y_mm, 1), (self.x_mm, 0))
        ]
        return slice(*map(int, ends[0])), slice(*map(int, ends[1]))


def corners_mm(view: ContactView) -> Array:
    """Return the (4, 3) corners of a press, around its view."""
    width, height = view.size_mm
    return np.array([[x * width / 2, y * height / 2, 0] for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))])


def fuse(views: Mapping[int, ContactView], poses: Mapping[int, Array], *, curved: bool = False) -> Fused:
    """Return the map of presses at poses (4, 4), both by number.

    curved: take off only the plane, and keep what may be the sensor's own bend.
    """
    pixel_mm = next(iter(views.values())).pixel_size_mm[0]
    grid = Grid.around(views, poses, pixel_mm)
    laid = levelled(grid.x_mm, grid.y_mm, [_lay(view, poses[number], grid) for number, view in views.items()])
    total, weight, error, spread, count = (np.zeros((len(grid.y_mm), len(grid.x_mm))) for _ in range(5))
    seen = np.zeros(total.shape, np.bool_)
    for one in laid:
        at = one.rows, one.columns
        seen[at] |= one.fade > 0
        known = np.isfinite(one.height_mm) & (one.fade > 0)
        w = np.where(known, one.fade / one.error_mm**2, 0.0)
        height = np.where(known, one.height_mm, 0.0)
        for plane, value in ((total, height), (weight, 1.0), (error, one.error_mm**2), (spread, height**2)):
            plane[at] += w * value
        count[at] += known
    with np.errstate(invalid="ignore", divide="ignore"):
        height = total / weight
        # The bend of a peak is misjudged alike in every press; the rest is not.
        variance = error / weight - BASE_MM**2 * (1 - 1 / count) + np.maximum(spread / weight - height**2, 0)
    height -= _form(height, grid, curved=curved)
    known = weight > 0
    fused = HeightMap(
        np.where(known, height, np.nan).astype(np.float32),
        np.where(known, np.sqrt(np.maximum(variance, 0)), np.nan).astype(np.float32),
        pixel_mm,
    )
    return Fused(fused, seen, _seam_mm(laid), (float(grid.x_mm[0]), float(grid.y_mm[0])))


def _lay(view: ContactView, pose: Array, grid: Grid) -> Laid:
    """Lay a press on the grid: above each point of the grid, the height at which the carried surface has it."""
    rows, columns = grid.window(carried(pose, corners_mm(view)))
    x, y = np.meshgrid(grid.x_mm[columns], grid.y_mm[rows])
    z, back = np.zeros_like(x), inverse(pose)
    middle = [(size - 1) / 2 for size in view.depth_mm.shape]
    for _ in range(LOOKS):
        there = carried(back, np.stack([x, y, z], axis=-1))
        at = there[..., 1] / view.pixel_size_mm[1] + middle[0], there[..., 0] / view.pixel_size_mm[0] + middle[1]
        depth = map_coordinates(view.depth_mm, at, order=1, mode="nearest", output=np.float64)
        z = z + (depth - there[..., 2])
    nearest = {"order": 0, "mode": "constant"}
    reached = map_coordinates(view.reached.astype(np.uint8), at, **nearest) > 0
    error = map_coordinates(view.error_mm, at, order=1, mode="nearest", output=np.float64)
    return Laid(rows, columns, np.where(reached, z, np.nan), error, _fade(view, at), there[..., :2])


def _fade(view: ContactView, at: tuple[Array, Array]) -> Array:
    """Return the weight (h, w) of places in a view, 0 at and beyond its border."""
    sides = [
        np.minimum(place, size - 1 - place) * pixel
        for place, size, pixel in zip(at, view.depth_mm.shape, view.pixel_size_mm[::-1], strict=True)
    ]
    return np.asarray(np.clip(np.minimum(*sides) / FADES_MM, 0, 1))


# ---- what is said of the map ----


def _form(height: Array, grid: Grid, *, curved: bool) -> Array:
    """Return (H, W) the plane of a map, and unless `curved` its paraboloid: of what most of the map lies on."""
    x, y = np.meshgrid(grid.x_mm - grid.x_mm.mean(), grid.y_mm - grid.y_mm.mean())
    terms = [np.ones_like(x), x, y] + ([] if curved else [x * x, x * y, y * y])
    known = np.flatnonzero(np.isfinite(height))
    if len(known) == 0:
        return np.zeros_like(height)
    known = known[:: len(known) // FORM_PX + 1]
    basis = np.stack([term.flat[known] for term in terms], axis=1)
    values = height.flat[known]
    weight: Array = np.ones(len(known))
    found: Array = np.zeros(len(terms))
    for _ in range(FORM_ROUNDS):
        found = np.asarray(np.linalg.lstsq(basis * weight[:, None], values * weight, rcond=None)[0])
        off = np.abs(values - basis @ found)
        weight = 1 / (1 + (off / (OUTLIER * np.median(off) + 1e-9)) ** 2)
    return np.asarray(sum(share * term for share, term in zip(found, terms, strict=True)))


def _seam_mm(laid: list[Laid]) -> float:
    """Return the rms difference of two presses over all that both reached."""
    squares, count = 0.0, 0
    for *_, difference, _variance in overlaps(laid):
        known = difference[np.isfinite(difference)]
        squares, count = squares + float((known**2).sum()), count + len(known)
    return float(np.sqrt(squares / count)) if count else float("nan")
