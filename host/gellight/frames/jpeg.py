"""From the bytes of a JPEG to RGB, by OpenCV; a picture that is not whole is never returned.

OpenCV's decoder of JPEG returns a picture whatever is missing, so it is checked here. The decoder works through
minimum coded units (MCU: the blocks of all colours at one place). Three faults are found:

- Too much data, as where two pictures were spliced, or too little. The picture is decoded a little taller than it is,
  with zeros behind its data. Zeros give MCUs that are all alike. These have to begin below the picture, within the
  surplus that is tolerated: inside the picture data is missing, farther below there was too much.
- A missing restart marker. After a loss the decoder goes on at the next marker, so that nothing shows below the
  picture. All markers have to be there, in their order.
- Too little data between two markers, or at the end. The decoder leaves the MCUs without data at mid-grey; what was
  seen may be grey too, so something else has to speak for a loss.

Two habits of sound cameras are no fault: a few bytes too many before a marker, and zeros behind the data. Sound
pictures are decoded without the line on standard error that the decoder prints where data is missing or left over.
"""

import re
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.uint8]

_START, _END = b"\xff\xd8", b"\xff\xd9"
_HUFFMAN_FRAMES, _TABLES, _RESTART, _SCAN = (0xC0, 0xC1), 0xC4, 0xDD, 0xDA  # T.81, table B.1: SOF0, SOF1, DHT, DRI, SOS
_USUAL_TABLE = bytes.fromhex("10 0002010303020403050504040000017d 01")
"""beginning of the usual brightness table (ITU-T T.81, table K.5); in it, the code 00 is a coefficient of one bit"""
_FLAGS = cv2.IMREAD_COLOR_RGB | cv2.IMREAD_IGNORE_ORIENTATION
_SMALL = cv2.IMREAD_REDUCED_COLOR_8 | cv2.IMREAD_IGNORE_ORIENTATION
_SMALL_SCALE = 8  # of IMREAD_REDUCED_COLOR_8
_BLOCK_PX = 8  # ITU-T T.81: the transform takes 8 x 8 samples
_BLOCK_ZEROS = 24
"""bytes of zeros that make a block in the usual tables: 2 bits, and 3 for each of 63 coefficients"""
_UNFILLED = 128  # ITU-T T.81, A.3.1: coefficients of 0 decode to the middle of 8 bits
_CONTRAST = 16
"""an MCU at mid-grey was left without data where its neighbour differs from mid-grey by more than this, grey levels"""
_FILLING_BYTES = 4096
"""some cameras fill their last packet with anything"""
_TOLERATED_MCUS = 16
"""a surplus that is no fault: some cameras put up to ten bytes too many before a marker, and an MCU of three colours
takes at least 14 bits"""
_TALLEST_PX = 0xFFFF
"""that a header can say"""
_CANDIDATES = 4
"""among this number of MCUs in a row, at least two are not cut off by the right edge"""


class CorruptPictureError(ValueError):
    """A picture is not whole, and why."""


@dataclass(frozen=True, kw_only=True)
class Layout:
    """What the header of a JPEG states about the data behind it."""

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
    blocks: int
    """blocks in an MCU"""
    usual: bool
    """it is coded by the usual tables"""

    @property
    def columns(self) -> int:
        """MCUs side by side."""
        return -(-self.shape[1] // self.mcu[1])

    @property
    def rows(self) -> int:
        """MCUs one below the other."""
        return -(-self.shape[0] // self.mcu[0])

    def beyond(self) -> NDArray[np.intp]:
        """(2,) numbers of MCUs below the picture, beyond the tolerated surplus, and not cut off at the right."""
        places = self.rows * self.columns + _TOLERATED_MCUS + np.arange(_CANDIDATES)
        return places[places % self.columns < max(self.shape[1] // self.mcu[1], 1)][:2]

    def taller(self, data: bytes) -> bytes:
        """Return the JPEG with a height at which too much data shows, and zeros for what is below the picture."""
        body = data[self.height_at + 2 : data.find(_END, self.data_at)]
        zeros = bytes((self._added * self.columns + 2) * self.blocks * _BLOCK_ZEROS)
        return data[: self.height_at] + self.taller_px.to_bytes(2) + body + zeros

    @property
    def taller_px(self) -> int:
        """A height at which too much data shows."""
        return (self.rows + self._added) * self.mcu[0]

    @property
    def _added(self) -> int:
        """Rows of MCUs."""
        return (_TOLERATED_MCUS + _CANDIDATES) // self.columns + 1


def decode_jpeg_file(data: bytes) -> Image | None:
    """Return (H, W, 3) uint8 RGB of a JPEG of any size; None for what is none, or of a kind that cannot be judged.

    CorruptPictureError where it is not whole.
    """
    layout = layout_of(data) if data.startswith(_START) else None
    return decode_jpeg(data, layout.shape, filling=len(data)) if layout else None


def decode_jpeg(data: bytes, shape: tuple[int, int], *, filling: int = _FILLING_BYTES) -> Image:
    """Return (H, W, 3) uint8 RGB of a JPEG that has to be of this `shape` (H, W); CorruptPictureError otherwise.

    filling: bytes that may lie behind its end.
    """
    end = data.rfind(_END, -filling)
    if not data.startswith(_START) or end < 0:
        raise CorruptPictureError("a JPEG without its start or its end")
    layout = layout_of(data)
    if layout is None:
        image = _opened(data[: end + len(_END)])
    elif layout.shape != shape:
        raise CorruptPictureError(f"a JPEG of {layout.shape[1]}x{layout.shape[0]}")
    else:
        image = _restarted(data, layout) if layout.restart or not layout.usual else _continuous(data, layout)
    if image.shape != (*shape, 3):
        raise CorruptPictureError(f"a JPEG of {image.shape[1]}x{image.shape[0]}")
    return image


def layout_of(data: bytes) -> Layout | None:
    """Read the header; None where it is damaged or of an unusual kind, whose surplus cannot be judged."""
    place, restart, frame_at, tables = len(_START), 0, 0, b""
    while data[place : place + 1] == b"\xff" and len(data) >= place + 4:
        marker, length = data[place + 1], int.from_bytes(data[place + 2 : place + 4])
        if marker in _HUFFMAN_FRAMES:
            frame_at = place
        elif marker == _TABLES:
            tables += data[place + 4 : place + 2 + length]
        elif marker == _RESTART:
            restart = int.from_bytes(data[place + 4 : place + 6])
        place += 2 + length
        if marker == _SCAN:
            usual = not tables or _USUAL_TABLE in tables  # without any, the decoder takes the usual ones
            one_scan = data[place - length + 2 : place - length + 3] == data[frame_at + 9 : frame_at + 10]
            return _layout(data, frame_at, place, restart=restart, usual=usual) if frame_at and one_scan else None
    return None


def _layout(data: bytes, frame_at: int, data_at: int, *, restart: int, usual: bool) -> Layout | None:
    """Read the frame header: precision, height, width, count of colours, then of each its number and sampling."""
    height, width = (int.from_bytes(data[frame_at + k : frame_at + k + 2]) for k in (5, 7))
    count = data[frame_at + 9] if data_at < len(data) else 0
    if count not in (1, 3) or data_at < frame_at + 11 + 3 * count:
        return None
    sampling = [(data[frame_at + 11 + 3 * k] >> 4, data[frame_at + 11 + 3 * k] & 15) for k in range(count)]
    if not height or not width or any(0 in each for each in sampling):
        return None
    if count == 1:
        sampling = [(1, 1)]
    across, down = (max(values) for values in zip(*sampling, strict=True))
    layout = Layout(shape=(height, width), mcu=(_BLOCK_PX * down, _BLOCK_PX * across), height_at=frame_at + 5,
                    data_at=data_at, restart=restart, blocks=sum(x * y for x, y in sampling), usual=usual)  # fmt: skip
    return layout if layout.taller_px <= _TALLEST_PX else None


def _continuous(data: bytes, layout: Layout) -> Image:
    """Decode a picture without restart markers; CorruptPictureError where it has too little data or too much."""
    count = layout.rows * layout.columns
    below = np.array([count - 1, count, *layout.beyond()])
    if layout.mcu[0] == _BLOCK_PX:
        taller = _opened(layout.taller(data), why="a JPEG that breaks off")
        _, _, far, farther = _middles(taller, below, layout)
        image, short = taller[: layout.shape[0]], _is_zeros(taller, below, layout)
    else:  # colours are interpolated between rows, so what lies below the picture would show in its last one
        taller = _opened(layout.taller(data), _SMALL, why="a JPEG that breaks off")
        _, _, far, farther = _middles(taller, below, layout, scale=_SMALL_SCALE)
        image = _opened(data)
        unfilled = bool(_unfilled(image, below[:1], layout).all())
        short = unfilled and _is_zeros(_opened(layout.taller(data)), below, layout)
    if short:
        raise CorruptPictureError("a JPEG that breaks off")
    if (far != farther).any():
        raise CorruptPictureError("a JPEG with more data than its picture needs")
    return image


def _is_zeros(taller: Image, below: NDArray[np.intp], layout: Layout) -> bool:
    """Whether the last MCU of a picture, the first of `below`, is like the next one: of zeros behind the data, or grey.

    White and black may be alike in a sound picture, too.
    """
    last, next_ = _middles(taller, below[:2], layout)
    return bool((last == next_).all() and (np.ptp(last) > 0 or (last == _UNFILLED).all()))


def _restarted(data: bytes, layout: Layout) -> Image:
    """Decode a picture with restart markers; CorruptPictureError where one is missing, or data before one."""
    if layout.restart:
        _check_restarts(data, layout)
    image = _opened(data)
    if _breaks_off(image, layout):
        raise CorruptPictureError("a JPEG that breaks off")
    if layout.restart and _gaps(image, layout):
        raise CorruptPictureError("a JPEG with less data between restart markers than its picture needs")
    return image


def _check_restarts(data: bytes, layout: Layout) -> None:
    body = data[layout.data_at : data.find(_END, layout.data_at)]
    found = [marker[1] & 7 for marker in re.findall(rb"\xff[\xd0-\xd7]", body)]
    count = -(-layout.rows * layout.columns // layout.restart) - 1
    in_order = found == [number % 8 for number in range(len(found))]
    if not in_order or not count <= len(found) <= count + 1:  # one more at the end does no harm
        raise CorruptPictureError(f"a JPEG with {len(found)} of {count} restart markers, or not in their order")


def _gaps(image: Image, layout: Layout) -> bool:
    """Whether an MCU before a restart marker was left without data; beside a grey one, grey may be what was seen."""
    last = np.arange(layout.restart - 1, layout.rows * layout.columns, layout.restart)
    left = last[_unfilled(image, last, layout)]
    below = left + layout.columns  # decoded anew after the marker; in the last row there is only what lies above
    beside = np.where(below < layout.rows * layout.columns, below, np.maximum(left - layout.columns, 0))
    return _stands_out(image, beside, layout)


def _breaks_off(image: Image, layout: Layout) -> bool:
    """Whether the last MCUs were left without data; behind a grey one, grey may be what was seen."""
    filled = np.flatnonzero(~_unfilled(image, np.arange(layout.rows * layout.columns), layout))[-1:]
    return bool(filled.size) and filled[0] < layout.rows * layout.columns - 1 and _stands_out(image, filled, layout)


def _stands_out(image: Image, places: NDArray[np.intp], layout: Layout) -> bool:
    """Whether one of some MCUs is not at mid-grey."""
    means = _middles(image, places, layout).mean(axis=(1, 2))
    return bool((np.abs(means - _UNFILLED) > _CONTRAST).any())


def _unfilled(image: Image, places: NDArray[np.intp], layout: Layout) -> NDArray[np.bool_]:
    """(N,) whether MCUs, by their number, were left without data."""
    return np.asarray((_middles(image, places, layout) == _UNFILLED).all(axis=(1, 2, 3)))


def _middles(image: Image, places: NDArray[np.intp], layout: Layout, *, scale: int = 1) -> Image:
    """(N, h, w, 3) of the middles of MCUs, by their number: at their borders colours are interpolated."""
    height, width = layout.mcu[0] // scale, layout.mcu[1] // scale
    y = (places // layout.columns * height)[:, None, None] + _middle(height)[:, None]
    x = (places % layout.columns * width)[:, None, None] + _middle(width)
    return np.asarray(image[np.minimum(y, image.shape[0] - 1), np.minimum(x, image.shape[1] - 1)])


def _middle(length: int) -> NDArray[np.intp]:
    return np.arange(length // 4, max(3 * length // 4, length // 4 + 1))


def _opened(data: bytes, flags: int = _FLAGS, *, why: str = "a JPEG that cannot be decoded") -> Image:
    try:
        image = cv2.imdecode(np.frombuffer(data, np.uint8), flags)
    except cv2.error as error:
        raise CorruptPictureError(str(error)) from error
    if image is None:
        raise CorruptPictureError(why)
    return np.asarray(image, np.uint8)
