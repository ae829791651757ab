"""The error on held-out presses while presses still come in, by a cubic polynomial, which is fitted in a moment.

The polynomial maps colour change and place to slopes. Its normal equations are sums over presses, so a press is left
out by a subtraction, and each press can be judged by all others.
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from gellight.lab.training.polynomial import powers_up_to, terms_of
from gellight.lab.training.presses import Ball, Press, contact_circle, distance_px, sphere_gradient
from gellight.reconstruction.integration import angle_deg, normals

Floats = NDArray[np.float64]
SAMPLES = 500
_FLAT_SAMPLES = 150
_FLAT_DISTANCE = 3.0
_RIDGE = 1e-3
_POWERS = powers_up_to(3, 5)
LEAST = 5
"""presses before anything can be said"""
_OUTLIER = 3.0
_OUTLIER_DEG = 4.0


@dataclass(eq=False)
class LiveError:
    """Presses as sums for a least-squares fit, one entry a press."""

    reference: NDArray[np.float32]
    ball: Ball
    _inputs: dict[int, Floats] = field(default_factory=dict)
    _slopes: dict[int, Floats] = field(default_factory=dict)
    history: list[tuple[int, float]] = field(default_factory=list)
    """(presses, held-out normal error in degrees) after each press"""
    by_press: dict[int, float] = field(default_factory=dict)
    """the error of each press, judged by the others, degrees"""

    def add(self, number: int, image: NDArray[np.uint8], press: Press) -> None:
        """Take a press in, or again with a corrected circle."""
        shape = (image.shape[0], image.shape[1])
        random = np.random.default_rng(number)
        inside = np.flatnonzero(contact_circle(press, shape))
        far = np.flatnonzero(distance_px(press, shape) > _FLAT_DISTANCE * press.contact_radius_px)
        inside = random.choice(inside, min(SAMPLES, len(inside)), replace=False)
        far = random.choice(far, min(_FLAT_SAMPLES, len(far)), replace=False)
        chosen = np.concatenate([inside, far])
        gradient = sphere_gradient(press, self.ball, shape).reshape(-1, 2)
        difference = (image.astype(np.float32) - self.reference).reshape(-1, 3)[chosen]
        x, y = 2 * (chosen % shape[1]) / shape[1] - 1, 2 * (chosen // shape[1]) / shape[0] - 1
        # Five inputs, each scaled to about one.
        self._inputs[number] = terms_of([*(difference / 64.0).T, x, y], _POWERS)
        self._slopes[number] = np.concatenate([gradient[inside], np.zeros((len(far), 2))])

    def drop(self, number: int) -> None:
        """Forget a press."""
        self._inputs.pop(number, None)
        self._slopes.pop(number, None)
        self.by_press.pop(number, None)

    def update(self) -> None:
        """Judge every press by all others and add the mean error to `history`; not while there are too few."""
        if len(self._inputs) < LEAST:
            return
        squares = {n: a.T @ a for n, a in self._inputs.items()}
        products = {n: a.T @ self._slopes[n] for n, a in self._inputs.items()}
        all_squares = sum(squares.values()) + _RIDGE * np.eye(len(_POWERS)) * SAMPLES
        all_products = sum(products.values())
        for n, inputs in self._inputs.items():
            amounts = np.linalg.solve(all_squares - squares[n], all_products - products[n])
            guess = (inputs @ amounts)[:, None, :]
            true = self._slopes[n][:, None, :]
            self.by_press[n] = float(angle_deg(normals(guess)[:, 0], normals(true)[:, 0])[:SAMPLES].mean())
        self.history.append((len(self._inputs), float(np.mean(list(self.by_press.values())))))

    def settled(self) -> bool:
        """Tell whether the last eight presses improved the error by less than 5 %."""
        if len(self.history) < 12:
            return False
        errors = [error for _, error in self.history]
        return float(np.mean(errors[-4:])) > 0.95 * float(np.mean(errors[-12:-8]))

    def outliers(self) -> list[int]:
        """Return presses that the others contradict: a wrong circle, a slipped ball."""
        if len(self.by_press) < 2 * LEAST:
            return []
        usual = float(np.median(list(self.by_press.values())))
        return [n for n, error in self.by_press.items() if error > max(_OUTLIER * usual, usual + _OUTLIER_DEG)]
