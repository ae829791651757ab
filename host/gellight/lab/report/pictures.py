"""Pictures of maps, RGB: the same colour is the same depth in every picture, so pictures can be compared."""

from contextlib import AbstractContextManager
from math import floor, log10
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import InputError, printable
from gellight.base.writing import write_file
from gellight.frames.frames import Contact, TactileFrame

Picture = NDArray[np.uint8]

DEPTH_SCALE_UM = 1000.0
"""Default depth of the last colour, micrometres."""
DIFFERENCE_SCALE_GREY = 64.0
"""Default difference that is drawn as black or as full brightness, grey levels."""

INK, PAPER, FAINT = (228, 230, 235), (20, 22, 28), (130, 134, 145)  # chosen: light on dark
_PANEL_WIDTH, MARGIN, TITLE, GUTTER = 640, 20, 34, 96  # chosen: px of a sheet
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


def with_circle(image: Picture, center_x_px: float, center_y_px: float, contact_radius_px: float) -> Picture:
    """Draw a circle and its centre into a copy of a (H, W, 3) picture, white with a black edge."""
    rows, columns = np.indices(image.shape[:2])
    distance = np.hypot(columns - center_x_px, rows - center_y_px)
    from_line = np.minimum(np.abs(distance - contact_radius_px), np.maximum(distance - 1.6, 0))
    picture = image.copy()
    picture[from_line < 1.5] = (0, 0, 0)
    picture[from_line < 0.75] = (255, 255, 255)
    return picture


def depth_bar(height: int, width: int, *, scale_um: float = DEPTH_SCALE_UM) -> Picture:
    """Draw the colour bar of `depth_picture`, deepest at the top, with numbers in micrometres on its right."""
    bar = paper(height, width)
    ramp = np.linspace(scale_um / 1000, 0, height - 20)[:, None].repeat(18, axis=1)
    bar[10 : height - 10, :18] = depth_picture(ramp, scale_um=scale_um)
    for tick in np.arange(0, scale_um * 1.0001, round_step(scale_um, 10)):
        y = round(10 + (1 - tick / scale_um) * (height - 21))
        cv2.line(bar, (18, y), (23, y), INK, 1)
        write_text(bar, f"{tick:g}", (28, y + 5), INK, 0.42)
    return bar


def four_panels(frame: TactileFrame, *, scale_um: float = DEPTH_SCALE_UM) -> Picture:
    """Draw camera image, difference image, normal map and depth map with its contact patch on one sheet."""
    depth = enlarged(depth_picture(frame.depth_mm, scale_um=scale_um))
    _draw_contact(depth, frame.contact)
    panels = (
        ("Camera", frame.camera_frame.source.split("/")[-1], enlarged(frame.camera_frame.image)),
        ("Difference", f"-{DIFFERENCE_SCALE_GREY:g} to +{DIFFERENCE_SCALE_GREY:g} grey levels", None),
        ("Normals", "", enlarged(normal_picture(frame.normal_map))),
        ("Depth", _contact_line(frame.contact), depth),
    )
    height, width = depth.shape[:2]
    sheet = paper(2 * (height + TITLE) + 3 * MARGIN, 2 * width + 3 * MARGIN + GUTTER - MARGIN)
    for index, (title, note, panel) in enumerate(panels):
        top = MARGIN + (index // 2) * (height + TITLE + MARGIN) + TITLE
        left = MARGIN + (index % 2) * (width + MARGIN)
        drawn = enlarged(difference_picture(frame.difference)) if panel is None else panel
        sheet[top : top + height, left : left + width] = drawn
        write_text(sheet, title, (left, top - 11), INK, 0.62)
        after = cv2.getTextSize(title, _FONT, 0.62, 1)[0][0] + 16
        write_text(sheet, note, (left + after, top - 11), FAINT, 0.48)
    bar = depth_bar(height, GUTTER - 16, scale_um=scale_um)
    sheet[top : top + height, left + width + 12 : left + width + 12 + bar.shape[1]] = bar
    write_text(sheet, "um", (left + width + 12, top - 11), FAINT, 0.48)
    return sheet


def encode_png(picture: Picture) -> bytes:
    """Encode a (H, W, 3) RGB or (H, W) grey picture as PNG."""
    return cv2.imencode(".png", picture[..., ::-1] if picture.ndim == 3 else picture)[1].tobytes()


def write_png(path: Path, picture: Picture) -> None:
    """Write a (H, W, 3) RGB picture as a PNG file, whole or not at all; raises OSError."""
    write_file(path, encode_png(picture))


def paper(height: int, width: int) -> Picture:
    """Return an empty sheet."""
    return np.full((height, width, 3), PAPER, np.uint8)


def write_text(picture: Picture, text: str, place: tuple[int, int], colour: tuple[int, int, int], size: float) -> None:
    """Write a line of text into a picture; place: its lower left corner, px."""
    cv2.putText(picture, printable(text), place, _FONT, size, colour, 1, cv2.LINE_AA)


def round_step(span: float, most: int) -> float:
    """Return the smallest step of 1, 2 or 5 times a power of ten that fits into `span` at most `most` times."""
    decade = 10.0 ** floor(log10(span or 1.0))
    return next(step for step in (decade * factor for factor in (0.1, 0.2, 0.5, 1, 2)) if span / step <= most + 1e-3)


def enlarged(picture: Picture) -> Picture:
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


SLOWEST = 0.01
"""pictures a second"""


class VideoFile(AbstractContextManager["VideoFile"]):
    """Takes pictures of one size; a context manager that finishes the file."""

    def __init__(self, path: Path, fps: float) -> None:
        """Begin with the first picture; InputError for a rate that MPEG-4 cannot have."""
        if fps < SLOWEST:
            raise InputError(f"{fps:.3g} pictures a second make no video: leave out fewer frames")
        self._path, self._fps = path, fps
        self._writer: cv2.VideoWriter | None = None
        self._count = 0

    def add(self, picture: NDArray[np.uint8]) -> None:
        """Add an (H, W, 3) RGB picture; OSError where the file cannot be written."""
        if self._writer is None:
            size = picture.shape[1], picture.shape[0]
            self._writer = cv2.VideoWriter(str(self._path), cv2.VideoWriter.fourcc(*"mp4v"), self._fps, size)
            if not self._writer.isOpened():
                raise OSError(f"no video can be begun in {self._path.name}")
        self._writer.write(cv2.cvtColor(picture, cv2.COLOR_RGB2BGR))
        self._count += 1

    def __exit__(self, *problem: object) -> None:
        """Finish the file; OSError where it has not become whole, of which the encoder says nothing."""
        if self._writer is None:
            return
        self._writer.release()
        written = int(cv2.VideoCapture(str(self._path)).get(cv2.CAP_PROP_FRAME_COUNT))
        if written != self._count and problem[:1] in ((), (None,)):
            raise OSError(f"{self._path.name} has {written} of {self._count} pictures")
