"""Depth map to contact: where the gel is touched, how deep, how large."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gellight.frames.frames import Contact, Patch
from gellight.frames.pixel_grid import bounding_box, connected, pixel_size_xy
from gellight.reconstruction.perspective import Perspective

THRESHOLD_MM = 0.02
"""Default depth from which the gel counts as pressed: the depth error of the GelLight paper's sensor."""

SMALLEST_PATCH_PX = 16
"""what is smaller is a crumb that noise broke off the rim of a patch"""

MOST_PATCHES = 100
"""the deepest; cloth or foam has more, and who follows a contact means none of those"""

LEVELS = 32
"""levels of depth into which a region is divided"""
_RIMS = slice(6, 26)
"""of the levels: the rim is looked for from a fifth to four fifths of the depth"""
FEWEST_BLOCKS = 16
"""of 2 x 2 pixels: in a smaller region no rim can be told, and half of the deepest takes its place"""
_STEEP = np.float32(0.95)
"""share of the largest mean steepness: the rim has at least that"""


def find_contact(
    depth_mm: NDArray[np.floating], pixel_size_mm: float | tuple[float, float], *, threshold_mm: float = THRESHOLD_MM
) -> Contact:
    """Find the contact patch in a depth map.

    depth_mm: (H, W) mm, 0 at rest, positive where pressed. pixel_size_mm: one number or (x, y).

    The gel around an object is dragged along, so the pressed region is larger than the contact. Where the object ends
    the gel stops to follow it: under a ball the slope grows to the rim of the contact and falls beyond (Hertz; K. L.
    Johnson, Contact Mechanics, 1985, section 4.2), and at the edge of a flat end it is steepest. So in each connected
    region deeper than `threshold_mm` the patch is what is deeper than the level where the surface is, on average,
    steepest, and than those below that are 0.95 times as steep. Against finite elements the overlap with the true
    contact (intersection over union) is 0.83 to 0.98 under balls of 2.5 to 7 mm radius pressed 0.3 to 1 mm into 5 mm
    of gel, and 0.76 to 0.85 under a flat end (0.72 to 0.86 and 0.71 to 0.75 at half of the deepest). What touches
    without pressing is not seen.

    Regions are told apart on blocks of 2 x 2 pixels, each standing for its second largest depth. So one pixel that
    sticks out of its block is never a contact and never the indentation; at the apex of a ball of radius R the
    indentation is low by at most 1.25 (pixel size)^2 / R, 1.1 micrometres for a 4 mm ball at 0.06 mm per pixel.
    Two contacts whose skirts meet above the threshold count as one region. NaN counts as untouched.
    Raises ValueError for a wrong shape or a pixel size or threshold that is not above 0.
    """
    _check(depth_mm, threshold_mm)
    size_mm = pixel_size_xy(pixel_size_mm)
    blocks = _second_largest_of_blocks(depth_mm)
    labels, boxes = connected(blocks > threshold_mm)
    if not boxes:
        return _contact(np.zeros(depth_mm.shape, np.bool_), 0.0, size_mm)
    deepest, inside = np.zeros(len(boxes) + 1, np.float64), labels > 0
    np.maximum.at(deepest, labels[inside], blocks[inside].astype(np.float64))
    level = np.maximum(deepest * _rims(blocks, labels, deepest, size_mm[0] / size_mm[1]), threshold_mm)
    level[0] = np.inf
    mask = _at_least(depth_mm, level[labels].astype(depth_mm.dtype))
    return _contact(mask, float(deepest[1:].max()), size_mm)


def _contact(mask: NDArray[np.bool_], indentation_mm: float, size_mm: tuple[float, float]) -> Contact:
    """Return a contact by its patch, which may be empty, and its depth."""
    if not mask.any():
        return Contact(mask=mask, area_mm2=0.0, indentation_mm=0.0, centroid_mm=None)
    # The counts of the columns along x, of the rows along y.
    x, y = (_mean_place(np.count_nonzero(mask, axis=axis)) for axis in (0, 1))
    return Contact(
        mask=mask,
        area_mm2=float(np.count_nonzero(mask) * size_mm[0] * size_mm[1]),
        indentation_mm=indentation_mm,
        centroid_mm=(x * size_mm[0], y * size_mm[1]),
    )


def without_untouched(
    contact: Contact,
    touched: NDArray[np.bool_],
    depth_mm: NDArray[np.floating],
    pixel_size_mm: float | tuple[float, float],
) -> Contact:
    """Return the contact without the parts in which nothing is touched: they got their depth from afar.

    touched: (H, W) where the picture says so. A gel that moved in its frame is seen in one place, and its slopes, which
    are gentle everywhere, add up to a depth in another.
    """
    if not np.any(contact.mask & ~touched):
        return contact
    part = bounding_box(contact.mask)
    labels, boxes = connected(contact.mask[part])
    felt = np.bincount(labels[touched[part]], minlength=len(boxes) + 1) > 0
    felt[0] = False
    if felt[1:].all():
        return contact
    mask = np.zeros_like(contact.mask)
    mask[part] = felt[labels]
    return _contact(mask, deepest_mm(mask, depth_mm), pixel_size_xy(pixel_size_mm))


def deepest_mm(mask: NDArray[np.bool_], depth_mm: NDArray[np.floating]) -> float:
    """Return the largest depth inside a contact; one pixel that sticks out does not count."""
    return float(_second_largest_of_blocks(np.where(mask, depth_mm, 0.0)).max())


def measure_patches(
    mask: NDArray[np.bool_],
    depth_mm: NDArray[np.floating],
    gradient_map: NDArray[np.floating],
    pixel_size_mm: float | tuple[float, float],
    perspective: Perspective | None = None,
) -> list[Patch]:
    """Measure each connected part of a contact patch, the deepest first.

    mask: (H, W) the contact patch. depth_mm: (H, W) mm. gradient_map: (H, W, 2). perspective: of the camera; None: it
    looks along parallel rays. Pixels that touch at a corner are connected. Parts smaller than `SMALLEST_PATCH_PX` are
    left out, and all but the `MOST_PATCHES` deepest.
    NaN in depth or slope is left out of the figures.
    """
    if not mask.any():
        return []
    size_x, size_y = pixel_size_xy(pixel_size_mm)
    # All of it in the part around them: to look through the whole map takes several times as long.
    part = bounding_box(mask)
    top, left = (side.start for side in part)
    depth_mm, gradient_map = depth_mm[part], gradient_map[part]
    labels, boxes = connected(mask[part])
    parts = []
    for label, (rows, columns) in enumerate(boxes, start=1):
        inside = labels[rows, columns] == label
        count = np.count_nonzero(inside)
        if count < SMALLEST_PATCH_PX:
            continue
        depths = depth_mm[rows, columns][inside]
        slopes_x, slopes_y = (gradient_map[rows, columns, axis][inside] for axis in (0, 1))
        x, y = (count * _mean_index(np.count_nonzero(inside, axis=axis)) for axis in (0, 1))
        places = x + count * (left + columns.start), y + count * (top + rows.start)
        volume, steepest = np.nansum(depths, dtype=np.float64), np.nanmax(slopes_x**2 + slopes_y**2)
        if perspective:
            at_y, at_x = np.nonzero(inside)
            at = at_x + left + columns.start, at_y + top + rows.start
            seen = perspective.sums(depths, np.stack([slopes_x, slopes_y], axis=1), at, mask.shape)
            parts.append([*seen[:3], np.nanmax(depths), seen[3], steepest])
        else:
            parts.append([count, *places, np.nanmax(depths), volume, steepest])
    return patches_of(np.array(parts).reshape(-1, 6), mask.shape, (size_x, size_y))


def patched(
    contact: Contact,
    depth_mm: NDArray[np.floating],
    gradient_map: NDArray[np.floating],
    pixel_size_mm: float | tuple[float, float],
    perspective: Perspective | None,
) -> tuple[Contact, list[Patch]]:
    """Return a contact and its parts, measured as `measure_patches` does; both on the gel where the view is known."""
    patches = measure_patches(contact.mask, depth_mm, gradient_map, pixel_size_mm, perspective)
    return on_gel(contact, patches) if perspective else contact, patches


def on_gel(contact: Contact, patches: list[Patch]) -> Contact:
    """Return a contact with the area and the place of its parts, which were measured on the gel."""
    area = sum(patch.area_mm2 for patch in patches)
    if not area:
        return contact
    x, y = (sum(patch.area_mm2 * patch.centroid_mm[axis] for patch in patches) / area for axis in (0, 1))
    return replace(contact, area_mm2=area, centroid_mm=(x, y))


def patches_of(
    parts: NDArray[np.float64], image_shape: tuple[int, ...], pixel_size_mm: tuple[float, float]
) -> list[Patch]:
    """Return the patches of the parts of a contact, the deepest first, at most `MOST_PATCHES`.

    parts: (N, 6) pixels of gel at rest that are as large, sums of their columns and rows, largest depth and sum of
    depth in mm, largest square of the slope.
    """
    (size_x, size_y), (middle_y, middle_x) = pixel_size_mm, [(length - 1) / 2 for length in image_shape]
    deepest = parts[np.argsort(-parts[:, 3], kind="stable")[:MOST_PATCHES]].tolist()
    return [
        Patch(
            centroid_mm=((x / count - middle_x) * size_x, (y / count - middle_y) * size_y),
            depth_mm=depth,
            area_mm2=count * size_x * size_y,
            volume_mm3=volume * size_x * size_y,
            slope_rad=math.atan(math.sqrt(square)),
        )
        for count, x, y, depth, volume, square in deepest
    ]


def _check(depth_mm: NDArray[np.floating], threshold_mm: float) -> None:
    if depth_mm.ndim != 2 or depth_mm.size == 0:
        raise ValueError(f"depth map has shape {depth_mm.shape}: give (H, W)")
    if not threshold_mm > 0:
        raise ValueError(f"threshold_mm = {threshold_mm}: it must be above 0, where the gel is at rest")


def _second_largest_of_blocks(depth: NDArray[np.floating]) -> NDArray[np.floating]:
    """(H, W) to (ceil(H / 2), ceil(W / 2)); an odd last row or column is doubled."""
    height, width = depth.shape
    if height % 2 or width % 2:
        depth = np.pad(depth, ((0, height % 2), (0, width % 2)), mode="edge")
    a, b, c, d = depth[::2, ::2], depth[::2, 1::2], depth[1::2, ::2], depth[1::2, 1::2]
    low, high = np.minimum(a, b), np.maximum(a, b)
    low_2, high_2 = np.minimum(c, d), np.maximum(c, d)
    # The largest is the larger of the two highs; the second is the smaller high or the low beside the larger one.
    second: NDArray[np.floating] = np.maximum(np.minimum(high, high_2), np.where(high > high_2, low, low_2))
    return second


def _rims(
    blocks: NDArray[np.floating], labels: NDArray[np.int32], deepest: NDArray[np.float64], aspect: float
) -> NDArray[np.float64]:
    """Return the level of each region's rim as a share of its deepest point, (count + 1,).

    aspect: width of a pixel over its height.
    """
    inside = labels > 0
    region = labels[inside]
    per_mm = np.float32(LEVELS) / deepest.astype(np.float32)[region]
    levels = np.minimum((blocks[inside].astype(np.float32) * per_mm).astype(np.intp), LEVELS - 1)
    count, steepness = (
        np.bincount(region * LEVELS + levels, weights, len(deepest) * LEVELS).reshape(-1, LEVELS)
        for weights in (None, _steepness(blocks, aspect)[inside])
    )
    size = count.sum(axis=1)
    near, steep = (2 * one[:, 1:-1] + one[:, :-2] + one[:, 2:] for one in (count, steepness))
    mean = (steep / np.maximum(near, 1))[:, _RIMS.start - 1 : _RIMS.stop - 1]
    least = _STEEP * mean.max(axis=1)
    every, steepest, levels = np.arange(len(mean)), np.argmax(mean, axis=1), np.arange(mean.shape[1])
    too_flat = (mean < least[:, None]) & (levels < steepest[:, None])
    first = np.where(too_flat, levels + 1, 0).max(axis=1)
    here, below = mean[every, first], mean[every, first - 1]
    back = np.divide(here - least, here - below, out=np.zeros(len(mean)), where=(first > 0))
    return np.where(size < FEWEST_BLOCKS, 0.5, (_RIMS.start + first + 0.5 - back) / LEVELS)


def _steepness(blocks: NDArray[np.floating], aspect: float) -> NDArray[np.floating]:
    """(h, w) steepness of the surface to a factor; 0 where it is not known."""
    wide = np.pad(blocks, 1, mode="edge")
    x, y = wide[1:-1, 2:] - wide[1:-1, :-2], (wide[2:, 1:-1] - wide[:-2, 1:-1]) * aspect
    return np.asarray(np.nan_to_num(np.sqrt(x * x + y * y)))


def _at_least(depth: NDArray[np.floating], level: NDArray[np.floating]) -> NDArray[np.bool_]:
    """Compare each pixel with the level of its block."""
    mask = np.empty(depth.shape, np.bool_)
    for row in (0, 1):
        for column in (0, 1):
            pixels = depth[row::2, column::2]
            mask[row::2, column::2] = pixels >= level[: pixels.shape[0], : pixels.shape[1]]
    return mask


def _mean_place(counts: NDArray[np.intp]) -> float:
    """Mean place of what is counted along one axis, px from its middle."""
    return _mean_index(counts) - (len(counts) - 1) / 2


def _mean_index(counts: NDArray[np.intp]) -> float:
    """Mean index of what is counted along one axis."""
    return float(counts @ np.arange(len(counts)) / counts.sum())
