"""Slopes of touched pixels from the network and its Jacobian at the means of cells of 4 x 4 pixels.

With d the difference of a pixel, m_i those of the cells around it, w_i weights that are linear between the cells'
middles, and sums over the cells around the pixel:

    slope = sum w_i (g(m_i) - J_i m_i / 2) + J (d - m / 2),   J = sum w_i J_i,   m = sum w_i m_i

This is exact for a network g that is quadratic in the mean colour and linear around it. Every pixel keeps its own
noise, white as it came, so what follows (smoothing, and the measure of the noise in it) works as without cells. A
mean of the cell alone would not do: neighbours would share noise, and the smoothing would take it for the surface.

Two errors remain, and neighbouring cells i and j tell how large they may be. With H the derivative of J, the first is
(d - m) H (d - m) / 2; the bend |J_j - J_i| / |m_j - m_i| is how strong H is along one direction. The second is there
where g is not even quadratic: then g_j - g_i differs from (J_i + J_j) (m_j - m_i) / 2, and by how much is the misfit.
A slope that is wrong by e turns the normal by at most e / sqrt(1 + slope^2). A pixel for which that is too much
(`LIMIT_BEND`, `LIMIT_MISFIT`) goes through the network itself.

The network is not asked at every cell either. Where a cell differs by at most 8 grey levels from the blocks of 2 x 2
cells around, its own answer is blended from theirs by the same formula, with m_i of the cell in the place of d. Where
nothing touches, blocks have J m with the Jacobian at no difference. A ball 1 mm deep takes a fifth of the questions.
Without noise its normals differ from those of all pixels one by one by 0.0005 degrees in the mean (0.02 at most), the
depth by 0.02 micrometres (0.2). The camera's noise makes that 0.004 degrees and 0.2 micrometres (2.0): a bent network
answers to noise of variance s^2 with s^2 / 2 times its second derivative too much at a pixel, and hardly at a cell.
"""

import itertools
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from gellight.frames.pixel_grid import between_blocks, bounding_box, spread_blocks
from gellight.reconstruction.gelnet import CELL_PX, COARSE_PX, GradientNetwork, block_middles, cell_means

Floats = NDArray[np.float32]
Bools = NDArray[np.bool_]

BLOCK_CELLS = 2048
LIMIT_GREY = 8.0
"""A cell that differs by more in any channel from the blocks around it is asked about by itself."""
LIMIT_BEND = 0.04
"""of the bend near a cell times the square of |d - m|, the largest of the channels, over sqrt(1 + slope^2)"""
LIMIT_MISFIT = 0.4
"""of the misfit between a cell and those beside it, over sqrt(1 + slope^2); pixels are wrong by a tenth of it or so"""
LIMIT_NOISE = 4.0
"""Noise alone, |d - m| up to this multiple of its standard deviation, sends no pixel there by the bend."""
NEAREST_GREY = 4.0
"""Means that are nearer to each other do not tell how the answer bends."""
_NEIGHBOURS = np.ones((3, 3), np.uint8)
_ALL_CHANNELS = np.ones((1, 3), np.float32)


class CellNetwork:
    """The network at the cells of images of one size."""

    def __init__(self, network: GradientNetwork) -> None:
        """Take the network of the pixels."""
        self.network = network
        self.noise_grey = LIMIT_NOISE * network.at_rest.pixel_grey
        self.middle = block_middles(network.image_shape, CELL_PX)
        """(h * w, 2) x and y, px"""
        self.zero = network.infer(np.zeros((len(self.middle), 3), np.float32), self.middle)
        """(h * w, 2) what the network answers there to no difference"""
        nothing = np.zeros((len(network.coarse_position), 3), np.float32)
        self.at_rest = self._answer(np.concatenate([nothing, network.coarse_position], axis=1))[1]
        """(h2 * w2, 6) Jacobian at no difference, at the means of 8 x 8 pixels"""

    def gradient_map(self, difference: Floats, cells: Bools) -> Floats:
        """Turn a (H, W, 3) difference image into (H, W, 2) slopes; cells: what `touched_cells` marked, not empty.

        Outside the cells the slopes are those of `GradientNetwork.gradient_map`, but for what `_coarse_slopes` says.
        """
        slopes = np.empty((*difference.shape[:2], 2), np.float32) if cells.all() else self._coarse_slopes(difference)
        near = widened(cells)
        box = bounding_box(near)
        inside = tuple(slice(side.start * CELL_PX, side.stop * CELL_PX) for side in box)
        planes = self.planes(cell_means(difference, CELL_PX), near)[box]
        mask = spread_blocks(cells[box], CELL_PX, difference[inside].shape[:2])
        found, away = _blend(planes, difference[inside])
        np.copyto(slopes[inside], found, where=mask[..., None])
        rows, columns = np.nonzero(mask & _wrong(found, away, doubts(planes, near[box]), self.noise_grey))
        self._single(slopes, difference, (rows + inside[0].start) * difference.shape[1] + columns + inside[1].start)
        return slopes

    def _coarse_slopes(self, difference: Floats) -> Floats:
        """Slopes (H, W, 2) from the means m of 8 x 8 pixels: J m with J at no difference, as most of them are small."""
        means = cell_means(difference, COARSE_PX).reshape(-1, 3)
        slopes = (self.at_rest.reshape(-1, 2, 3) * means[:, None]).sum(axis=2)
        network, strong = self.network, np.flatnonzero((np.abs(means) > LIMIT_GREY).any(axis=1))
        asked = network.infer(means, network.coarse_position, strong)
        slopes[strong] = asked - np.take(network.coarse_zero, strong, axis=0)
        return network.spread(slopes)

    def planes(self, means: Floats, near: Bools) -> Floats:
        """(h, w, 11): g - J m / 2 of both slopes, the mean m of three channels, and J; 0 where a cell is not near."""
        blocks, network = cell_means(means, 2), self.network
        high_contrast = near & _far_from_blocks(means, blocks)
        planes = self._asked(means, high_contrast, self.middle, self.zero)
        low_contrast = near & ~high_contrast
        if low_contrast.any():
            around = self._asked(blocks, widened(_joined(low_contrast)), network.coarse_position, network.coarse_zero)
            planes[low_contrast] = _from_blocks(around, means)[low_contrast]
        return planes

    def _asked(self, means: Floats, chosen: Bools, middle: Floats, zero: Floats) -> Floats:
        """(h, w, 11) planes of the chosen ones of (h, w) cells or blocks, from the network; 0 elsewhere."""
        planes = np.zeros((*means.shape[:2], 11), np.float32)
        at = np.flatnonzero(chosen)
        mean = np.take(means.reshape(-1, 3), at, axis=0)
        slopes, jacobian = self._answer(np.concatenate([mean, middle[at]], axis=1))
        slopes -= np.take(zero, at, axis=0) + (jacobian.reshape(-1, 2, 3) * mean[:, None]).sum(axis=2) / 2
        planes.reshape(-1, 11)[at] = np.concatenate([slopes, mean, jacobian], axis=1)
        return planes

    def _answer(self, rows: Floats) -> tuple[Floats, Floats]:
        """Slopes (N, 2) and Jacobian (N, 6) of (N, 5) rows."""
        slopes, jacobian = np.empty((len(rows), 2), np.float32), np.empty((len(rows), 6), np.float32)
        for start in range(0, len(rows), BLOCK_CELLS):
            block = slice(start, start + BLOCK_CELLS)
            slopes[block], jacobian[block] = self.network.session.slopes_and_jacobian(rows[block])
        return slopes, jacobian

    def _single(self, slopes: Floats, difference: Floats, chosen: NDArray[np.intp]) -> None:
        """Replace the slopes of the chosen pixels by what the network answers to them."""
        network = self.network
        answer = network.infer(difference.reshape(-1, 3), network.position, chosen)
        slopes.reshape(-1, 2)[chosen] = answer - np.take(network.zero, chosen, axis=0)


def _blend(planes: Floats, difference: Floats) -> tuple[Floats, Floats]:
    """(h, w, 11) planes of cells and the (H, W, 3) difference to (H, W, 2) slopes, and |d - m| (H, W)."""
    mean = between_blocks(planes[..., 2:5], CELL_PX, difference.shape)
    argument = cv2.addWeighted(difference, 1, mean, -0.5, 0)
    slopes = between_blocks(planes[..., :2], CELL_PX, difference.shape)
    for axis in (0, 1):
        jacobian = between_blocks(planes[..., 5 + 3 * axis : 8 + 3 * axis], CELL_PX, difference.shape)
        slopes[..., axis] += cv2.transform(cv2.multiply(jacobian, argument, jacobian), _ALL_CHANNELS)
    red, green, blue = cv2.split(cv2.absdiff(difference, mean))
    return slopes, np.asarray(cv2.max(cv2.max(red, green), blue), np.float32)


def _wrong(slopes: Floats, away: Floats, doubt: Floats, noise_grey: float) -> Bools:
    """Mark the pixels whose (H, W, 2) slopes may be too wrong; away: |d - m| (H, W); doubt: of the cells, (h, w, 2)."""
    allowed, square = 1 + slopes[..., 0] ** 2 + slopes[..., 1] ** 2, away**2
    bend, misfit = (spread_blocks(doubt[..., kind], CELL_PX, away.shape) for kind in (0, 1))
    return np.asarray((away > noise_grey) & (square**2 * bend > allowed) | (misfit > allowed))


def doubts(planes: Floats, near: Bools) -> Floats:
    """(h, w, 2) squares of bend and misfit over their limits, from pairs of neighbours that are both near.

    The misfit is the largest with one of the four cells beside. The bend is the largest that any of the 3 x 3 cells
    around has with one beside it: on a crest neighbours have the same colour, so cells further away must tell it.
    """
    bend, misfit = np.zeros((2, *near.shape), np.float32)
    cells = np.ascontiguousarray(np.moveaxis(planes, 2, 0))
    for here, there in ((np.s_[..., :-1], np.s_[..., 1:]), (np.s_[..., :-1, :], np.s_[..., 1:, :])):
        pair = _between_two(cells[here], cells[there]) * (near[here] & near[there])
        for most, value in zip((bend, misfit), pair, strict=True):
            for cell in (here, there):
                np.maximum(most[cell], value, out=most[cell])
    return np.stack([cv2.dilate(bend, _NEIGHBOURS), misfit], axis=2)


def _between_two(i: Floats, j: Floats) -> Floats:
    """(2, ...) the squares of bend and misfit over their limits, from the planes (11, ...) of neighbours.

    A cell has q = g - J m / 2, so the misfit is q_j - q_i + (J_j m_i - J_i m_j) / 2.
    """
    (q_i, m_i, jacobian_i), (q_j, m_j, jacobian_j) = (np.split(cells, [2, 5]) for cells in (i, j))
    moved = np.maximum(_square(m_j - m_i), NEAREST_GREY**2)
    bend = _square(jacobian_j - jacobian_i) / moved
    crossed = [(jacobian_j[of] * m_i - jacobian_i[of] * m_j).sum(axis=0) for of in (np.s_[:3], np.s_[3:])]
    misfit = _square(q_j - q_i + np.stack(crossed) / 2)
    return np.stack([bend / LIMIT_BEND**2, misfit / LIMIT_MISFIT**2])


def _square(vectors: NDArray[Any]) -> Floats:
    return np.asarray(np.einsum("k...,k...->...", vectors, vectors))


def _far_from_blocks(means: Floats, blocks: Floats) -> Bools:
    """Mark (h, w, 3) cells that differ by more than `LIMIT_GREY` from one of the four blocks they are blended from."""
    far = np.zeros(means.shape[:2], np.bool_)
    (above, below), (left, right) = (
        [np.clip((np.arange(n) + step) // 2, 0, size - 1) for step in (-1, 1)]
        for n, size in zip(means.shape[:2], blocks.shape[:2], strict=True)
    )
    for rows, columns in itertools.product((above, below), (left, right)):
        far |= (np.abs(means - blocks[rows[:, None], columns]) > LIMIT_GREY).any(axis=2)
    return far


def _from_blocks(blocks: Floats, means: Floats) -> Floats:
    """Planes of blocks (h2, w2, 11) to those of the cells in them, whose means (h, w, 3) are known."""
    planes = between_blocks(blocks, 2, means.shape)
    away = (means - planes[..., 2:5])[..., None, :] / 2
    planes[..., :2] += (planes[..., 5:].reshape(*means.shape[:2], 2, 3) * away).sum(axis=3)
    planes[..., 2:5] = means
    return planes


def widened(cells: Bools) -> Bools:
    """Cells, and their eight neighbours."""
    return cv2.dilate(cells.view(np.uint8), _NEIGHBOURS).view(np.bool_)


def _joined(cells: Bools) -> Bools:
    """(h, w) cells to the blocks of 2 x 2 that they lie in."""
    even = np.pad(cells, [(0, n % 2) for n in cells.shape])
    return even[::2, ::2] | even[1::2, ::2] | even[::2, 1::2] | even[1::2, 1::2]
