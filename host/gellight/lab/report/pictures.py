"""Pictures of maps, RGB: the same colour is the same depth in every picture, so pictures can be compared."""

from math import floor, log10
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import printable
from gellight.base.writing import write_file
from gellight.frames.frames import Contact, TactileFrame

Picture = NDArray[np.uint8]

DEPTH_SCALE_UM = 1000.0
"""Default depth of the last colour, micrometres."""
DIFFERENCE_SCALE_GREY = 64.0
"""Default difference that is drawn as black or as full brightness, grey levels."""

_INK, _PAPER, _FAINT = (228, 230, 235), (20, 22, 28), (130, 134, 145)
_PANEL_WIDTH, _MARGIN, _TITLE, _GUTTER = 640, 20, 34, 96
_LARGEST_SIDE, _LEAST_SIDE, _LEAST_SCALE_UM = 3000, 200, 0.01
_FONT = cv2.FONT_HERSHEY_DUPLEX


def difference_picture(difference: NDArray[np.floating]) -> Picture:
    """Draw a (H, W, 3) difference image: grey where nothing changed, DIFFERENCE_SCALE_GREY levels to each end."""
    return np.clip(np.asarray(difference) * (127.5 / DIFFERENCE_SCALE_GREY) + 127.5, 0, 255).astype(np.uint8)


def normal_picture(normal_map: NDArray[np.floating]) -> Picture:
    """Draw a (H, W, 3) normal map in the usual colours: x to red, y upwards to green, z to blue."""
    coloured = (np.asarray(normal_map) * [127.5, -127.5, 127.5] + 127.5).clip(0, 255)
    return coloured.astype(np.uint8)


def depth_picture(depth_mm: NDArray[np.floating], *, scale_um: float = DEPTH_SCALE_UM) -> Picture:
    """Draw a (H, W) depth map, mm, on the fixed scale from 0 (dark) to `scale_um` micrometres (bright)."""
    if not scale_um > 0:
        raise ValueError(f"scale_um = {scale_um}: it must be above 0")
    levels = np.clip(np.asarray(depth_mm) * (1000 / scale_um * 255), 0, 255).astype(np.uint8)
    return np.ascontiguousarray(cv2.applyColorMap(levels, cv2.COLORMAP_INFERNO)[..., ::-1], dtype=np.uint8)


def depth_bar(height: int, width: int, *, scale_um: float = DEPTH_SCALE_UM) -> Picture:
    """Draw the colour bar of `depth_picture`, deepest at the top, with numbers in micrometres on its right."""
    bar = _paper(height, width)
    ramp = np.linspace(scale_um / 1000, 0, height - 20)[:, None].repeat(18, axis=1)
    bar[10 : height - 10, :18] = depth_picture(ramp, scale_um=scale_um)
    for tick in np.arange(0, scale_um * 1.0001, round_step(scale_um, 10)):
        y = round(10 + (1 - tick / scale_um) * (height - 21))
        cv2.line(bar, (18, y), (23, y), _INK, 1)
        _write(bar, f"{tick:g}", (28, y + 5), _INK, 0.42)
    return bar


def four_panels(frame: TactileFrame, *, scale_um: float = DEPTH_SCALE_UM) -> Picture:
    """Draw camera image, difference image, normal map and depth map with its contact patch on one sheet."""
    depth = _enlarged(depth_picture(frame.depth_mm, scale_um=scale_um))
    _draw_contact(depth, frame.contact)
    panels = (
        ("Camera", frame.camera_frame.source.split("/")[-1], _enlarged(frame.camera_frame.image)),
        ("Difference", f"-{DIFFERENCE_SCALE_GREY:g} to +{DIFFERENCE_SCALE_GREY:g} grey levels", None),
        ("Normals", "", _enlarged(normal_picture(frame.normal_map))),
        ("Depth", _contact_line(frame.contact), depth),
    )
    height, width = depth.shape[:2]
    sheet = _paper(2 * (height + _TITLE) + 3 * _MARGIN, 2 * width + 3 * _MARGIN + _GUTTER - _MARGIN)
    for index, (title, note, panel) in enumerate(panels):
        top = _MARGIN + (index // 2) * (height + _TITLE + _MARGIN) + _TITLE
        left = _MARGIN + (index % 2) * (width + _MARGIN)
        drawn = _enlarged(difference_picture(frame.difference)) if panel is None else panel
        sheet[top : top + height, left : left + width] = drawn
        _write(sheet, title, (left, top - 11), _INK, 0.62)
        after = cv2.getTextSize(title, _FONT, 0.62, 1)[0][0] + 16
        _write(sheet, note, (left + after, top - 11), _FAINT, 0.48)
    bar = depth_bar(height, _GUTTER - 16, scale_um=scale_um)
    sheet[top : top + height, left + width + 12 : left + width + 12 + bar.shape[1]] = bar
    _write(sheet, "um", (left + width + 12, top - 11), _FAINT, 0.48)
    return sheet


def height_picture(
    height_mm: NDArray[np.floating], pixel_mm: float, *, unseen: NDArray[np.bool_] | None = None
) -> Picture:
    """Draw a (H, W) map of heights with its colour bar, um from the lowest, and a scale bar; NaN is hatched.

    Where (H, W) `unseen` is true nothing is drawn. The lowest and the highest thousandth share the end of the scale.
    Raises ValueError where all is NaN.
    """
    drawn, scale_um = coloured_heights(height_mm, unseen=unseen)
    panel = _enlarged(drawn)
    rows_px, columns_px = max(panel.shape[0], _LEAST_SIDE), panel.shape[1]
    sheet = _paper(rows_px + 2 * _MARGIN + _TITLE, max(columns_px, _LEAST_SIDE) + 2 * _MARGIN + _GUTTER)
    sheet[_MARGIN : _MARGIN + panel.shape[0], _MARGIN : _MARGIN + columns_px] = panel
    left = sheet.shape[1] - _GUTTER
    sheet[_MARGIN : _MARGIN + rows_px, left:] = depth_bar(rows_px, _GUTTER, scale_um=scale_um)
    _write(sheet, "um", (left, sheet.shape[0] - _MARGIN), _FAINT, 0.48)
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
        drawn[unseen[::thinned, ::thinned]] = _PAPER
    return drawn, scale_um


def encode_png(picture: Picture) -> bytes:
    """Encode a (H, W, 3) RGB or (H, W) grey picture as PNG."""
    return cv2.imencode(".png", picture[..., ::-1] if picture.ndim == 3 else picture)[1].tobytes()


def write_png(path: Path, picture: Picture) -> None:
    """Write a (H, W, 3) RGB picture as a PNG file, whole or not at all; raises OSError."""
    write_file(path, encode_png(picture))


def _paper(height: int, width: int) -> Picture:
    return np.full((height, width, 3), _PAPER, np.uint8)


def _write(picture: Picture, text: str, place: tuple[int, int], colour: tuple[int, int, int], size: float) -> None:
    cv2.putText(picture, printable(text), place, _FONT, size, colour, 1, cv2.LINE_AA)


def _draw_scale(sheet: Picture, pixel_mm: float, width_px: int) -> None:
    """Draw a bar of a round length, with that length, under the lower left corner."""
    length_mm = round_step(width_px * pixel_mm, 10)
    y, end = sheet.shape[0] - _MARGIN, _MARGIN + round(length_mm / pixel_mm)
    cv2.rectangle(sheet, (_MARGIN, y - 8), (end, y - 3), _INK, -1)
    _write(sheet, f"{length_mm:g} mm", (end + 10, y), _INK, 0.5)


def round_step(span: float, most: int) -> float:
    """Return the smallest step of 1, 2 or 5 times a power of ten that fits into `span` at most `most` times."""
    decade = 10.0 ** floor(log10(span or 1.0))
    return next(step for step in (decade * factor for factor in (0.1, 0.2, 0.5, 1, 2)) if span / step <= most + 1e-3)


def _enlarged(picture: Picture) -> Picture:
    """Repeat each pixel so that small images fill a panel."""
    factor = max(1, round(_PANEL_WIDTH / picture.shape[1]))
    return picture.repeat(factor, axis=0).repeat(factor, axis=1)


def _draw_contact(picture: Picture, contact: Contact) -> None:
    """Outline the contact patch."""
    factor = picture.shape[0] // contact.mask.shape[0]
    mask = contact.mask.astype(np.uint8).repeat(factor, axis=0).repeat(factor, axis=1)
    outlines, _ = cv2.findContours(mask, cv2.RETR_LIST, cv2.CHAIN_APPROX_NONE)
    cv2.drawContours(picture, outlines, -1, (120, 220, 255), 1, cv2.LINE_AA)


def _contact_line(contact: Contact) -> str:
    if contact.centroid_mm is None:
        return "no contact"
    x, y = contact.centroid_mm
    return (
        f"{contact.indentation_mm * 1000:.0f} um deep, {contact.area_mm2:.1f} mm2 at ({x:+.2f}, {y:+.2f}) mm, outlined"
    )


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
