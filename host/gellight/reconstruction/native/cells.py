"""What the native path needs to know of the network at the means of cells of 4 x 4 pixels.

Slopes of touched pixels come from the network and its Jacobian there.

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
(`CellLimits`) goes through the network itself.

The network is not asked at every cell either. Where a cell differs by at most 8 grey levels from the blocks of 2 x 2
cells around, its own answer is blended from theirs by the same formula, with m_i of the cell in the place of d. Where
nothing touches, blocks have J m with the Jacobian at no difference. A ball 1 mm deep takes a fifth of the questions.
Without noise its normals differ from those of all pixels one by one by 0.0005 degrees in the mean (0.02 at most), the
depth by 0.02 micrometres (0.2). The camera's noise makes that 0.004 degrees and 0.2 micrometres (2.0): a bent network
answers to noise of variance s^2 with s^2 / 2 times its second derivative too much at a pixel, and hardly at a cell.
"""

from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from gellight.reconstruction.gelnet import CELL_PX, GradientNetwork, block_middles

Floats = NDArray[np.float32]

BLOCK_CELLS = 2048  # chosen: half of BLOCK_ROWS, as their Jacobians go along
LIMIT_NOISE = 4.0
"""Noise alone, |d - m| up to this multiple of its standard deviation, sends no pixel there by the bend."""
NEAREST_GREY = 4.0
"""Means that are nearer to each other do not tell how the answer bends."""


class CellLimits(NamedTuple):
    """Beyond which the network is asked more closely."""

    grey: float
    """A cell that differs by more in any channel from the blocks around it is asked about by itself."""
    bend: float
    """of the bend near a cell times the square of |d - m|, the largest of the channels, over sqrt(1 + slope^2)"""
    misfit: float
    """of the misfit between a cell and those beside it, over sqrt(1 + slope^2); pixels are wrong by some tenth of it"""
    noise_grey: float
    """|d - m| up to this sends no pixel to the network by the bend"""

    @classmethod
    def at_cells(cls, network: GradientNetwork) -> Self:
        """Return those that answer as well as every pixel does: beside the truth, errors are within 4 % of its."""
        return cls(grey=8.0, bend=0.04, misfit=0.4, noise_grey=LIMIT_NOISE * network.at_rest.pixel_grey)


EVERY_PIXEL = CellLimits(grey=0.0, bend=1e-6, misfit=1e-6, noise_grey=0.0)
"""The network is asked about each touched pixel, as in NumPy, unless it is linear there."""


class CellAnswers:
    """What the network answers to no difference, at the cells of images of one size."""

    def __init__(self, network: GradientNetwork) -> None:
        """Ask the network of the pixels."""
        self.middle = block_middles(network.image_shape, CELL_PX)
        """(h * w, 2) x and y, px"""
        self.zero = network.infer(np.zeros((len(self.middle), 3), np.float32), self.middle)
        """(h * w, 2)"""
        rows = np.concatenate([np.zeros((len(network.coarse_position), 3)), network.coarse_position], axis=1)
        blocks = [rows[at : at + BLOCK_CELLS].astype(np.float32) for at in range(0, len(rows), BLOCK_CELLS)]
        self.at_rest = np.concatenate([network.session.slopes_and_jacobian(block)[1] for block in blocks])
        """(h2 * w2, 6) Jacobian at no difference, at the means of 8 x 8 pixels"""
