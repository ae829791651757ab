"""Marker dots printed on the gel: found in its untouched picture, and filled in every picture from around them.

A dot is a dark spot smaller than anything a press makes: closing (dilating, then eroding) the picture by a disc that is
wider than a dot removes it, and what that changed is the dot ("black hat"). Dots move with the gel, so they are found
anew in each picture; what is remembered is how wide and how dark they are, and where they were on the untouched gel, by
which `dot_following.py` tells one from the other.

Dots are looked for in a picture at most 640 px wide, and wide ones are filled in one of half the size, or of a quarter
and so on: what is filled in is smooth.
"""

from typing import Annotated, Any

import cv2
import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field

from gellight.base.errors import InputError
from gellight.frames.dot_places import LEAST_DOTS, dots_at_rest
from gellight.frames.shear import MOST_DOTS

Floats = NDArray[np.float32]
Bools = NDArray[np.bool_]
_HALVED_PX = 8.0
"""from this diameter on half of the resolution is enough, of four times that on a quarter"""
_SEARCHED_PX = 640
"""width at which dots are looked for, whatever the camera's mode"""
_DISCS_PX = (7, 11, 17, 25, 37)  # chosen: each half as wide again; a disc finds dots of up to 0.65 of it
_WHOLE_PX = 17
"""wider discs look at a picture of half the size, for their time grows with their area"""
_LEAST_GREY = 10.0  # chosen: a fainter spot is no dot
_MEAN = np.full((1, 3), 1 / 3, np.float32)
"""of the channels"""
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
    places_px: tuple[tuple[float, float], ...] = ()
    """x, y of each on the untouched gel; none in bundles of before"""
    darkness: Annotated[float, Field(ge=0, le=1)] = 0.0
    """of a dot there, as a share of the gel around it; 0 in bundles of before"""

    def mask(self, image: NDArray[np.uint8] | Floats) -> Bools:
        """Mark the (H, W) pixels of the dots of a (H, W, 3) picture, with a margin."""
        small = self._small(image)
        marked = self._marked(small, self.diameter_px * len(small) / len(image))
        return _enlarged(marked.view(np.uint8), image.shape, cv2.INTER_NEAREST).view(np.bool_)

    def filled(self, image: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """Return a (H, W, 3) uint8 picture whose dots have the mean colour of the gel around them."""
        small = self._small(image)
        diameter = self.diameter_px * len(small) / len(image)
        mask = self._marked(small, diameter)
        smooth = _smoothed(small.astype(np.float32), mask, diameter)
        colours = np.asarray(_enlarged(smooth, image.shape, cv2.INTER_LINEAR) + np.float32(0.5), np.uint8)
        return np.asarray(
            cv2.copyTo(colours, _enlarged(mask.view(np.uint8), image.shape, cv2.INTER_NEAREST), image.copy())
        )

    def filled_grey(self, image: Floats, mask: Bools) -> Floats:
        """Fill a mask of a (H, W, 3) picture in grey levels, by means weighted with the distance."""
        return np.where(mask[..., None], _smoothed(image, mask, self.diameter_px), image)

    def _small(self, image: NDArray[Any]) -> NDArray[Any]:
        if self.diameter_px < _HALVED_PX:
            return image
        shrink = max(2, 2 ** int(np.log2(self.diameter_px / _HALVED_PX)))
        small = image.shape[1] // shrink, image.shape[0] // shrink
        return cv2.resize(image, small, interpolation=cv2.INTER_AREA)

    def _marked(self, image: NDArray[Any], diameter_px: float) -> Bools:
        spots, sizes = _spots(_black_hat(image, round(2 * diameter_px) | 1), self.darker_grey)
        most = (1.8 * diameter_px) ** 2
        chosen = (sizes[:, cv2.CC_STAT_AREA] <= most) & (np.arange(len(sizes)) > 0)
        margin = 2 * max(1, round(0.25 * diameter_px)) + 1
        return np.asarray(cv2.dilate(chosen[spots].astype(np.uint8), _disc(margin)), np.bool_)


def _smoothed(image: Floats, mask: Bools, diameter_px: float) -> Floats:
    """Return the (H, W, 3) means around each pixel of what is not masked; of near pixels where there are some."""
    weight, sigma = 1 - mask.astype(np.float32), 0.4 * diameter_px
    known = np.dstack([image * weight[..., None], weight])
    near = cv2.GaussianBlur(known, (0, 0), sigma)
    lost = near[..., 3] <= 0.02
    if lost.any():
        near[lost] = cv2.GaussianBlur(known, (0, 0), 4 * sigma)[lost]
    return np.asarray(near[..., :3] / np.maximum(near[..., 3:], 1e-6), np.float32)


def _enlarged(values: NDArray[Any], shape: tuple[int, ...], how: int) -> NDArray[Any]:
    """Return (h, w, ...) values at the (H, W) pixels of a picture."""
    return values if values.shape[:2] == shape[:2] else cv2.resize(values, (shape[1], shape[0]), interpolation=how)


def find_dots(untouched: NDArray[np.uint8] | Floats) -> Dots | None:
    """Return how the marker dots of a (H, W, 3) picture of the untouched gel look; None where it has none.

    Dots are at least 9 round dark spots of about one size, at least 10 grey levels darker than the gel.
    """
    wider = max(1.0, untouched.shape[1] / _SEARCHED_PX)
    small = _smaller(untouched, wider)
    for side in _DISCS_PX:
        if side > min(small.shape[:2]) // 3:
            break
        shrink = 1.0 if side <= _WHOLE_PX else 2.0
        found = _dots(_black_hat(_smaller(small, shrink), int(side / shrink) | 1), side / shrink)
        if found is not None:
            wide = found.model_copy(update={"diameter_px": round(found.diameter_px * shrink * wider, 2)})
            return _with_places(wide, untouched)
    return None


def _smaller(image: NDArray[Any], times: float) -> NDArray[Any]:
    size = round(image.shape[1] / times), round(image.shape[0] / times)
    return cv2.resize(image, size, interpolation=cv2.INTER_AREA) if times > 1 else image


def _with_places(dots: Dots, untouched: NDArray[Any]) -> Dots:
    try:
        places, darkness = dots_at_rest(np.asarray(np.rint(untouched), np.uint8), dots.diameter_px)
    except InputError:  # Spots that are too near to the border for their middle; they are filled all the same.
        return dots
    kept = tuple((round(x, 3), round(y, 3)) for x, y in places.tolist())
    return dots.model_copy(update={"places_px": kept, "darkness": round(darkness, 3)})


def _dots(dark: NDArray[Any], side: float) -> Dots | None:
    """Return the dots that a disc of `side` px shows; None where the dark spots are no dots, or too wide for it."""
    strong = dark[dark > _LEAST_GREY]
    if len(strong) < LEAST_DOTS:
        return None
    ordered = np.sort(strong, kind="stable")  # of bytes, and then their percentile, the fastest there is
    threshold = max(_LEAST_GREY, _DOT_SHARE * float(np.percentile(ordered, 90)))
    _, sizes = _spots(dark, threshold)
    area, width, height = (sizes[1:, kind] for kind in (cv2.CC_STAT_AREA, cv2.CC_STAT_WIDTH, cv2.CC_STAT_HEIGHT))
    round_enough = (np.maximum(width, height) <= 1.8 * np.minimum(width, height)) & (area > 0.5 * width * height)
    diameter = np.sqrt(4 / np.pi * area[round_enough & (area >= 5)])
    if len(diameter) < LEAST_DOTS:
        return None
    usual = float(np.median(diameter))
    alike = np.abs(diameter - usual) < _ALIKE * usual
    if not max(LEAST_DOTS, 0.5 * len(area)) <= alike.sum() <= MOST_DOTS or usual > 0.65 * side:
        return None
    return Dots(diameter_px=round(usual, 2), darker_grey=round(threshold, 2), count=int(alike.sum()))


def _black_hat(image: NDArray[Any], side: int) -> NDArray[Any]:
    """Return how much darker than their surroundings the pixels are, in the numbers of the picture."""
    return cv2.morphologyEx(cv2.transform(image, _MEAN), cv2.MORPH_BLACKHAT, _disc(side))


def _spots(dark: NDArray[Any], threshold: float) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Number the connected dark spots: (H, W) numbers, 0 for none, and the figures of OpenCV for each number."""
    _, numbers, figures, _ = cv2.connectedComponentsWithStats((dark > threshold).view(np.uint8))
    return np.asarray(numbers, np.int32), np.asarray(figures, np.int32)


def _disc(side: int) -> NDArray[np.uint8]:
    return np.asarray(cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (side, side)), np.uint8)
