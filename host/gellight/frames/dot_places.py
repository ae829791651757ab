"""Where the middles of marker dots are in a picture, to a few hundredths of a pixel.

Paint is dark in all three channels and shading is not, so the largest channel is looked at, as a share of the gel
around it: that the light falls off, or is half dark, does not matter.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import InputError

Floats = NDArray[np.float64]
LEAST_DOTS = 9
"""fewer dark spots of one size are dirt"""
DARKNESS_SHARE = 0.4
"""of the darkness of the untouched dots: what is less dark is no dot"""
_USUAL_PX = 5.0
"""pictures with wider dots are looked through at a smaller size, so that the time does not grow with the dots"""
_LEAST_DARKNESS = 0.06
"""as a share of the gel around it"""
_EDGE_SHARE = 0.35
"""of a dot's darkness: what is less dark does not count for its middle"""
_REACH = 0.8
"""diameters around a dot that its middle is found in"""
_BLACK_GREY = 4.0
"""where the gel is darker than that there is nothing to be darker than"""
_MOST_SPOTS = 2000
"""the darkest ones of a picture: twice the dots that a gel may have, and noise has any number"""


@dataclass(frozen=True, kw_only=True, eq=False)
class Spots:
    """Dark spots as wide as dots."""

    places_px: Floats
    """(M, 2) x, y of their middles"""
    darkness: NDArray[np.float32]
    """(M,) 0 is as bright as the gel around, 1 is black"""
    brightness_grey: float
    """of the gel, in its brightest channel"""


def find_spots(image: NDArray[np.uint8], diameter_px: float, least_darkness: float = _LEAST_DARKNESS) -> Spots:
    """Return the dark spots of a (H, W, 3) picture that are about as wide as dots and lie wholly in it."""
    bright = cv2.max(cv2.max(image[..., 0], image[..., 1]), image[..., 2])
    shrink = _shrink(diameter_px)
    height, width = (size // shrink for size in bright.shape)
    part = np.ascontiguousarray(bright[: height * shrink, : width * shrink])
    small = np.asarray(cv2.resize(part, (width, height), interpolation=cv2.INTER_AREA), np.uint8)
    around = _gel_around(small, diameter_px / shrink)
    dark = np.where(around > _BLACK_GREY, np.maximum(1 - small / around, 0, dtype=np.float32), np.float32(0))
    places, darkness = _peaks(dark, diameter_px / shrink, least_darkness)
    if len(places):
        for _ in range(2):  # the window follows the middle once
            places, inside = _middles(dark, places, diameter_px / shrink)
            darkness = darkness[inside]
    level = float(around[::8, ::8].mean())
    return Spots(places_px=(places + 0.5) * shrink - 0.5, darkness=darkness, brightness_grey=level)


def border_px(diameter_px: float) -> int:
    """Return how near to the border of the picture no spot is found, as it may lie beyond it in part."""
    shrink = _shrink(diameter_px)
    return shrink * (_reach(diameter_px / shrink) + 1)


def _shrink(diameter_px: float) -> int:
    return max(1, int(diameter_px / _USUAL_PX))


def _reach(diameter_px: float) -> int:
    return int(np.ceil(_REACH * diameter_px))


def _gel_around(small: NDArray[np.uint8], diameter_px: float) -> NDArray[np.float32]:
    """(h, w) how bright the gel would be without dots."""
    side = int(2.2 * diameter_px) | 1
    closed = cv2.morphologyEx(small, cv2.MORPH_CLOSE, np.ones((side, side), np.uint8))
    return np.maximum(cv2.blur(closed.astype(np.float32), (side, side)), _BLACK_GREY)


def _peaks(dark: NDArray[np.float32], diameter_px: float, least: float) -> tuple[Floats, NDArray[np.float32]]:
    """Return (M, 2) x, y and (M,) darkness of the darkest pixels within half a diameter."""
    from scipy.spatial import cKDTree  # SciPy takes longer than all else of a start

    smooth = cv2.GaussianBlur(dark, (0, 0), 0.3 * diameter_px)
    side = int(diameter_px) | 1
    rows, columns = np.nonzero((smooth >= cv2.dilate(smooth, np.ones((side, side), np.uint8))) & (smooth > least))
    darkest = np.argsort(-smooth[rows, columns], kind="stable")[:_MOST_SPOTS]
    rows, columns = rows[darkest], columns[darkest]
    places, alone = np.stack([columns, rows], axis=1).astype(np.float64), np.ones(len(rows), bool)
    if len(places):
        pairs = cKDTree(places).query_pairs(0.6 * diameter_px, output_type="ndarray")
        alone[pairs.max(axis=1)] = False  # beside a darker one it is the same spot
    return places[alone], np.asarray(smooth[rows, columns][alone], np.float32)


def _middles(dark: NDArray[np.float32], places: Floats, diameter_px: float) -> tuple[Floats, NDArray[np.bool_]]:
    """Return the centroids of the darkness around (M, 2) places, of those whose window is in the picture, and which."""
    reach = _reach(diameter_px)
    nearest = np.rint(places).astype(np.intp)
    beside = (nearest < reach) | (nearest >= np.array(dark.shape[::-1]) - reach)
    inside = np.asarray(~beside.any(axis=1))
    nearest = nearest[inside]
    offsets = np.arange(-reach, reach + 1)
    part = dark[nearest[:, 1, None, None] + offsets[:, None], nearest[:, 0, None, None] + offsets]
    part *= np.hypot(offsets[:, None], offsets) <= reach + 0.5
    part = np.maximum(part - _EDGE_SHARE * part.max(axis=(1, 2), keepdims=True), 0)
    total = np.maximum(part.sum(axis=(1, 2)), 1e-6)
    shift = np.stack([part.sum(axis=1) @ offsets, part.sum(axis=2) @ offsets], axis=1) / total[:, None]
    return nearest + shift, np.asarray(inside)


def dots_at_rest(untouched: NDArray[np.uint8], diameter_px: float) -> tuple[Floats, float]:
    """Return the (N, 2) places of the dots of the untouched gel, row by row, and their usual darkness, 0 to 1.

    InputError for fewer than `LEAST_DOTS`.
    """
    spots = find_spots(untouched, diameter_px)
    if len(spots.darkness):
        usual = float(np.median(spots.darkness[spots.darkness > 0.5 * np.percentile(spots.darkness, 75)]))
        places = spots.places_px[spots.darkness > DARKNESS_SHARE * usual]
        if len(places) >= LEAST_DOTS:
            return places[np.lexsort((places[:, 0], np.round(places[:, 1] / diameter_px)))], usual
    raise InputError(f"{len(spots.darkness)} marker dots are seen: light the gel and take everything off it")
