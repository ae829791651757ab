"""Marker dots printed on the gel: found in its untouched picture, and filled in every picture from around them.

A dot is a dark spot smaller than anything a press makes: closing (dilating, then eroding) the picture by a disc that is
wider than a dot removes it, and what that changed is the dot ("black hat"). Dots move with the gel, so they are found
anew in each picture; what is remembered is how wide and how dark they are.
"""

from typing import Annotated

import cv2
import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field

Floats = NDArray[np.float32]
Bools = NDArray[np.bool_]
LEAST_DOTS = 9
"""fewer dark spots of one size are dirt"""
_DISCS_PX = (7, 11, 17, 25, 37)
_LEAST_GREY = 10.0
_DOT_SHARE = 0.4
"""of a dot's darkness: pixels that are darker than this belong to it"""
_ALIKE = 0.4
"""of the median diameter: how far the diameters of dots may be from it"""


class Dots(BaseModel):
    """How the dots of a gel look."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    diameter_px: Annotated[float, Field(gt=0, lt=200)]
    darker_grey: Annotated[float, Field(gt=0, le=255)]
    """by which a pixel of a dot is darker than the gel around it"""
    count: Annotated[int, Field(ge=LEAST_DOTS)]
    """in the untouched picture"""

    def mask(self, image: NDArray[np.uint8] | Floats) -> Bools:
        """Mark the (H, W) pixels of the dots of a (H, W, 3) picture, with a margin."""
        side = round(2 * self.diameter_px) | 1
        spots, sizes = _spots(_black_hat(image, side), self.darker_grey)
        most = (1.8 * self.diameter_px) ** 2
        chosen = (sizes[:, cv2.CC_STAT_AREA] <= most) & (np.arange(len(sizes)) > 0)
        margin = 2 * max(1, round(0.25 * self.diameter_px)) + 1
        return np.asarray(cv2.dilate(chosen[spots].astype(np.uint8), _disc(margin)), np.bool_)

    def filled(self, image: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """Return a (H, W, 3) uint8 picture whose dots have the mean colour of the gel around them."""
        return np.clip(np.rint(self.filled_grey(image.astype(np.float32), self.mask(image))), 0, 255).astype(np.uint8)

    def filled_grey(self, image: Floats, mask: Bools) -> Floats:
        """Fill a mask of a (H, W, 3) picture in grey levels, by means weighted with the distance."""
        weight = 1 - mask.astype(np.float32)
        total, sigma = image * weight[..., None], 0.4 * self.diameter_px
        result = image.copy()
        for reach in (4 * sigma, sigma):  # the near ones last, where there are some
            blurred, share = (cv2.GaussianBlur(values, (0, 0), reach) for values in (total, weight))
            known = mask & (share > 0.02)
            result[known] = blurred[known] / share[known, None]
        return result


def find_dots(untouched: NDArray[np.uint8] | Floats) -> Dots | None:
    """Return how the marker dots of a (H, W, 3) picture of the untouched gel look; None where it has none.

    Dots are at least 9 round dark spots of about one size, at least 10 grey levels darker than the gel.
    """
    for side in _DISCS_PX:
        if side > min(untouched.shape[:2]) // 3:
            break
        found = _dots(_black_hat(untouched, side), side)
        if found is not None:
            return found
    return None


def _dots(dark: Floats, side: int) -> Dots | None:
    """Return the dots that a disc of `side` px shows; None where the dark spots are no dots, or too wide for it."""
    strong = dark[dark > _LEAST_GREY]
    if len(strong) < LEAST_DOTS:
        return None
    threshold = max(_LEAST_GREY, _DOT_SHARE * float(np.percentile(strong, 90)))
    _, sizes = _spots(dark, threshold)
    area, width, height = (sizes[1:, kind] for kind in (cv2.CC_STAT_AREA, cv2.CC_STAT_WIDTH, cv2.CC_STAT_HEIGHT))
    round_enough = (np.maximum(width, height) <= 1.8 * np.minimum(width, height)) & (area > 0.5 * width * height)
    diameter = np.sqrt(4 / np.pi * area[round_enough & (area >= 5)])
    if len(diameter) < LEAST_DOTS:
        return None
    usual = float(np.median(diameter))
    alike = np.abs(diameter - usual) < _ALIKE * usual
    if alike.sum() < max(LEAST_DOTS, 0.5 * len(area)) or usual > 0.65 * side:
        return None
    return Dots(diameter_px=round(usual, 2), darker_grey=round(threshold, 2), count=int(alike.sum()))


def _black_hat(image: NDArray[np.uint8] | Floats, side: int) -> Floats:
    grey = image.mean(axis=2, dtype=np.float32)
    return np.asarray(cv2.morphologyEx(grey, cv2.MORPH_BLACKHAT, _disc(side)), np.float32)


def _spots(dark: Floats, threshold: float) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Number the connected dark spots: (H, W) numbers, 0 for none, and the figures of OpenCV for each number."""
    _, numbers, figures, _ = cv2.connectedComponentsWithStats((dark > threshold).astype(np.uint8))
    return np.asarray(numbers, np.int32), np.asarray(figures, np.int32)


def _disc(side: int) -> NDArray[np.uint8]:
    return np.asarray(cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (side, side)), np.uint8)
