"""Gradient map to depth map and normal map.

Depth is the least-squares surface: the sum over all edges between neighbouring pixels a, b of
(z_b - z_a - integral of the gradient from a to b)^2 is smallest. Its normal equations are Poisson's equation with
natural (Neumann) boundaries, which the type-II cosine transform diagonalises (Frankot and Chellappa 1988; Simchony,
Chellappa and Shao 1990), so a contact that is cut by the image border loses nothing.

The integral along an edge decides whether small contacts keep their height. Averaging the two ends is the trapezoid
rule, which scales a wave of k rad/px by (k/2) / tan(k/2), about 1 - k^2/12. Here it is integrated from six samples.
"""

from __future__ import annotations

from functools import cache

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy import fft

from gellight.bundle.manifest import BULGE
from gellight.frames.pixel_grid import pixel_size_xy
from gellight.frames.point_cloud import normals as normals  # beside `integrate`, for who looks for both here

Floats = NDArray[np.floating]

_EDGE = (802 / 1440, -93 / 1440, 11 / 1440)
"""Interior edge from its two ends outwards; each weight serves both sides. Exact for polynomials up to degree 5."""
_EDGE_SECOND = (13 / 24, -1 / 24)
"""The second edge from a border, where only four samples are centred on it. Exact to degree 3."""
_EDGE_FIRST = (9 / 24, 19 / 24, -5 / 24, 1 / 24)
"""The edge at a border, one-sided from the border inwards (Adams-Moulton). Exact to degree 3."""
_DIFFERENCE = (3 / 4, -3 / 20, 1 / 60)
"""Central difference: weights of the samples 1, 2 and 3 steps ahead, less those behind. Exact to degree 6."""
_ZERO_SAMPLES = 40_000  # chosen: their median is good to 1/160 of the scatter
_LEAST_AT_REST = 0.05  # chosen: of the view; below, the gel's volume is the better judge
_HIGHER_QUARTER = 0.74
"""height of the gel at its border over what a quarter of the border is higher than. That quarter stays clear of an
object, which is deep where the border cuts it; the median lies on its wall where it covers half of the border."""


def integrate(
    gradient_map: Floats,
    pixel_size_mm: float | tuple[float, float],
    *,
    at_rest: NDArray[np.bool_] | None = None,
    bulge: float = BULGE,
) -> Floats:
    """Integrate a gradient map to the depth map that fits it best in the sense of least squares.

    gradient_map: (H, W, 2) d(depth)/dx, d(depth)/dy, dimensionless; float64 is kept, all else becomes float32.
    pixel_size_mm: mm per pixel, one number or (x, y).
    at_rest: (H, W) where the gel is known to be untouched.
    bulge: of this gel and view, see `manifest.BULGE`.

    Returns (H, W) depth in mm. Slopes leave the height of the whole surface open; what sets it is: the median over
    `at_rest` is 0. Without `at_rest` the median of the map is 0, which is the untouched gel while less than half of
    the view is touched. With an `at_rest` of less than 5 % of the view the height comes from the bulge: gel keeps its
    volume, so what is pressed down in the view rises at its border, in a known proportion. On the simulated gel that
    is right to some 0.03 mm. The medians are over a regular subset of about 40 000 pixels.

    Where the slope jumps between two samples, as at the rim of a hard cap on a plane, the rim is known to half a pixel
    only: caps 5, 10, 20 and 60 px across scatter by 7, 4, 1.4 and 0.3 % with their place between the pixels
    (`python -m tests.benchmarks.integrators`).

    Raises ValueError for a wrong shape, for NaN or infinity and for a pixel size that is not above 0.
    """
    slopes = _checked(gradient_map)
    size_x, size_y = pixel_size_xy(pixel_size_mm)
    depth = _poisson(_divergence(slopes, size_x, size_y))
    depth -= rest_level(depth, at_rest, bulge)
    return depth


def surface_gradient(depth_mm: Floats, pixel_size_mm: float | tuple[float, float]) -> NDArray[np.float32]:
    """Differentiate a (H, W) depth map, mm, to its (H, W, 2) gradient map, float32.

    Central differences over seven pixels, exact for polynomials up to degree 6; towards the border the surface goes on
    as a quadratic. After `integrate` this is the gradient map without what fits no surface: of white noise in slopes
    half the energy has a curl, while the slopes of a surface have none. Raises ValueError as `integrate` does.
    """
    if depth_mm.ndim != 2 or min(depth_mm.shape) < 3:
        raise ValueError(f"depth map has shape {depth_mm.shape}: give (H, W) with at least 3 x 3 pixels")
    size_x, size_y = pixel_size_xy(pixel_size_mm)
    depth = depth_mm.astype(np.float32, copy=False)
    taps, one = np.array([-w for w in _DIFFERENCE[::-1]] + [0.0, *_DIFFERENCE]), np.ones(1)
    reach, (height, width) = len(_DIFFERENCE), depth.shape
    across = cv2.sepFilter2D(_continued(depth), -1, taps / size_x, one)[:, reach : reach + width]
    down = cv2.sepFilter2D(_continued(depth.T).T, -1, one, taps / size_y)[reach : reach + height]
    return np.asarray(cv2.merge((across, down)), np.float32)


def _continued(depth: NDArray[np.float32]) -> NDArray[np.float32]:
    """Continue the rows of (m, n) as quadratics beyond both ends, by as much as the central difference needs."""
    steps = np.arange(1, len(_DIFFERENCE) + 1, dtype=np.float32)
    ends = []
    for a, b, c in (depth[:, :3].T, depth[:, : -4 if depth.shape[1] > 3 else None : -1].T):
        ends.append(a[:, None] + steps * ((a - b)[:, None] + (a - 2 * b + c)[:, None] * ((steps + 1) / 2)))
    return np.concatenate([ends[0][:, ::-1], depth, ends[1]], axis=1)


def _checked(gradient_map: Floats) -> Floats:
    """The map as planes (2, H, W) in the precision of the computation."""
    if gradient_map.ndim != 3 or gradient_map.shape[2] != 2 or min(gradient_map.shape[:2]) < 2:
        raise ValueError(f"gradient map has shape {gradient_map.shape}: give (H, W, 2) with at least 2 x 2 pixels")
    kind = np.float64 if gradient_map.dtype == np.float64 else np.float32
    planes: Floats = np.ascontiguousarray(np.moveaxis(gradient_map, 2, 0), dtype=kind)
    # One sum is the cheapest test that passes over the map once; it is NaN or infinite if any slope is.
    if not np.isfinite(planes.sum(dtype=np.float64)):
        count = int(planes.size - np.isfinite(planes).sum())
        raise ValueError(f"gradient map has {count} values that are NaN or infinite: mask them before integrating")
    return planes


def _edge_integrals(slope: Floats) -> Floats:
    """Integrate along the last axis between neighbouring samples: (..., n) to (..., n - 1), in pixels."""
    if slope.shape[-1] < 4:
        return (slope[..., 1:] + slope[..., :-1]) / 2
    edges = np.empty_like(slope[..., 1:])
    if slope.shape[-1] > 5:
        inner = edges[..., 2:-2]
        np.add(slope[..., 2:-3], slope[..., 3:-2], out=inner)
        inner *= slope.dtype.type(_EDGE[0])
        pair = slope[..., 1:-4] + slope[..., 4:-1]
        pair *= slope.dtype.type(_EDGE[1])
        inner += pair
        np.add(slope[..., :-5], slope[..., 5:], out=pair)
        pair *= slope.dtype.type(_EDGE[2])
        inner += pair
    for s, e in ((slope, edges), (slope[..., ::-1], edges[..., ::-1])):
        e[..., 0] = sum(w * s[..., i] for i, w in enumerate(_EDGE_FIRST))
        e[..., 1] = _EDGE_SECOND[0] * (s[..., 1] + s[..., 2]) + _EDGE_SECOND[1] * (s[..., 0] + s[..., 3])
    return edges


def _divergence(slopes: Floats, size_x: float, size_y: float) -> Floats:
    """Right-hand side of the normal equations, mm: edge integrals that leave a pixel minus those that enter."""
    across = _edge_integrals(slopes[0])
    across *= slopes.dtype.type(size_x)
    # A transposed view in, a transposed view out: the vertical pass still runs along memory.
    down = _edge_integrals(slopes[1].T).T
    down *= slopes.dtype.type(size_y)
    result = np.zeros(slopes.shape[1:], slopes.dtype)
    result[:, :-1] += across
    result[:, 1:] -= across
    result[:-1] += down
    result[1:] -= down
    return result


@cache
def _inverse_eigenvalues(shape: tuple[int, ...], kind: str) -> Floats:
    """1 / eigenvalues of the Neumann Laplacian, -1 / (4 - 2 cos(pi i / W) - 2 cos(pi j / H)); 0 for the mean."""
    height, width = shape
    rows = 2 - 2 * np.cos(np.pi * np.arange(height) / height)
    columns = 2 - 2 * np.cos(np.pi * np.arange(width) / width)
    total = rows[:, None] + columns[None, :]
    total[0, 0] = np.inf
    inverse: Floats = (-1 / total).astype(kind)
    return inverse


def _poisson(divergence: Floats) -> Floats:
    """Solve Laplacian(z) = divergence under Neumann boundaries; the mean of z is 0."""
    spectrum = fft.dctn(divergence, type=2, norm="ortho", overwrite_x=True, workers=1)
    spectrum *= _inverse_eigenvalues(divergence.shape, divergence.dtype.name)
    depth: Floats = fft.idctn(spectrum, type=2, norm="ortho", overwrite_x=True, workers=1)
    return depth


def cosines(maps: Floats) -> Floats:
    """Return the orthonormal cosine transform of type 2 of each row of a map, which is overwritten."""
    return np.asarray(fft.dct(maps, type=2, norm="ortho", axis=1, overwrite_x=True, workers=1))


def from_cosines(waves: Floats) -> Floats:
    """Return the map of a transform of `cosines`, which is overwritten."""
    return np.ascontiguousarray(fft.idct(waves, type=2, norm="ortho", axis=1, overwrite_x=True, workers=1))


def rest_level(depth: Floats, at_rest: NDArray[np.bool_] | None, bulge: float) -> np.floating:
    """Return the depth of the gel at rest, mm, as `integrate` documents it."""
    grid = sample_grid(depth.shape)
    if at_rest is None:
        return np.median(depth[grid])
    if at_rest.shape != depth.shape:
        raise ValueError(f"at_rest has shape {at_rest.shape}, the depth map {depth.shape}: they must be equal")
    return level_of_sample(depth, depth[grid][at_rest[grid]], bulge)


def sample_grid(shape: tuple[int, ...]) -> tuple[slice, ...]:
    """Return the regular subset of a depth map of this shape whose median is taken."""
    # An odd step, started so that the sample lies evenly about the image centre: a tilted plane keeps its middle at 0.
    step = 1 + 2 * round(max(0.0, float(np.sqrt(np.prod(shape) / _ZERO_SAMPLES)) - 1) / 2)
    return tuple(slice((n - 1) % step // 2, None, step) for n in shape)


def level_of_sample(depth: Floats, resting: Floats, bulge: float) -> np.floating:
    """Return the depth of the gel at rest, mm, from the (N,) depths of the subset that are at rest."""
    sample = depth[sample_grid(depth.shape)]
    if resting.size >= _LEAST_AT_REST * sample.size:
        return np.median(resting)
    border = np.sort(np.concatenate([depth[0], depth[-1], depth[:, 0], depth[:, -1]]))
    bulge *= _HIGHER_QUARTER
    level: np.floating = (sample.mean() + bulge * border[len(border) // 4]) / (1 + bulge)
    return level


def angle_deg(a: NDArray[np.floating], b: NDArray[np.floating]) -> NDArray[np.float32]:
    """Return the angle between unit vectors (N, 3), deg; by the chord, 2 asin(|a - b| / 2): small angles stay exact."""
    chord = a - b
    half = np.sqrt(np.einsum("...i,...i", chord, chord)) / 2
    angle: NDArray[np.float32] = np.degrees(2 * np.arcsin(np.minimum(half, 1))).astype(np.float32)
    return angle


_CELL_PX = 8  # chosen: small beside the millimetres over which the gel comes to rest


def far_from_touch(touched: NDArray[np.bool_], side: int = _CELL_PX) -> NDArray[np.bool_]:
    """Mark the quarter of the untouched (H, W) pixels that is farthest from any touched one.

    Gel that is pressed down in one place bulges out around it, with slopes too gentle to show in the image, and comes
    to rest some thicknesses of the gel farther out. The median over all untouched pixels would put 5 micrometres of
    bulge under a ball that is pressed 1 mm deep. Distances are chess-board distances between cells of `side` pixels a
    side: 8 for pixels, fewer where `touched` is of means of them.
    """
    free = ~touched
    return free_and_far(free, far_cells(free[side // 2 :: side, side // 2 :: side]), side)


def free_and_far(free: NDArray[np.bool_], far: NDArray[np.bool_], side: int) -> NDArray[np.bool_]:
    """Mark the free (H, W) pixels in far (h, w) cells; all that are free where no cell is far."""
    if not far.any():
        return free
    rows, columns = (
        np.minimum(np.arange(n) // side, cells - 1) for n, cells in zip(free.shape, far.shape, strict=True)
    )
    return np.asarray(free & far[rows[:, None], columns[None, :]])


def far_cells(free: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Mark the farthest quarter of the free (h, w) cells; all of them where no cell is touched.

    What a touch encloses shows no slope and is no gel at rest: it lies under the flat end of a body, or within a ring.
    """
    if free.all() or not free.any():
        return free
    cells = np.ascontiguousarray(free).view(np.uint8)
    distance = cv2.distanceTransform(cells, cv2.DIST_C, 3)
    distance[_enclosed(cells)] = 0
    distances = distance[distance > 0]
    place = -(-3 * (distances.size - 1) // 4)  # of the upper quartile among them, in ascending order
    return np.asarray(distance >= max(1, np.partition(distances, place)[place]))


def _enclosed(free: NDArray[np.uint8]) -> NDArray[np.bool_]:
    """Mark the free (h, w) cells with no free way to the border of the view; none of them where no cell has one."""
    parts = cv2.connectedComponents(free, connectivity=4)[1]
    border = np.concatenate([parts[0], parts[-1], parts[:, 0], parts[:, -1]])
    return np.asarray((free != 0) & ~np.isin(parts, border)) if border.any() else np.zeros(free.shape, np.bool_)
