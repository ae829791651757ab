"""Pictures of what was scanned: maps of heights with their scales, and meshes from above and below."""

import cv2
import numpy as np
from numpy.typing import NDArray

from gellight.lab.report.pictures import (
    FAINT,
    GUTTER,
    INK,
    MARGIN,
    PAPER,
    TITLE,
    Picture,
    depth_bar,
    depth_picture,
    enlarged,
    paper,
    round_step,
    write_text,
)

_LARGEST_SIDE, _LEAST_SIDE, _LEAST_SCALE_UM = 3000, 200, 0.01


def height_picture(
    height_mm: NDArray[np.floating], pixel_mm: float, *, unseen: NDArray[np.bool_] | None = None
) -> Picture:
    """Draw a (H, W) map of heights with its colour bar, um from the lowest, and a scale bar; NaN is hatched.

    Where (H, W) `unseen` is true nothing is drawn. The lowest and the highest thousandth share the end of the scale.
    Raises ValueError where all is NaN.
    """
    drawn, scale_um = coloured_heights(height_mm, unseen=unseen)
    panel = enlarged(drawn)
    rows_px, columns_px = max(panel.shape[0], _LEAST_SIDE), panel.shape[1]
    sheet = paper(rows_px + 2 * MARGIN + TITLE, max(columns_px, _LEAST_SIDE) + 2 * MARGIN + GUTTER)
    sheet[MARGIN : MARGIN + panel.shape[0], MARGIN : MARGIN + columns_px] = panel
    left = sheet.shape[1] - GUTTER
    sheet[MARGIN : MARGIN + rows_px, left:] = depth_bar(rows_px, GUTTER, scale_um=scale_um)
    write_text(sheet, "um", (left, sheet.shape[0] - MARGIN), FAINT, 0.48)
    _draw_scale(sheet, pixel_mm * height_mm.shape[1] / columns_px, columns_px)
    return sheet


def coloured_heights(
    height_mm: NDArray[np.floating], *, unseen: NDArray[np.bool_] | None = None, largest_px: int = _LARGEST_SIDE
) -> tuple[Picture, float]:
    """Colour a (H, W) map of heights as `height_picture` does; return it thinned, and the span of the scale, um."""
    thinned = max(1, -(-max(height_mm.shape) // largest_px))
    height = np.asarray(height_mm[::thinned, ::thinned])
    if not len(known := height[np.isfinite(height)]):
        raise ValueError(f"none of the {height.size} heights is known: there is nothing to draw")
    low, high = np.percentile(known, (0.1, 99.9)).tolist()
    scale_um = max((high - low) * 1e3, _LEAST_SCALE_UM)
    rows, columns = np.indices(height.shape)
    hatched = np.where((rows + columns) % 8 < 2, 105, 75).astype(np.uint8)[..., None].repeat(3, axis=2)
    coloured = depth_picture(np.nan_to_num(height) - low, scale_um=scale_um)
    drawn = np.where(np.isfinite(height)[..., None], coloured, hatched)
    if unseen is not None:
        drawn[unseen[::thinned, ::thinned]] = PAPER
    return drawn, scale_um


def _draw_scale(sheet: Picture, pixel_mm: float, width_px: int) -> None:
    """Draw a bar of a round length, with that length, under the lower left corner."""
    length_mm = round_step(width_px * pixel_mm, 10)
    y, end = sheet.shape[0] - MARGIN, MARGIN + round(length_mm / pixel_mm)
    cv2.rectangle(sheet, (MARGIN, y - 8), (end, y - 3), INK, -1)
    write_text(sheet, f"{length_mm:g} mm", (end + 10, y), INK, 0.5)


def mesh_picture(
    points_mm: NDArray[np.float64], triangles: NDArray[np.integer], size_px: int = 480
) -> NDArray[np.uint8]:
    """Draw (T, 3) triangles between points (V, 3), x right, y down, z up, from above and, turned about y, from below.

    The light comes from the upper left. Returns (size, 2 size, 3) uint8 RGB.
    """
    centred = points_mm - (points_mm.max(axis=0) + points_mm.min(axis=0)) / 2
    return np.hstack([_from_above(centred * turn, triangles, size_px) for turn in ([1, 1, 1], [-1, 1, -1])])


def _from_above(points: NDArray[np.float64], triangles: NDArray[np.integer], size_px: int) -> NDArray[np.uint8]:
    """Draw triangles about the origin, the nearest ones last."""
    corners = points[triangles]
    across = np.cross(corners[:, 2] - corners[:, 0], corners[:, 1] - corners[:, 0])  # y is down: left-handed
    normal = across / np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-12)
    light = np.clip(normal @ (np.array([-0.5, -0.5, 0.7]) / np.sqrt(0.99)), 0, 1)
    scale = 0.9 * size_px / max(float(np.ptp(points[:, :2], axis=0).max()), 1e-6)
    at = np.rint((corners[..., :2] * scale + size_px / 2) * 16).astype(np.int32)
    picture = np.full((size_px, size_px, 3), 255, np.uint8)
    for number in np.argsort(corners[..., 2].mean(axis=1)):
        if normal[number, 2] > 0:
            grey = 90 + 150 * light[number]
            cv2.fillConvexPoly(picture, at[number], (grey, grey, grey), shift=4)
    return picture
