"""Whether a JPEG is whole: OpenCV's decoder returns a picture all the same, and reports only on standard error.

What the decoder could not fill for want of data it leaves at exactly mid-grey, one minimum coded unit (MCU: the blocks
of all three colours of one place) after the other. That tells three faults:

- Data is missing: the last MCU is left over. It may also be mid-grey as it was seen, so the picture is decoded a little
  taller than it is: the MCU behind the last gets the padding of a picture that is whole.
- There is too much data, as where two pictures were spliced: MCUs further down are filled too.
- At restart markers everything heals, so these have to be there, all of them and in their order, and the MCU before
  each is not left over.

Sound pictures pass: cameras do put a few bytes too many before a marker, or fill up with zeros.
"""

import re
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from gellight.v4l2.errors import CorruptPictureError

Image = NDArray[np.uint8]

_START, _END = b"\xff\xd8", b"\xff\xd9"
_HUFFMAN_FRAMES, _RESTART, _SCAN = (0xC0, 0xC1), 0xDD, 0xDA
_FLAGS = cv2.IMREAD_COLOR_RGB | cv2.IMREAD_IGNORE_ORIENTATION
_SMALL = cv2.IMREAD_REDUCED_COLOR_8 | cv2.IMREAD_IGNORE_ORIENTATION
_SMALL_SCALE = 8
_BLOCK_PX = 8
_UNFILLED = 128
_CONTRAST = 16
"""grey levels by which an MCU differs from the one beside it that was left over; less, and it may be as it was seen"""
_FILLING_BYTES = 4096
"""some cameras fill their last packet with anything"""
_ZERO_BYTES = 4
"""some cameras fill up with zeros before the end; more than these are not of the picture"""
_TOLERATED_MCUS = 16
"""surplus that is no fault: some cameras put up to ten bytes too many before a marker, and an MCU of three colours
takes at least 14 bits"""


@dataclass(frozen=True, kw_only=True)
class Layout:
    """What the header of a JPEG says of the data behind it."""

    shape: tuple[int, int]
    """(H, W), pixels"""
    mcu: tuple[int, int]
    """(H, W) of an MCU, pixels"""
    height_at: int
    """where the height stands, byte"""
    data_at: int
    """where the data begins, byte"""
    restart: int
    """MCUs from one restart marker to the next; 0: there are none"""

    @property
    def columns(self) -> int:
        """MCUs side by side."""
        return -(-self.shape[1] // self.mcu[1])

    @property
    def rows(self) -> int:
        """MCUs one below the other."""
        return -(-self.shape[0] // self.mcu[0])

    def taller(self, data: bytes) -> bytes:
        """Return the JPEG with a height at which a surplus beyond what is tolerated shows."""
        rows = self.rows + _TOLERATED_MCUS // self.columns + 1
        return data[: self.height_at] + (rows * self.mcu[0]).to_bytes(2) + data[self.height_at + 2 :]


def decode_jpeg(data: bytes, shape: tuple[int, int]) -> Image:
    """Return (H, W, 3) uint8 RGB of a JPEG that has to be of this `shape` (H, W); CorruptPictureError otherwise."""
    end = data.rfind(_END, -_FILLING_BYTES)
    if not data.startswith(_START) or end < 0:
        raise CorruptPictureError("a JPEG without its start or its end")
    layout = layout_of(data)
    image = _checked(_trimmed(data, layout), layout) if layout else _opened(data[: end + len(_END)])
    if image.shape != (*shape, 3):
        raise CorruptPictureError(f"a JPEG of {image.shape[1]}x{image.shape[0]}")
    if layout is None and (image[-_BLOCK_PX:, -_BLOCK_PX:] == _UNFILLED).all():
        raise CorruptPictureError("a JPEG that breaks off")
    return image


def layout_of(data: bytes) -> Layout | None:
    """Read the header; None where it is damaged or of an unusual kind, whose surplus cannot be judged."""
    place, restart, frame_at = len(_START), 0, 0
    while data[place : place + 1] == b"\xff" and len(data) >= place + 4:
        marker, length = data[place + 1], int.from_bytes(data[place + 2 : place + 4])
        if marker in _HUFFMAN_FRAMES:
            frame_at = place
        elif marker == _RESTART:
            restart = int.from_bytes(data[place + 4 : place + 6])
        place += 2 + length
        if marker == _SCAN:
            return _layout(data, frame_at, place, restart) if frame_at else None
    return None


def _layout(data: bytes, frame_at: int, data_at: int, restart: int) -> Layout | None:
    """Read the frame header: precision, height, width, count of colours, then of each its number and sampling."""
    height, width = (int.from_bytes(data[frame_at + k : frame_at + k + 2]) for k in (5, 7))
    count = data[frame_at + 9]
    sampling = [data[frame_at + 11 + 3 * k] for k in range(count)]
    if count not in (1, 3) or not height or not width or 0 in sampling:
        return None
    across, down = (max(each >> 4 for each in sampling), max(each & 15 for each in sampling)) if count > 1 else (1, 1)
    return Layout(shape=(height, width), mcu=(_BLOCK_PX * down, _BLOCK_PX * across), height_at=frame_at + 5,
                  data_at=data_at, restart=restart)  # fmt: skip


def _trimmed(data: bytes, layout: Layout) -> bytes:
    """Cut off what is behind the end, and filling before it."""
    body = data[: data.find(_END, layout.data_at)]
    return body[: len(body.rstrip(b"\0")) + _ZERO_BYTES] + _END


def _checked(data: bytes, layout: Layout) -> Image:
    """Decode; CorruptPictureError where there is too little data, too much, or too little between restart markers."""
    _check_restarts(data, layout)
    if layout.mcu[0] == _BLOCK_PX:
        taller, scale = _opened(layout.taller(data)), 1
        image = taller[: layout.shape[0]]
    else:  # colours are interpolated between rows, so what lies below the picture would show in its last one
        image, scale = _opened(data), _SMALL_SCALE
        taller = _opened(layout.taller(data), _SMALL)
    count = layout.rows * layout.columns
    last, next_, far = _unfilled(taller, np.array([count - 1, count, count + _TOLERATED_MCUS]), layout, scale=scale)
    if last and next_:  # where data ends with the picture, its padding gets into the next MCU
        raise CorruptPictureError("a JPEG that breaks off")
    if not far:
        raise CorruptPictureError("a JPEG with more data than its picture needs")
    if layout.restart and _gaps(image, layout):
        raise CorruptPictureError("a JPEG with less data between restart markers than its picture needs")
    return image


def _check_restarts(data: bytes, layout: Layout) -> None:
    found = [marker[1] & 7 for marker in re.findall(rb"\xff[\xd0-\xd7]", data[layout.data_at :])]
    count = -(-layout.rows * layout.columns // layout.restart) - 1 if layout.restart else 0
    in_order = found == [number % 8 for number in range(len(found))]
    if not in_order or not count <= len(found) <= count + bool(layout.restart):  # one more at the end does no harm
        raise CorruptPictureError(f"a JPEG with {len(found)} of {count} restart markers, or not in their order")


def _gaps(image: Image, layout: Layout) -> bool:
    """Whether an MCU before a restart marker was left over; one like its neighbour may be as it was seen."""
    last = np.arange(layout.restart - 1, layout.rows * layout.columns, layout.restart)
    left = last[_unfilled(image, last, layout)]
    below = left + layout.columns  # decoded anew after the marker; in the last row there is only what lies above
    beside = np.where(below < layout.rows * layout.columns, below, np.maximum(left - layout.columns, 0))
    means = _middles(image, beside, layout).mean(axis=(1, 2))
    return bool((np.abs(means - _UNFILLED) > _CONTRAST).any())


def _unfilled(image: Image, places: NDArray[np.intp], layout: Layout, *, scale: int = 1) -> NDArray[np.bool_]:
    """(N,) whether MCUs, by their number, were left over."""
    return np.asarray((_middles(image, places, layout, scale=scale) == _UNFILLED).all(axis=(1, 2, 3)))


def _middles(image: Image, places: NDArray[np.intp], layout: Layout, *, scale: int = 1) -> Image:
    """(N, h, w, 3) of the middles of MCUs, by their number: at their borders colours are interpolated."""
    height, width = layout.mcu[0] // scale, layout.mcu[1] // scale
    y = (places // layout.columns * height)[:, None, None] + _middle(height)[:, None]
    x = (places % layout.columns * width)[:, None, None] + _middle(width)
    return np.asarray(image[np.minimum(y, image.shape[0] - 1), np.minimum(x, image.shape[1] - 1)])


def _middle(length: int) -> NDArray[np.intp]:
    return np.arange(length // 4, max(3 * length // 4, length // 4 + 1))


def _opened(data: bytes, flags: int = _FLAGS) -> Image:
    try:
        image = cv2.imdecode(np.frombuffer(data, np.uint8), flags)
    except cv2.error as error:
        raise CorruptPictureError(str(error)) from error
    if image is None:
        raise CorruptPictureError("a JPEG that cannot be decoded")
    return np.asarray(image, np.uint8)
