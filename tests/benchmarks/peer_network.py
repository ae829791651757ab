"""The network of gs_sdk by its published recipe, written anew: what the benchmarks on real images compare with.

It takes the colour itself, not its change, and the place, all between 0 and 1; three hidden layers of 32 ReLU; the
answer is the two angles of the slope, in radians. At run time the slope of the untouched picture is taken off. It is
trained with the mean absolute error by Adam from a rate of 2e-3, which halves every ten epochs, in batches of 1024, for
200 epochs, on the contact circles less 4 px and on a fifth as many pixels of the untouched picture. Depth is its own
integral (`integrators.gs_sdk`).
"""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from gellight.lab.training.presses import Ball, Press, distance_px, sphere_gradient
from tests.benchmarks.integrators import gs_sdk

Floats = NDArray[np.float32]
EPOCHS, BATCH, RATE, HALVED_EVERY = 200, 1024, 2e-3, 10
SIZES = (5, 32, 32, 32, 2)
INSET_PX, FLAT_SHARE = 4.0, 0.2
_FIRST, _SECOND = 0.9, 0.999


class PeerNetwork:
    def __init__(self, presses: Sequence[Press], untouched: Floats, ball: Ball, seed: int = 0) -> None:
        """Train on labelled presses and the (H, W, 3) untouched picture."""
        self._random, self._untouched = np.random.default_rng(seed), untouched
        self._weights = [
            self._random.uniform(-1, 1, (n + 1, m)).astype(np.float32) / np.float32(np.sqrt(n))
            for n, m in pairwise(SIZES)
        ]
        self._train(*self._table(presses, ball))
        self._zero = np.tan(self._answer(_rows(untouched)))

    def gradient_map(self, image: NDArray[np.uint8]) -> Floats:
        """Return the (H, W, 2) slopes of a picture."""
        slopes = np.tan(self._answer(_rows(image))) - self._zero
        return np.asarray(slopes.reshape(*image.shape[:2], 2), np.float32)

    def felt(self, image: NDArray[np.uint8], pixel_size_mm: float) -> tuple[Floats, NDArray[np.float64]]:
        """Return the (H, W, 2) slopes of a picture and its (H, W) depth, mm, whose median is 0."""
        slopes = self.gradient_map(image)
        depth = gs_sdk(slopes.astype(np.float64)) * pixel_size_mm
        return slopes, np.asarray(depth - np.median(depth))

    def _table(self, presses: Sequence[Press], ball: Ball) -> tuple[Floats, Floats]:
        rows, angles = [], []
        shape = (self._untouched.shape[0], self._untouched.shape[1])
        for press in presses:
            inside = np.flatnonzero(distance_px(press, shape) < press.contact_radius_px - INSET_PX)
            rows.append(_rows(press.picture())[inside])
            angles.append(np.arctan(sphere_gradient(press, ball, shape).reshape(-1, 2)[inside]))
            flat = self._random.choice(shape[0] * shape[1], round(FLAT_SHARE * len(inside)), replace=False)
            rows.append(_rows(self._untouched)[flat])
            angles.append(np.zeros((len(flat), 2), np.float32))
        return np.concatenate(rows), np.concatenate(angles)

    def _train(self, rows: Floats, angles: Floats) -> None:
        moments = [[np.zeros_like(w), np.zeros_like(w)] for w in self._weights]
        step = 0
        for epoch in range(EPOCHS):
            rate, order = RATE * 0.5 ** (epoch // HALVED_EVERY), self._random.permutation(len(rows))
            for start in range(0, len(rows), BATCH):
                some, step = order[start : start + BATCH], step + 1
                scale = rate * np.sqrt(1 - _SECOND**step) / (1 - _FIRST**step)
                for weights, slope, (first, second) in zip(
                    self._weights, self._slopes(rows[some], angles[some]), moments, strict=True
                ):
                    first += (1 - _FIRST) * (slope - first)
                    second += (1 - _SECOND) * (slope**2 - second)
                    weights -= np.float32(scale) * first / (np.sqrt(second) + np.float32(1e-8))

    def _slopes(self, rows: Floats, angles: Floats) -> list[Floats]:
        """Derivatives of the mean absolute error by the weights of each layer."""
        inputs = self._layers(rows)
        back, found = np.sign(inputs.pop() - angles) / np.float32(angles.size), []
        for values, weights in zip(inputs[::-1], self._weights[::-1], strict=True):
            found.append(np.concatenate([values.T @ back, back.sum(axis=0, keepdims=True)]))
            back = back @ weights[:-1].T * (values > 0)
        return found[::-1]

    def _layers(self, rows: Floats) -> list[Floats]:
        values = [rows]
        for number, weights in enumerate(self._weights):
            value = values[-1] @ weights[:-1] + weights[-1]
            values.append(np.maximum(value, 0) if number < len(self._weights) - 1 else value)
        return values

    def _answer(self, rows: Floats) -> Floats:
        return self._layers(rows)[-1]


def _rows(image: NDArray[np.number]) -> Floats:
    """(H * W, 5) colour and place of each pixel, between 0 and 1."""
    height, width = image.shape[:2]
    y, x = np.indices((height, width), dtype=np.float32)
    colour = image.reshape(-1, 3).astype(np.float32) / 255
    return np.concatenate([colour, (x / width).reshape(-1, 1), (y / height).reshape(-1, 1)], axis=1)
