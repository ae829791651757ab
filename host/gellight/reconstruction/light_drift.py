"""Light that differs between the reference image and a picture: how much, and a difference image without it.

LEDs fade as they warm up, supplies sag, exposure hunts, a reference is of another moment. All of it changes the whole
picture, a touch only a part of it. So each channel of the reference is multiplied by a gain that
changes evenly over the view, until it is like the picture where both agree: least squares over means of cells, robust,
so cells that do not agree do not count. A touch is multiplied too where the picture shows that light was not added.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gellight.frames.pixel_grid import block_means

Floats = NDArray[np.float32]
Array = NDArray[np.float64]
CELL_PX = 8  # chosen: the noise of such means is an eighth
MOST_CELLS = 2500
"""more tell nothing more"""
BELIEVED = 0.5
"""what a gain may leave, as a share of what light that was added leaves: on real sensors it often was"""
MOST_CHANGE = 0.3
"""of the light of a channel, anywhere in the view: so much is shown to be taken out"""
_WHITE_GREY = 250.0  # chosen: means above it may have pixels that clip
_ROUNDS = 8  # chosen: of weighting by what the one before left
_BEYOND = 2.0
"""times what the median cell leaves, the three channels together: a cell that leaves more is touched"""
_LEAST_GREY = 0.03  # chosen: keeps the scale from 0 where pictures have no noise
_USUAL = 0.2
"""of the light: a change that is allowed where the picture says nothing"""


@dataclass(frozen=True, eq=False)
class LightDrift:
    """The light of a picture beside its reference's."""

    gains: Array
    """(3, 3) of 1, of x and of y, which go from -1 to 1 over the view; for red, green and blue"""
    multiplied: bool
    """whether a touch has changed the picture by as much more"""

    def over(self, image_shape: tuple[int, int]) -> Floats:
        """Return the (H, W, 3) light as a share of the reference's."""
        y, x = (np.linspace(-1, 1, n, dtype=np.float32) for n in image_shape)
        constant, across, down = self.gains.astype(np.float32)
        along = np.stack([(constant + np.outer(x, across)).ravel(), np.tile(down, len(x))])
        return np.asarray(np.stack([np.ones_like(y), y], axis=1) @ along).reshape(*image_shape, 3)

    @property
    def size(self) -> float:
        """Root mean square of the change over view and channels, as a share."""
        constant, across, down = self.gains
        return float(np.sqrt(((constant - 1) ** 2 + (across**2 + down**2) / 3).mean()))

    @property
    def most(self) -> float:
        """Largest change of a channel in the view, as a share."""
        constant, across, down = self.gains
        return float((np.abs(constant - 1) + np.abs(across) + np.abs(down)).max())

    def grey(self, reference: Floats) -> float:
        """Return `size` in grey levels of a reference."""
        return self.size * float(reference.mean())

    @property
    def refusal(self) -> str:
        """Why so much is not taken out, with the remedy; empty where it is."""
        if self.most <= MOST_CHANGE:
            return ""
        return (
            f"the light differs from the reference's by up to {self.most:.0%}, at most {MOST_CHANGE:.0%} can be taken "
            "out: take both under the same light, or adapt the calibration (`gellight calibrate adapt`)"
        )


def difference_of(image: NDArray[np.number], reference: Floats, *, follow_light: bool) -> Floats:
    """Return the (H, W, 3) difference image, grey levels; with `follow_light` as under the light of the reference.

    Where the light is too far off, perhaps because a touch fills the view, the median alone is taken off.
    """
    drift = light_drift(image, reference) if follow_light else None
    if drift is None or drift.refusal:
        difference: Floats = np.subtract(image, reference, dtype=np.float32)
        if drift is not None:
            difference -= np.median(difference, axis=(0, 1))
        return difference
    light = drift.over((reference.shape[0], reference.shape[1]))
    difference = np.subtract(image, reference * light, dtype=np.float32)
    if drift.multiplied:
        difference /= light
    return difference


def light_drift(image: NDArray[np.number], reference: NDArray[np.number]) -> LightDrift:
    """Compare the light of a (H, W, 3) picture with the reference's, grey levels.

    What is found is the light's as long as less than half of the view is touched.
    """
    now, then, terms = _cells(image, reference)
    told = (now < _WHITE_GREY).all(axis=1)
    if not told.any():
        return LightDrift(np.eye(3, 1) * np.ones(3), multiplied=False)
    now, then, terms = now[told], then[told], terms[told]
    gains, by_gains = _fitted(now, then, terms)
    plain = np.broadcast_to(then.mean(axis=0), then.shape)
    _, by_adding = _fitted(now - then + plain, plain, terms)
    return LightDrift(gains, multiplied=by_gains < BELIEVED * by_adding)


def _fitted(now: Array, then: Array, terms: Array) -> tuple[Array, float]:
    """Fit (3, 3) weights of (n, 3) terms, by which `then` becomes `now`, to (n, 3) cells.

    Least squares with Tukey's weights: cells that leave much do not count. Also returns what the median cell leaves.
    """
    weights = np.eye(3, 1) * np.median(now / np.maximum(then, 1), axis=0)
    products = (terms[:, :, None] * terms[:, None, :]).reshape(-1, 9)
    squared, mixed = (np.ascontiguousarray((then * by).T) for by in (then, now))
    for _ in range(_ROUNDS):
        left, typical_grey = _left(now, then, terms, weights)
        counts = np.maximum(0, 1 - (left / (_BEYOND * typical_grey)) ** 2) ** 2
        ridge = (typical_grey / _USUAL) ** 2 * np.eye(3)
        normal = ((squared * counts) @ products).reshape(3, 3, 3) + ridge
        weights = np.linalg.solve(normal, ((mixed * counts) @ terms + ridge[0])[..., None])[..., 0].T
    return weights, _left(now, then, terms, weights)[1]


def _left(now: Array, then: Array, terms: Array, weights: Array) -> tuple[Array, float]:
    apart = now - then * (terms @ weights)
    left = np.sqrt(np.einsum("ij,ij->i", apart, apart))
    return left, float(np.median(left)) + _LEAST_GREY


def _cells(image: NDArray[np.number], reference: NDArray[np.number]) -> tuple[Array, Array, Array]:
    """(n, 3) means of the cells of both, and (n, 3) 1, x and y of each."""
    side = min(CELL_PX, *image.shape[:2])
    now, then = block_means(image, side), block_means(reference, side)
    y, x = ((2 * side * np.arange(n) + side) / size - 1 for n, size in zip(now.shape[:2], image.shape[:2], strict=True))
    terms = np.stack([np.ones(now.shape[:2]), *np.meshgrid(x, y)], axis=2)
    step = max(1, int(np.sqrt(terms[..., 0].size / MOST_CELLS)))
    now, then, terms = (cells[::step, ::step].reshape(-1, 3).astype(np.float64) for cells in (now, then, terms))
    return now, then, terms
