"""Pictures of a pin grid to the lens: one lens for all pictures, and a place and an angle of the grid for each."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import polar
from scipy.optimize import least_squares

from gellight.base.errors import InputError
from gellight.lab.optics.lens.lattice import Lattice, best_lattice
from gellight.reconstruction.lens.model import Lens, distorted, half_diagonal_px, middle_px, undistorted

Array = NDArray[np.float64]
Floats = NDArray[np.float32]

LEAST_PINS = 24
"""in all pictures: they give 48 numbers for the 10 unknowns of a lens and one picture; the rest checks the fit"""
MOST_STRAYS = 0.2  # chosen: of the spots; with more the grid may be a wrong one
CELLS = 4
"""to a side: the view is divided into 4 x 4 cells, each of which must hold a pin"""
PITCH_TOLERANCE = 0.1
"""largest relative difference between the spacing of the pins and what pitch and pixel size say"""
LARGEST_RESIDUAL_PX = 0.5  # chosen: rms; beyond it the grid is bent, or tilted in the gel
_SOFT_PX = 0.3  # chosen: pins that are farther off count by their distance, not its square
_CENTRE_PRIOR = 1e-3
"""px of residual per px that the centre of distortion is off the middle: a lens without distortion has no centre that
the pins could show"""


@dataclass(frozen=True, kw_only=True, eq=False)
class LensFit:
    """A lens, and how well it explains the pins."""

    lens: Lens
    pitch_mm: float
    lattices: tuple[Lattice, ...]
    """one a picture"""
    expected_px: tuple[Array, ...]
    """(N, 2) where the lens sees the pins of each lattice"""
    rms_before_px: float
    """distance of the pins from the best straight grid (an affine map for each picture), root of the mean square"""
    rms_after_px: float
    """from their expected places"""

    @property
    def pins(self) -> int:
        """How many."""
        return sum(len(lattice.points) for lattice in self.lattices)


def fit_lens(lattices: Sequence[Lattice], image_shape: tuple[int, int], pitch_mm: float) -> LensFit:
    """Fit a lens to labelled pins by least squares; outliers count linearly beyond 0.3 px.

    Raises InputError for too few pins, for pins that leave parts of the view empty, and for residuals above 0.5 px.
    """
    check_pins(lattices, image_shape)
    grids = [lattice.places.astype(np.float64) * pitch_mm for lattice in lattices]
    middle, radius = middle_px(image_shape), half_diagonal_px(image_shape)
    straight = [_affine(grid, lattice.points) for grid, lattice in zip(grids, lattices, strict=True)]

    def expected(unknowns: Array) -> list[Array]:
        (cx, cy, k1, k2), scale = unknowns[:4], _symmetric(unknowns[4:7])
        poses = unknowns[7:].reshape(-1, 3)
        return [
            np.array([cx, cy]) + distorted((grid @ _rotation(a).T) @ scale + (x, y), k1, k2, radius)
            for grid, (a, x, y) in zip(grids, poses, strict=True)
        ]

    def residuals(unknowns: Array) -> Array:
        misses = [e - lattice.points for e, lattice in zip(expected(unknowns), lattices, strict=True)]
        return np.concatenate([*map(np.ravel, misses), _CENTRE_PRIOR * (unknowns[:2] - middle)])

    start = _start(straight, middle)
    solution = least_squares(residuals, start, x_scale="jac", loss="soft_l1", f_scale=_SOFT_PX)
    fit = LensFit(
        lens=_lens(solution.x, image_shape),
        pitch_mm=pitch_mm,
        lattices=tuple(lattices),
        expected_px=tuple(expected(solution.x)),
        rms_before_px=_rms([m for _, _, m in straight]),
        rms_after_px=_rms([e - t.points for e, t in zip(expected(solution.x), lattices, strict=True)]),
    )
    _check_fit(fit)
    return fit


def spacing_px(pixel_size_mm: tuple[float, float], pitch_mm: float) -> float:
    """Return how far apart pins look in a picture whose pixels have this size."""
    return pitch_mm / float(np.sqrt(pixel_size_mm[0] * pixel_size_mm[1]))


def read_pins(
    contrasts: Sequence[Floats], *, pixel_size_mm: tuple[float, float], pitch_mm: float, source: str | Path
) -> Lattice:
    """Find the grid in the one of some (H, W) pictures that shows most of it; `pins.spots` and others make them.

    Raises InputError, naming `source`, where there is no regular grid of about this pitch.
    """
    expected = spacing_px(pixel_size_mm, pitch_mm)
    best, most = best_lattice(contrasts, expected)
    if best is None:
        raise InputError(
            f"{source}: {most} spots some {expected:.0f} px apart, no grid of pins: press the grid over the whole "
            "view, and check its pitch"
        )
    _check_lattice(best, expected, pitch_mm, source)
    return best


def _check_lattice(lattice: Lattice, expected_px: float, pitch_mm: float, source: str | Path) -> None:
    off = lattice.spacing_px / expected_px - 1
    if abs(off) > PITCH_TOLERANCE:
        raise InputError(
            f"{source}: the pins are {lattice.spacing_px:.1f} px apart, a pitch of {pitch_mm:g} mm would be "
            f"{expected_px:.1f} px at the pixel size of this sensor: give the right pitch, or this sensor's bundle"
        )
    spots = len(lattice.points) + lattice.strays
    if lattice.strays > MOST_STRAYS * spots:
        raise InputError(
            f"{source}: {lattice.strays} of {spots} spots are in no row and column: the grid is not regular, or "
            "something else is on the gel; clean it and press the grid again"
        )


def check_pins(lattices: Sequence[Lattice], image_shape: tuple[int, int]) -> None:
    """Raise InputError unless there are enough pins, and some in every part of the (H, W) view."""
    points = np.concatenate([lattice.points for lattice in lattices])
    if len(points) < LEAST_PINS:
        raise InputError(f"{len(points)} pins in all, {LEAST_PINS} are needed: use a finer grid or more pictures")
    cells = np.floor(points * CELLS / np.array([image_shape[1], image_shape[0]])).astype(int)
    empty = CELLS**2 - len({tuple(cell) for cell in cells})
    if empty:
        raise InputError(
            f"{empty} of {CELLS**2} parts of the view hold no pin, the lens would be guessed there: press the grid "
            "over the whole view, or add a picture of it in the empty parts"
        )


def _check_fit(fit: LensFit) -> None:
    if not fit.rms_after_px <= LARGEST_RESIDUAL_PX:
        raise InputError(
            f"the pins are {fit.rms_after_px:.2f} px from where any lens would show them (at most "
            f"{LARGEST_RESIDUAL_PX:g}): the grid is bent or irregular, or tilted in the gel; press it flat and evenly"
        )
    lens = fit.lens
    height, width = lens.image_shape
    edge = [[x, y] for x in (0, width / 2, width - 1) for y in (0, height / 2, height - 1)]
    if not (np.linalg.det(lens.jacobian(lens.to_gel(np.array(edge, np.float64)))) > 0).all():
        raise InputError(
            f"the lens found (k1 {lens.k1:.3f}, k2 {lens.k2:.3f}) folds the picture over: press the grid up to the "
            "corners of the view"
        )


def _affine(grid: Array, points: Array) -> tuple[Array, Array, Array]:
    """Return matrix (2, 2), offset (2,) and misses (N, 2) of the affine map that fits best."""
    columns = np.column_stack([grid, np.ones(len(grid))])
    solved: Array = np.linalg.lstsq(columns, points, rcond=None)[0].astype(np.float64)
    return solved[:2].T, solved[2], columns @ solved - points


def _start(straight: list[tuple[Array, Array, Array]], middle: Array) -> Array:
    """Unknowns without distortion: a matrix is a symmetric one times a rotation (polar decomposition)."""
    scales, poses = [], []
    for matrix, offset, _ in straight:
        rotation, scale = polar(matrix, side="left")
        scales.append(scale)
        poses.append([np.arctan2(rotation[1, 0], rotation[0, 0]), *(offset - middle)])
    (xx, xy), (_, yy) = np.mean(scales, axis=0)
    return np.concatenate([middle, [0, 0, xx, xy, yy], np.ravel(poses)])


def _lens(unknowns: Array, image_shape: tuple[int, int]) -> Lens:
    (cx, cy, k1, k2), scale = unknowns[:4], _symmetric(unknowns[4:7])
    ideal = undistorted(middle_px(image_shape) - (cx, cy), k1, k2, half_diagonal_px(image_shape))
    x, y = np.linalg.solve(scale, ideal)
    return Lens(
        image_shape=image_shape,
        centre_px=(float(cx), float(cy)),
        k1=float(k1),
        k2=float(k2),
        px_per_mm=(float(scale[0, 0]), float(scale[0, 1]), float(scale[1, 1])),
        origin_mm=(float(x), float(y)),
    )


def _symmetric(values: Array) -> Array:
    return np.array([[values[0], values[1]], [values[1], values[2]]])


def _rotation(angle: float) -> Array:
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


def _rms(misses: list[Array]) -> float:
    return float(np.sqrt(np.mean(np.sum(np.concatenate(misses) ** 2, axis=1))))
