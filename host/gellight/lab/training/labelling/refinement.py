"""Circles corrected by what all presses of one sensor have in common.

Circles that were drawn by hand are some pixels off, each in its own way, while the gel shows the same slope in the same
colour in every image. So one response of the light, shared by all images, is fitted together with the circles, in
turns: first the response to all other images, then each circle to that response. A circle is never fitted to a response
that was fitted to its own image: such a response agrees with the circle as it is, right or wrong.

Two things are held fixed. The radius of the ball is known and never fitted. The mean shift over all presses stays 0,
because a common shift of all circles looks the same as another response of the light.

The contact radius is the light's where it is sure: at the rim the slope falls in a step, which each image shows by
itself. Circles that were drawn by hand lie outside it, on the first fall of the skirt; on a real sensor by 14 %, where
the gel has two thirds of the slope that the ball would give it. So a radius is that of the fit of its image alone,
times what the shared response says of all of them: fitted one by one to that response radii scatter more than they did
(on simulated presses .20 to .27 px for .13; on a real sensor by a fifth of the radius), for a wide skirt with a small
contact explains nearly the same. Where less than half of the presses show a clear ball, each radius stays as labelled.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import InputError
from gellight.lab.training.labelling.circle import fit_circle
from gellight.lab.training.labelling.pattern import (
    LEAST_QUALITY,
    STEEPEST,
    PixelSample,
    PressShape,
    background,
    difference_image,
    fitted,
    response,
    sampled_around,
    without,
)
from gellight.lab.training.presses import Ball, Press

Array = NDArray[np.float64]
_ROUNDS = 2
_RIDGE, _PLACE_RIDGE = 1e-4, 0.1
"""of the response, and of what it changes over the view: relative to the squares of all presses, and of one of them"""
_VIEW_COSTS = (0, 1, 1)
"""of the terms over the view, in place ridges"""
_FARTHEST = 0.35
"""in ball radii: a circle that would move farther keeps its label, and is named"""
LEAST_PRESSES = 5


@dataclass(frozen=True, kw_only=True, eq=False)
class Refined:
    """Refined presses, and what is needed to refine others of the same sensor."""

    presses: list[Press]
    kept: list[str]
    """names of images whose circle stayed as labelled, because the fit would have moved it too far"""
    rms_shift_px: float
    """root mean square distance by which the centres moved"""
    offset: Array
    """(3,) mean of fitted minus labelled x, y, radius, px, that was taken off; 0 for a radius that the light decides"""
    radius_share: float
    """mean contact radius that the light shows over that of the labels"""
    alone_share: float | None
    """the same over that of the fits of single images; None where each radius stays as labelled"""
    sure: int
    """presses whose radius the light decides"""
    coefficients: Array
    """(K, 3) the shared response"""

    @property
    def place_error_px(self) -> float:
        """How far all circles together may lie beside: their mean place is that of labels that scatter, and stays."""
        return float(self.rms_shift_px / np.sqrt(len(self.presses)))

    def record(self) -> dict[str, object]:
        """Return what a bundle says of it."""
        return {
            "rms_shift_px": round(self.rms_shift_px, 3),
            "place_error_px": round(self.place_error_px, 3),
            "offset_px": [round(float(value), 3) for value in self.offset],
            "radius_of_light_over_label": round(self.radius_share, 4),
            "radius_by_light_images": self.sure,
            "kept_images": self.kept,
        }


@dataclass(frozen=True, kw_only=True)
class _Fit:
    """One press while it is fitted."""

    press: Press
    pixels: PixelSample
    shape: PressShape
    sure: bool
    """whether the image alone shows one clear ball, and so the radius of its contact"""


class FirstFits:
    """Each press fitted by itself, from its label: what refinement begins with, the same in every fold."""

    def __init__(self, reference: NDArray[np.number], ball: Ball) -> None:
        """Compare with the (H, W, 3) reference, grey levels."""
        self._reference, self._ball = reference, ball
        self._known: dict[Press, _Fit] = {}

    def of(self, press: Press) -> _Fit:
        """Return the fit; InputError where the image is none of this sensor."""
        if press not in self._known:
            difference, ball_radius = difference_image(press.picture(), self._reference), self._ball.radius_px
            center, radius = (press.center_x_px, press.center_y_px), press.contact_radius_px
            shape, circle = fit_circle(difference, center, radius, ball_radius)
            pixels = sampled_around(difference, (shape.center_x, shape.center_y), shape.contact_radius, ball_radius)
            self._known[press] = _Fit(press=press, pixels=pixels, shape=shape, sure=circle.quality >= LEAST_QUALITY)
        return self._known[press]


def refine(
    presses: Sequence[Press], reference: NDArray[np.number], ball: Ball, *, first: FirstFits | None = None
) -> Refined:
    """Refit the circles of all presses together with the response of the light; reference is (H, W, 3), grey levels.

    first: keeps the first fit of each press, which saves time when the same presses are refined again.
    Raises InputError for fewer than 5 presses: too few to correct each other.
    """
    if len(presses) < LEAST_PRESSES:
        raise InputError(f"{len(presses)} presses cannot be refined: give at least {LEAST_PRESSES}")
    first = first or FirstFits(reference, ball)
    fits = [first.of(press) for press in presses]
    extent = _extent(reference)
    for _ in range(_ROUNDS):
        sums = [_normal_equations(fit, ball, extent) for fit in fits]
        total = _sum(sums)
        fits = [
            _fitted_to(fit, _solve(total[0] - own[0], total[1] - own[1], len(fits) - 1), ball, extent)
            for fit, own in zip(fits, sums, strict=True)
        ]
    coefficients = _solve(*_sum([_normal_equations(fit, ball, extent) for fit in fits]), len(fits))
    moves = np.array([_move(fit) for fit in fits])
    near = np.hypot(*(moves[:, :2] - np.median(moves[:, :2], axis=0)).T) < _FARTHEST * ball.radius_px
    offset = np.asarray(moves[near].mean(axis=0) if near.any() else np.zeros(3), np.float64)
    sure, share, alone_share = near & np.array([fit.sure for fit in fits]), _radius_share(fits, moves, near), None
    if decides := bool(2 * sure.sum() >= len(fits)):
        share, offset[2] = _radius_share(fits, moves, sure), 0.0
        alone_share = _over_fits_alone(fits, first, sure)
    moved = [
        _moved(first.of(fit.press), move - offset, share, alone_share, ball)
        for fit, move in zip(fits, moves, strict=True)
    ]
    return Refined(
        presses=[new if is_near else old for new, old, is_near in zip(moved, presses, near, strict=True)],
        kept=[press.image.name for press, is_near in zip(presses, near, strict=True) if not is_near],
        rms_shift_px=float(np.sqrt((np.hypot(*(moves[near, :2] - offset[:2]).T) ** 2).mean())) if near.any() else 0.0,
        offset=offset,
        radius_share=share,
        alone_share=alone_share,
        sure=int(sure.sum()) if decides else 0,
        coefficients=coefficients,
    )


def refine_others(
    refined: Refined,
    presses: Sequence[Press],
    reference: NDArray[np.number],
    ball: Ball,
    *,
    first: FirstFits | None = None,
) -> list[Press]:
    """Refit circles that had no part in `refined`, by its response and its offset; nothing is fitted to them."""
    first = first or FirstFits(reference, ball)
    result = []
    for press in presses:
        move = _move(_fitted_to(first.of(press), refined.coefficients, ball, _extent(reference))) - refined.offset
        near = np.hypot(*move[:2]) < _FARTHEST * ball.radius_px
        moved = _moved(first.of(press), move, refined.radius_share, refined.alone_share, ball)
        result.append(moved if near else press)
    return result


def _extent(reference: NDArray[np.number]) -> tuple[float, float]:
    """(W, H) px"""
    return float(reference.shape[1]), float(reference.shape[0])


def _columns(pixels: PixelSample, shape: PressShape, ball: Ball, extent: tuple[float, float]) -> Array:
    """(N, K) the response at each pixel, changing linearly over the view."""
    pattern = response(pixels.x, pixels.y, shape, ball.radius_px)
    return np.concatenate([pattern * share[:, None] for share in _over_the_view(pixels, extent)], axis=1)


def _over_the_view(pixels: PixelSample, extent: tuple[float, float]) -> tuple[Array, Array, Array]:
    """(N,) what the response is at each pixel: a constant, and what changes across and down the view."""
    return np.ones_like(pixels.x), 2 * pixels.x / extent[0] - 1, 2 * pixels.y / extent[1] - 1


def _normal_equations(fit: _Fit, ball: Ball, extent: tuple[float, float]) -> tuple[Array, Array]:
    """What one press says of the response; its own background is eliminated."""
    drift = background(fit.pixels.x, fit.pixels.y, fit.shape, ball.radius_px)
    columns = without(drift, _columns(fit.pixels, fit.shape, ball, extent))
    return columns.T @ columns, columns.T @ fit.pixels.colour


def _sum(parts: list[tuple[Array, Array]]) -> tuple[Array, Array]:
    square, right = (np.sum([part[i] for part in parts], axis=0) for i in (0, 1))
    return np.asarray(square), np.asarray(right)


def _solve(square: Array, right: Array, presses: int) -> Array:
    """Return the response that so many presses say, with little change over the view where they are few.

    On simulated uneven light circles of 8 presses come out .33 px from the truth, without that .41 px. A quadratic over
    the view is .04 px better there from 20 presses on, and worse on each of four real sensors.
    """
    single = np.diag(square).reshape(len(_VIEW_COSTS), -1)[0] / presses
    penalty = _PLACE_RIDGE * np.outer(_VIEW_COSTS, single).ravel() + _RIDGE * np.diag(square)
    return np.asarray(np.linalg.solve(square + np.diag(penalty), right), np.float64)


def _fitted_to(fit: _Fit, coefficients: Array, ball: Ball, extent: tuple[float, float]) -> _Fit:
    """Fit the circle to a response that is given."""
    pixels = fit.pixels

    def left(vector: Array) -> Array:
        shape = PressShape.of(vector)
        explained = _columns(pixels, shape, ball, extent) @ coefficients
        return without(background(pixels.x, pixels.y, shape, ball.radius_px), pixels.colour - explained)

    return replace(fit, shape=fitted(left, fit.shape, ball.radius_px))


def _move(fit: _Fit) -> Array:
    """(3,) fitted minus labelled x, y and radius, px"""
    shape, press = fit.shape, fit.press
    fitted_circle = np.array([shape.center_x, shape.center_y, shape.contact_radius])
    return fitted_circle - (press.center_x_px, press.center_y_px, press.contact_radius_px)


def _radius_share(fits: list[_Fit], moves: Array, chosen: NDArray[np.bool_]) -> float:
    """Mean fitted radius of the chosen presses over that of their labels; 1 where none is chosen."""
    labelled = np.array([fit.press.contact_radius_px for fit in fits])[chosen]
    return float(1 + moves[chosen, 2].sum() / labelled.sum()) if chosen.any() else 1.0


def _over_fits_alone(fits: list[_Fit], first: FirstFits, chosen: NDArray[np.bool_]) -> float:
    """Mean fitted radius of the chosen presses over that of the fits of their images by themselves."""
    pairs = [(fit.shape.contact_radius, first.of(fit.press).shape.contact_radius) for fit in fits]
    together, alone = np.array(pairs)[chosen].sum(axis=0)
    return float(together / alone)


def _moved(alone: _Fit, move: Array, share: float, alone_share: float | None, ball: Ball) -> Press:
    """Move a label by (x, y), px, and set its radius; alone: the fit of its image by itself."""
    press = alone.press
    radius = press.contact_radius_px
    if alone_share is not None:
        radius = alone_share * alone.shape.contact_radius if alone.sure else share * radius
    return replace(
        press,
        center_x_px=press.center_x_px + float(move[0]),
        center_y_px=press.center_y_px + float(move[1]),
        contact_radius_px=min(radius, STEEPEST * ball.radius_px),
        found=press.found or alone_share is not None,
    )
