"""What a picture itself says about its light: which groups lit which of its row bands.

Light adds up. Every row band of the picture is fitted, with coefficients that are not negative, by the pictures that
the untouched gel gave under each group alone:

    min |w (y - A x)|,  x >= 0        y: cells of the band, A: the same cells of every reference image

A band that saw one light has one coefficient of about 1; a change of light runs through the bands from top to bottom.
A touched gel has other shading. So cells that do not fit are weighted down (w, Cauchy's weights); one light is believed
before two, unless two fit clearly better; and a band of which most cells fit neither says nothing at all.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from gellight.base.errors import InputError
from gellight.frames.frames import LightLabel, LightState

Array = NDArray[np.float64]
Image = NDArray[np.uint8] | NDArray[np.float32] | NDArray[np.float64]
BANDS, CELLS = 16, 32
STEP_PX = 2
"""every second pixel of every second row is enough for the mean of a cell"""
ROUNDS = 4

# What is believed; docs/light.md tells what these were chosen on.
NOISE_GREY = 0.15
"""a cell is off by so much through noise and quantisation"""
SHADING = 0.05
"""and by this share of its level through modulation, drift and reflexes"""
GAIN = 0.15
"""two lights are believed where they lower the mean of ln(1 + misfit^2) over the cells by this"""
FITTING = 0.6
"""a band says something where this share of its cells fit"""
READABLE_BANDS = 4
"""a picture says something where so many of its bands do"""
PURE = 0.9
"""a band whose main group has at least this share saw that group"""
DARKEST = 0.4
"""bands whose coefficients add up to less than this, or to more than its inverse, saw another light"""


@dataclass(frozen=True, eq=False)
class Content:
    """What the bands of a picture say."""

    coefficients: Array
    """(BANDS, n) how much of each group: 1 is as in its reference image"""
    fitting: Array
    """(BANDS,) share of the cells that these explain"""


class ContentCheck:
    """Fits pictures by the reference images of the light groups."""

    def __init__(self, references: Sequence[Image] | NDArray[np.float32], *, dark: Image | None = None) -> None:
        """Take one (H, W, 3) picture of the untouched gel for each group, and one in the dark if that is not black.

        Raises InputError where two groups look the same, or where there is nothing to see under one.
        """
        self._black = cells(dark) if dark is not None else np.zeros(1)
        self._basis = np.stack([cells(image) - self._black for image in references], axis=2)
        self._refuse_lookalikes()

    def _refuse_lookalikes(self) -> None:
        columns = self._basis.reshape(-1, self._basis.shape[2])
        norms = np.linalg.norm(columns, axis=0)
        if (norms < np.sqrt(len(columns))).any():  # less than 1 grey level
            raise InputError(f"light group {int(norms.argmin())} is dark in its reference image: take it again")
        alike = np.triu(columns.T @ columns / np.outer(norms, norms), 1)
        one, other = np.unravel_index(alike.argmax(), alike.shape)
        if alike.size > 1 and alike[one, other] > 0.999:
            raise InputError(
                f"light groups {int(one)} and {int(other)} look the same in their reference images: "
                "take them again, or give each group LEDs of its own"
            )

    def read(self, image: Image) -> Content:
        """Return how much of each group is in each row band of (H, W, 3)."""
        observed = cells(image) - self._black
        scale = NOISE_GREY + SHADING * observed
        found, costs = single_fits(self._basis, observed, scale)
        for band in np.flatnonzero(costs > GAIN):  # costs are positive: elsewhere two can gain no more
            two, two_cost = pair_fit(self._basis[band], observed[band], scale[band])
            if two_cost + GAIN < costs[band]:
                found[band] = two
        misfit = np.abs(observed - np.einsum("bcn,bn->bc", self._basis, found)) / scale
        return Content(found, np.asarray((misfit < 1.5).mean(axis=1)))

    def label(self, image: Image) -> LightLabel:
        """Return what the picture shows: clean where every band that can be read saw the same one group.

        Bands that fit badly have no say; where too few have, it is unknown.
        """
        content = self.read(image)
        total = content.coefficients.sum(axis=1)
        readable = content.fitting >= FITTING
        dim = readable & (total < DARKEST)
        if readable.sum() < READABLE_BANDS or dim.all() or (readable & (total > 1 / DARKEST)).any():
            return LightLabel(state=LightState.UNKNOWN)
        lit = readable & ~dim
        share = content.coefficients[lit] / total[lit, None]
        main = share.argmax(axis=1)
        if dim.any() or (main != main[0]).any() or (share.max(axis=1) < PURE).any():
            return LightLabel(state=LightState.MIXED)
        return LightLabel(state=LightState.CLEAN, group=int(main[0]))


def cells(image: Image) -> Array:
    """Return the mean of the cells of each row band of (H, W, 3): (BANDS, CELLS * 3) grey levels."""
    sampled: NDArray[Any] = image[::STEP_PX, ::STEP_PX].astype(np.float32)
    for axis, count in ((0, BANDS), (1, CELLS)):
        edges = np.linspace(0, sampled.shape[axis], count + 1).astype(int)
        if (np.diff(edges) < 1).any():
            raise InputError(f"an image of {image.shape[1]} x {image.shape[0]} px is too small for the content check")
        shape = [1, 1, 1]
        shape[axis] = count
        sampled = np.add.reduceat(sampled, edges[:-1], axis=axis) / np.diff(edges).reshape(shape).astype(np.float32)
    return sampled.reshape(BANDS, CELLS * 3).astype(np.float64)


def single_fits(basis: Array, observed: Array, scale: Array) -> tuple[Array, Array]:
    """Fit each band by its best single group: (BANDS, n) coefficients, one of them not 0; (BANDS,) costs.

    `basis` is (BANDS, m, n), `observed` and `scale` (BANDS, m). The coefficient is the median of the cells' ratios.
    """
    bright = basis > 0.2 * basis.max(axis=1, keepdims=True)
    ratios = np.sort(np.where(bright, observed[..., None] / np.where(bright, basis, 1.0), np.inf), axis=1)
    factors = np.take_along_axis(ratios, (bright.sum(axis=1, keepdims=True) - 1) // 2, axis=1)[:, 0]
    costs = cost(observed[..., None] - basis * factors[:, None], scale[..., None])
    chosen = costs.argmin(axis=1)
    bands = np.arange(len(observed))
    found = np.zeros_like(factors)
    found[bands, chosen] = factors[bands, chosen]
    return found, costs[bands, chosen]


def pair_fit(basis: Array, observed: Array, scale: Array) -> tuple[Array, float]:
    """Fit one band, (m,), by all groups robustly, then by the strongest two: (n,) coefficients and their cost."""
    found = robust_fit(basis, observed, scale)
    if len(found) > 2:
        pair = np.argsort(found)[-2:]
        found = np.zeros_like(found)
        found[pair] = robust_fit(basis[:, pair], observed, scale)
    return found, float(cost((observed - basis @ found)[None], scale[None])[0])


def robust_fit(basis: Array, observed: Array, scale: Array) -> Array:
    """Return x >= 0, (n,), for observed (m,) ~ basis (m, n) x, with Cauchy's weights against cells that are touched."""
    weight = 1 / scale
    for _ in range(ROUNDS):
        found, _ = nnls(basis * weight[:, None], observed * weight)
        misfit = np.abs(observed - basis @ found) / scale
        weight = 1 / (scale * np.sqrt(1 + (misfit / max(1.5 * float(np.median(misfit)), 1.0)) ** 2))
    return np.asarray(found)


def cost(misfit: Array, scale: Array) -> Array:
    """Mean of ln(1 + (misfit / scale)^2) over the cells, axis 1."""
    return np.asarray(np.log1p((misfit / scale) ** 2).mean(axis=1))
