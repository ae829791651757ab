"""From the marker dots of a frame, its depth and its pressure to how the gel is moved and pulled along itself.

A dot is seen where the gel has carried it and where perspective puts it: a point x on the gel that is d deep is seen at
x H / (H - d) by a camera at the height H. What is left of its motion after that is `field_mm`. A pressure alone moves
the gel along itself, outwards beside a ball; that is no shear, and it is taken off before the force is sought.

The gel carries the imprint with it, so the kernels are taken between places on the gel at rest: the contact is moved
back by as much as the dots near it have moved.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gellight.frames.measures import Force
from gellight.frames.pixel_grid import block_means, spread_blocks
from gellight.frames.shear import FEW_DOTS, FRICTION, PERSPECTIVE, DotsSeen, Shear
from gellight.reconstruction.force import Layer, cell_side_px
from gellight.reconstruction.force_file import ForceRecord
from gellight.reconstruction.shear.traction import Pull, find_pull, kernels

Array = NDArray[np.float64]
NO_CONSTANT = "the bundle has no constant for the force: find it with `gellight calibrate force`"
ERROR_MM = 0.01
"""of the displacement of a dot: by its place in the picture, by the depth there, and by what no layer knows"""
MOST_CELLS = 160
"""under the contact; where there are more they are put together"""
FEWEST_NEAR = 3
"""dots in and around the contact: with fewer the force is mostly a guess"""
MOST_FRICTION = 1.5
"""force along the gel over the normal force, three times what `inverse.SAME` expects; few things grip a gel better"""
UNEXPLAINED_MM, UNEXPLAINED_SHARE = 0.05, 0.5
"""rms of what the contact does not explain of the dots' motion, and its share of all: beyond both there is no force"""
TOGETHER_MM = 0.02
"""by which all dots together have moved where no contact is felt: beyond it one is there that fills the view"""
UNEXPLAINED = "the dots have moved more than the contact that is felt explains: it may fill the view or reach beyond"
LEAST_PRESSURE = 0.02
"""of the largest: what is pressed less pulls nothing"""


@dataclass(frozen=True, kw_only=True, eq=False)
class Gel:
    """How the gel is seen."""

    pixel_size_mm: tuple[float, float]
    camera_height_mm: float | None
    """None: perspective is not taken off"""
    to_gel: Callable[[Array], Array]
    """maps (n, 2) places in the picture, px, to the gel, mm from the image centre"""


@dataclass(frozen=True, kw_only=True, eq=False)
class _Cells:
    """The cells under a contact."""

    pressure: Array
    """(m,) as a share of Young's modulus"""
    at_mm: Array
    """(m, 2)"""
    side_px: int
    area_mm2: float
    rows: NDArray[np.intp]
    columns: NDArray[np.intp]
    shape: tuple[int, int]


def motion(dots: DotsSeen, depth_mm: NDArray[np.float32], gel: Gel) -> tuple[Array, Array]:
    """Return (N, 2) rest places of the dots, mm from the image centre, and (N, 2) mm they have moved along the gel.

    The motion is NaN for dots that are not seen.
    """
    height, width = depth_mm.shape
    rest, now = gel.to_gel(dots.rest_px), gel.to_gel(dots.places_px)
    if gel.camera_height_mm is not None:
        at_px = now / np.array(gel.pixel_size_mm) + np.array([width - 1, height - 1]) / 2
        column, row = np.clip(np.rint(at_px), 0, [width - 1, height - 1]).astype(np.intp).T
        now = now * (1 - depth_mm[row, column] / gel.camera_height_mm)[:, None]
    return rest, np.where(dots.seen[:, None], now - rest, np.nan)


def felt_shear(
    dots: DotsSeen, depth_mm: NDArray[np.float32], force: Force | None, gel: Gel, scale: ForceRecord | None
) -> Shear:
    """Return displacement and force along the gel of a frame with a (H, W) depth map and its normal force."""
    rest, moved = motion(dots, depth_mm, gel)
    known = Shear(dots=dots, field_mm=moved, flags=() if gel.camera_height_mm else (PERSPECTIVE,))
    if dots.problem:
        return replace(known, field_mm=np.full_like(moved, np.nan), unknown=dots.problem)
    if force is None or scale is None:
        return replace(known, unknown=NO_CONSTANT)
    cells = _cells(force.pressure_mpa / scale.youngs_modulus_mpa, gel.pixel_size_mm, scale.layer)
    if cells is None:
        return _untouched(known, depth_mm.size * gel.pixel_size_mm[0] * gel.pixel_size_mm[1], scale)
    return _pulled(known, rest, moved, cells, scale, force)


def _untouched(known: Shear, view_mm2: float, scale: ForceRecord) -> Shear:
    """Return no force, where no contact is felt, with the error that one has which fills the view and is not felt.

    It shears the gel as a block: a force of G A u / t moves all dots by u, where the gel is t thick.
    """
    moved = known.field_mm[known.dots.seen]
    together = float(np.hypot(*moved.mean(axis=0)))
    if together > TOGETHER_MM or _unexplained(moved, moved):
        return replace(known, unknown=UNEXPLAINED)
    stiffness = scale.youngs_modulus_mpa * scale.side_scale / (2 * (1 + scale.layer.poisson_ratio))
    unsure_mm = float(np.hypot(together, ERROR_MM / np.sqrt(len(moved))))
    error_n = stiffness * view_mm2 / scale.layer.thickness_mm * unsure_mm
    return replace(
        known,
        force_n=(0.0, 0.0),
        force_error_n=(error_n, error_n),
        torque_nmm=0.0,
        torque_error_nmm=error_n * float(np.sqrt(view_mm2 / (2 * np.pi))),
    )


def _pulled(known: Shear, rest: Array, moved: Array, cells: _Cells, scale: ForceRecord, force: Force) -> Shear:
    seen = known.dots.seen
    places, motions = rest[seen], moved[seen]
    near = _nearness(places + motions, cells, scale.layer)
    carried = near @ motions / max(float(near.sum()), 1e-12)
    pull, left = _solved(places + carried, motions, cells, scale.layer)
    if _unexplained(left, motions):
        return replace(known, unknown=UNEXPLAINED)
    newtons = scale.youngs_modulus_mpa * scale.side_scale
    (x, y, turn), spread = pull.total * newtons, np.sqrt(np.diag(pull.covariance).clip(0)) * newtons
    centre = np.average(cells.at_mm, axis=0, weights=cells.pressure)
    sizes = np.array([np.hypot(x, y), np.hypot(x, y), turn])
    errors = np.hypot(spread, scale.side_error_share * sizes).tolist()
    few = FEW_DOTS if (near > 0.3).sum() < FEWEST_NEAR else ""
    gripped = FRICTION if sizes[0] > MOST_FRICTION * force.normal_n else ""
    return replace(
        known,
        force_n=(float(x), float(y)),
        force_error_n=(errors[0], errors[1]),
        torque_nmm=float(turn),
        torque_error_nmm=errors[2],
        centre_mm=(float(centre[0]), float(centre[1])),
        flags=(*known.flags, *filter(None, (few, gripped)), *force.flags),
        traction_of=lambda: _traction_map(pull.traction * newtons, cells),
    )


def _solved(places: Array, motions: Array, cells: _Cells, layer: Layer) -> tuple[Pull, Array]:
    """Find the traction by dots at (n, 2) places that have moved by (n, 2) mm, and the (n, 2) mm it leaves."""
    xx, xy, yy, xz, yz = kernels(layer).at(places[:, None] - cells.at_mm[None])
    by_pressure = np.stack([np.einsum("ij,j->i", one, cells.pressure) for one in (xz, yz)], axis=1) * cells.area_mm2
    influence = np.block([[xx, xy], [xy, yy]]) * cells.area_mm2
    along = motions - by_pressure
    pull = find_pull(along, ERROR_MM, influence, cells.pressure, cells.at_mm, cells.area_mm2)
    return pull, along - np.einsum("ij,j->i", influence, pull.traction.T.ravel()).reshape(2, -1).T


def _unexplained(left: Array, motions: Array) -> bool:
    """Tell whether too much is left of the (n, 2) mm by which the dots have moved."""
    rest, whole = (float(np.sqrt(np.square(each).sum(axis=1).mean())) for each in (left, motions))
    return rest > max(UNEXPLAINED_MM, UNEXPLAINED_SHARE * whole)


def _cells(pressure: NDArray[np.float32], pixel_size_mm: tuple[float, float], layer: Layer) -> _Cells | None:
    """Return the cells of a (H, W) pressure map, a share of Young's modulus; None where nothing is pressed."""
    side = cell_side_px(pixel_size_mm, layer)
    count = int((block_means(pressure, side) > 0).sum())
    side *= max(1, int(np.ceil(np.sqrt(count / MOST_CELLS))))
    means = block_means(pressure, side).astype(np.float64)
    if not means.any():
        return None
    rows, columns = np.nonzero(means > LEAST_PRESSURE * means.max())
    height, width = pressure.shape
    middle = np.array([width - 1, height - 1]) / 2
    at_px = np.stack([columns, rows], axis=1) * side + (side - 1) / 2
    area = side**2 * pixel_size_mm[0] * pixel_size_mm[1]
    return _Cells(
        pressure=means[rows, columns], at_mm=(at_px - middle) * np.array(pixel_size_mm), side_px=side, area_mm2=area,
        rows=rows, columns=columns, shape=(height, width),
    )  # fmt: skip


def _nearness(places: Array, cells: _Cells, layer: Layer) -> Array:
    """(n,) how near dots at (n, 2) places are to the pressure: 1 in the middle of a wide contact, 0 far away."""
    away = places[:, None] - cells.at_mm[None]
    share = np.exp(-np.square(away).sum(axis=2) / (2 * (0.25 * layer.thickness_mm) ** 2))
    most: Array = (share * (cells.pressure / cells.pressure.max())).max(axis=1)
    return most


def _traction_map(traction: Array, cells: _Cells) -> NDArray[np.float32]:
    """(H, W, 2) each cell's traction on its pixels."""
    height, width = (length // cells.side_px for length in cells.shape)
    blocks = np.zeros((2, height, width), np.float32)
    blocks[:, cells.rows, cells.columns] = traction.T
    return np.stack([spread_blocks(one, cells.side_px, cells.shape) for one in blocks], axis=-1)
