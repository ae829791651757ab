"""The error on held-out presses while presses still come in, by cubic polynomials, which are fitted in a moment.

One polynomial maps the change of the colours to slopes, the other colours and place, which few presses cannot tell: the
better one counts. The normal equations are sums over presses, so a press is left out by a subtraction, and each press
can be judged by all others.
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from gellight.lab.training.polynomial import powers_up_to, terms_of
from gellight.lab.training.presses import Ball, Press, contact_circle, distance_px, sphere_gradient
from gellight.reconstruction.integration import angle_deg, integrate, normals

Floats = NDArray[np.float64]
SIDE = 25
"""pixels along the diameter of a contact that are looked at"""
_FLAT_SAMPLES = 150  # chosen: pixels of the gel at rest beside each press
_FLAT_DISTANCE = 3.0  # chosen: contact radii from the middle, where the gel is taken to be at rest
_RIDGE = 0.5  # chosen: the sums of two presses can be solved; 1e-3 served from five on
_POWERS = powers_up_to(3, 5)
_MODELS = (np.arange(len(_POWERS)), np.flatnonzero([powers[3:] == (0, 0) for powers in _POWERS]))
"""the terms of each polynomial: of colours and place, of colours alone"""
LEAST = 2
"""presses before anything can be said"""
_OUTLIER_PRESSES = 10  # chosen: of fewer, the median may be wrong itself
_OUTLIER = 3.0  # chosen: times the median error
_OUTLIER_DEG = 4.0  # chosen: and so much above it, where all are good
SETTLED = 3
"""presses in a row after which a target is reached for good"""


@dataclass(frozen=True, eq=False)
class _Learnt:
    """One press: N pixels inside its circle, then some of the untouched gel."""

    inside: NDArray[np.bool_]
    """(h, w) of a grid over the circle: which of its pixels are those N"""
    grid_mm: float
    terms: Floats
    """(N + M, 56)"""
    slopes: Floats
    """(N + M, 2)"""

    def errors(self, weights: NDArray[np.floating], model: NDArray[np.intp]) -> tuple[float, float]:
        """Return the mean error of the normals, degrees, and of the depth beside its mean, mm, inside the circle."""
        count = int(self.inside.sum())
        off = np.zeros((*self.inside.shape, 2))
        off[self.inside] = self.terms[:count, model] @ weights - self.slopes[:count]
        true = self.slopes[:count]
        depth_mm = integrate(off, (self.grid_mm, self.grid_mm))[self.inside]
        angle = angle_deg(normals((off[self.inside] + true)[:, None])[:, 0], normals(true[:, None])[:, 0])
        return float(angle.mean()), float(np.abs(depth_mm - depth_mm.mean()).mean())


@dataclass(eq=False)
class LiveError:
    """Presses as sums for a least-squares fit, one entry a press."""

    reference: NDArray[np.float32]
    ball: Ball
    _learnt: dict[int, _Learnt] = field(default_factory=dict)
    history: list[tuple[int, float]] = field(default_factory=list)
    """(presses, held-out normal error in degrees) after each press"""
    depth_um: list[float] = field(default_factory=list)
    """held-out error of the depth beside its contact's mean, as `history`"""
    by_press: dict[int, float] = field(default_factory=dict)
    """the error of each press, judged by the others, degrees"""

    def add(self, number: int, image: NDArray[np.uint8], press: Press) -> None:
        """Take a press in, or again with a corrected circle."""
        shape = (image.shape[0], image.shape[1])
        step = max(1, round(2 * press.contact_radius_px / SIDE))
        inside = contact_circle(press, shape)[::step, ::step]
        rows, columns = np.flatnonzero(inside.any(axis=1)), np.flatnonzero(inside.any(axis=0))
        box = np.s_[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
        pixels = np.arange(shape[0] * shape[1]).reshape(shape)[::step, ::step][box][inside[box]]
        far = np.flatnonzero(distance_px(press, shape) > _FLAT_DISTANCE * press.contact_radius_px)
        far = np.random.default_rng(number).choice(far, min(_FLAT_SAMPLES, len(far)), replace=False)
        chosen = np.concatenate([pixels, far])
        difference = (image.astype(np.float32) - self.reference).reshape(-1, 3)[chosen]
        x, y = 2 * (chosen % shape[1]) / shape[1] - 1, 2 * (chosen // shape[1]) / shape[0] - 1
        self._learnt[number] = _Learnt(
            inside=inside[box],
            grid_mm=step * self.ball.pixel_size_mm,
            # Five inputs, each scaled to about one.
            terms=terms_of([*(difference / 64.0).T, x, y], _POWERS),
            slopes=np.concatenate([sphere_gradient(press, self.ball, shape, pixels), np.zeros((len(far), 2))]),
        )

    def drop(self, number: int) -> None:
        """Forget a press."""
        self._learnt.pop(number, None)
        self.by_press.pop(number, None)

    def update(self) -> None:
        """Judge every press by all others and add the mean error to `history`; not while there are too few."""
        if len(self._learnt) < LEAST:
            return
        squares = {n: one.terms.T @ one.terms for n, one in self._learnt.items()}
        products = {n: one.terms.T @ one.slopes for n, one in self._learnt.items()}
        square = sum(squares.values()) + _RIDGE * np.eye(len(_POWERS))
        product = sum(products.values())
        judged = []
        for model in _MODELS:
            some = np.ix_(model, model)
            judged.append({
                n: one.errors(np.linalg.solve((square - squares[n])[some], (product - products[n])[model]), model)
                for n, one in self._learnt.items()
            })  # fmt: skip
        best = min(judged, key=lambda errors: sum(degrees for degrees, _ in errors.values()))
        self.by_press = {n: degrees for n, (degrees, _) in best.items()}
        self.history.append((len(best), float(np.mean(list(self.by_press.values())))))
        self.depth_um.append(1e3 * float(np.mean([mm for _, mm in best.values()])))

    def settled(self) -> bool:
        """Tell whether the last eight presses improved the error by less than 5 %."""
        if len(self.history) < 12:
            return False
        errors = [error for _, error in self.history]
        return float(np.mean(errors[-4:])) > 0.95 * float(np.mean(errors[-12:-8]))

    def reached(self, depth_um: float) -> bool:
        """Tell whether the held-out error of the depth was this small after each of the last presses."""
        return len(self.depth_um) >= SETTLED and max(self.depth_um[-SETTLED:]) <= depth_um

    def outliers(self) -> list[int]:
        """Return presses that the others contradict: a wrong circle, a slipped ball."""
        if len(self.by_press) < _OUTLIER_PRESSES:
            return []
        usual = float(np.median(list(self.by_press.values())))
        return [n for n, error in self.by_press.items() if error > max(_OUTLIER * usual, usual + _OUTLIER_DEG)]
