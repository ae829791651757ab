"""GelNet: difference image to gradient map, by ONNX Runtime on the CPU.

A row of the network is one pixel: the difference of its three channels (grey levels) and its position (px); the
answer is its slope. Three things make a frame cheap and quiet:

* Blocks. Rows go through in blocks that keep the layers' activations in the cache.
* Mask. Only pixels whose difference is significant go through one by one; elsewhere slopes are gentle, and the mean
  difference of each 8 x 8 pixels goes through instead. Gel bulges around a contact with slopes too gentle to see in one
  pixel, but over many millimetres: to take them for 0 would lift a press of 1 mm by 20 micrometres.
* Zero. What the network answers to no difference at all, a small slope that depends on the position, is subtracted,
  and a frame without any significant pixel is exactly flat.
"""

from pathlib import Path
from typing import Self

import numpy as np
from numpy.typing import NDArray

from gellight.bundle.bundle import Bundle
from gellight.frames.pixel_grid import between_blocks, block_means, grown, spread_blocks
from gellight.reconstruction.image_noise import SIGNIFICANT, RestChange
from gellight.reconstruction.network_session import NetworkSession

Floats = NDArray[np.float32]

BLOCK_ROWS = 4096  # measured: with 1024 to 8192 the network takes the same time, with 512 and 65536 a fifth more
CELL_PX = 4  # chosen: touch is judged by such means, whose noise is a quarter
COARSE_PX = 8
"""pixels a side over which the difference is averaged where it is not significant"""
SQUARES_CELLS = (1, 2, 3)
"""cells a side of the squares over which the difference is averaged: small ones see fine texture, large ones gentle
slopes"""
CLEAR = 7.2
"""standard deviations beyond which a cell counts as touched, where any does"""


class GradientNetwork:
    """The network of one calibration bundle, ready to run on images of one size.

    Which pixels are significant is decided on cells of 4 x 4 pixels. A cell counts as touched when the mean difference
    of the cell itself, of 2 x 2 cells with it, or of the 3 x 3 cells around it exceeds in its three channels together
    7.2 standard deviations of the noise of such a mean (`noise_grey` / 4, / 8 and / 12), and in one of them 4 times
    what the gel at rest differs by anyway (`image_noise.RestChange`). Where no cell does, 6.5 are enough: whether
    anything is touched decides over the whole frame, which cells are only over detail. Two more cells around a touched
    one count too, so that a steep rim stays clear of the averages outside. Means keep their sign, so noise that is
    stronger than `noise_grey` somewhere widens the spread of the mean but does not shift it.

    What the mask loses: a touch that changes no 12 x 12 pixels of the image by 0.5 `noise_grey` when there is no
    other touch; texture finer than 16 px of less than 1.5 `noise_grey`, and texture of exactly 4 px period.
    tests/host/reconstruction/test_gelnet.py measures it; docs/frame-path.md says what that is in micrometres.
    """

    def __init__(
        self,
        network: bytes | Path,
        image_shape: tuple[int, int],
        *,
        noise_grey: float,
        rest_grey: float = 0.0,
        source: str = "network",
    ) -> None:
        """Load an ONNX file or its content for images of `image_shape` (H, W).

        noise_grey: standard deviation of one pixel of the difference, grey levels. rest_grey: what means over cells
        differ by at rest beyond it, as in the manifest. source: the name of
        the bundle, for messages.
        Raises BundleError for a network that does not keep the contract, ValueError for the rest.
        """
        self.image_shape = image_shape
        self.session = NetworkSession(network, source=source)
        self.at_rest = RestChange(noise_grey, rest_grey)
        self._rows = np.zeros((BLOCK_ROWS, 5), np.float32)
        rows, columns = np.indices(image_shape, dtype=np.float32)
        self.position = np.stack([columns.ravel(), rows.ravel()], axis=1)  # (H * W, 2) x, y in px
        self.zero = self.infer(np.zeros((len(self.position), 3), np.float32), self.position)
        self.coarse_position = block_middles(image_shape, COARSE_PX)
        self.coarse_zero = self.infer(np.zeros((len(self.coarse_position), 3), np.float32), self.coarse_position)

    @classmethod
    def of_bundle(cls, bundle: Bundle) -> Self:
        """Return that of a bundle, for its pictures; BundleError as above."""
        noise_grey, rest_grey = bundle.manifest.noise_grey, bundle.manifest.rest_grey
        return cls(bundle.network, bundle.image_shape, noise_grey=noise_grey, rest_grey=rest_grey, source=bundle.source)

    def touched(self, difference: Floats) -> NDArray[np.bool_]:
        """Mark the (H, W) pixels whose (H, W, 3) difference image is significant, as the class documents it."""
        return spread_blocks(self.touched_cells(difference), CELL_PX, self.image_shape)

    def touched_cells(self, difference: Floats) -> NDArray[np.bool_]:
        """Mark the (ceil(H / 4), ceil(W / 4)) cells that `touched` spreads to pixels."""
        self._check(difference)
        means = cell_means(difference, CELL_PX)
        squares = [_square_means(means, side) for side in SQUARES_CELLS]
        clear, significant = (_beyond(squares, limits) for limits in self.limits_grey)
        cells = clear if clear.any() else significant
        return grown(cells, 2)

    @property
    def limits_grey(self) -> list[list[tuple[float, float]]]:
        """Limits on the mean difference, clear ones and significant ones.

        For each square: on the channels together, and on the largest.
        """
        sides = [side * CELL_PX for side in SQUARES_CELLS]
        return [[self.at_rest.limits_grey(side, limit) for side in sides] for limit in (CLEAR, SIGNIFICANT)]

    def gradient_map(self, difference: Floats, mask: NDArray[np.bool_] | None = None) -> Floats:
        """Turn a (H, W, 3) difference image into the (H, W, 2) gradient map, with the noise of the camera in it.

        Outside `mask` the slopes come from averages of 8 x 8 pixels; with an empty mask they are 0. Without a mask
        every pixel goes through.
        """
        self._check(difference)
        pixels = difference.reshape(-1, 3)
        if mask is None or mask.all():
            return (self.infer(pixels, self.position) - self.zero).reshape(*self.image_shape, 2)
        if not mask.any():
            return np.zeros((*self.image_shape, 2), np.float32)
        slopes = self._coarse_slopes(difference)
        inside = np.flatnonzero(mask)
        slopes.reshape(-1, 2)[inside] = self.infer(pixels, self.position, inside) - np.take(self.zero, inside, axis=0)
        return slopes

    def _coarse_slopes(self, difference: Floats) -> Floats:
        """Slopes (H, W, 2) from the means of 8 x 8 pixels, linear in between."""
        means = cell_means(difference, COARSE_PX)
        slopes = self.infer(means.reshape(-1, 3), self.coarse_position) - self.coarse_zero
        return between_blocks(slopes.reshape(*means.shape[:2], 2), COARSE_PX, self.image_shape)

    def infer(self, pixels: Floats, position: Floats, chosen: NDArray[np.intp] | None = None) -> Floats:
        """Run (N, 3) differences at (N, 2) positions, or the chosen ones of them, in blocks."""
        count = len(pixels) if chosen is None else len(chosen)
        slopes = np.empty((count, 2), np.float32)
        for start in range(0, count, BLOCK_ROWS):
            block = slice(start, min(start + BLOCK_ROWS, count))
            rows = self._rows[: block.stop - start]
            for columns, values in ((rows[:, :3], pixels), (rows[:, 3:], position)):
                # np.take gathers rows at twice the speed of indexing.
                columns[:] = values[block] if chosen is None else np.take(values, chosen[block], axis=0)
            slopes[block] = self.session.slopes(rows)
        return slopes

    def _check(self, difference: Floats) -> None:
        if difference.shape != (*self.image_shape, 3) or difference.dtype != np.float32:
            raise ValueError(
                f"difference image is {difference.shape} {difference.dtype}: give {(*self.image_shape, 3)} float32"
            )


def block_middles(image_shape: tuple[int, int], side: int) -> Floats:
    """Return x and y (h * w, 2) of the middles of blocks of `side` pixels a side that cover an image, px."""
    rows, columns = (np.arange(-(-n // side), dtype=np.float32) * side + (side - 1) / 2 for n in image_shape)
    return np.stack(np.meshgrid(columns, rows), axis=2).reshape(-1, 2).astype(np.float32)


def _beyond(squares: list[Floats], limits: list[tuple[float, float]]) -> NDArray[np.bool_]:
    """(h, w) where a mean over some square exceeds both of its limits."""
    beyond = np.zeros(squares[0].shape[:2], np.bool_)
    for square, (together, largest) in zip(squares, limits, strict=True):
        beyond |= ((square**2).sum(axis=2) > together**2) & (np.abs(square).max(axis=2) > largest)
    return beyond


def _square_means(means: Floats, side: int) -> Floats:
    """(h, w, 3) mean of the `side` x `side` cells around each cell; of two a side the cell is the lower right one.

    At the border the square is moved inwards: a cell that counted twice would bring twice its noise. A square that is
    larger than the image is as large as the image.
    """
    sides = [min(side, cells) for cells in means.shape[:2]]
    h, w = (cells - side + 1 for cells, side in zip(means.shape, sides, strict=False))
    parts = [means[y : y + h, x : x + w] for y in range(sides[0]) for x in range(sides[1])]
    return np.pad(np.mean(parts, axis=0), (*((side // 2, (side - 1) // 2) for side in sides), (0, 0)), mode="edge")


def cell_means(difference: Floats, size: int) -> Floats:
    """(ceil(H / size), ceil(W / size), 3) mean of each cell; a cut cell is filled up with its border pixels."""
    height, width = difference.shape[:2]
    if height % size or width % size:
        difference = np.pad(difference, ((0, -height % size), (0, -width % size), (0, 0)), mode="edge")
    return block_means(difference, size)
