"""What a camera offers, the choice from it (pixel format, size, frame rate), and from its bytes to RGB."""

import errno
from collections.abc import Callable, Iterator, Sequence
from ctypes import Structure
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import CameraError
from gellight.frames.jpeg import CorruptPictureError, decode_jpeg
from gellight.sensor.v4l2 import structures as v

Ask = Callable[[int, Structure], None]
"""an ioctl on one open device; raises OSError"""

DECODABLE = ("MJPG", "YUYV", "RGB3", "GREY")
"""in order of preference: MJPG lets several sensors share one bus; grey, the last choice, has no colours"""
USUAL_FPS = 30.0  # chosen: where no rate is asked for, the nearest to it is taken
RATE_TOLERANCE = 0.01
"""share by which a rate may differ from the one that is asked for"""
_TOO_MANY = 4096  # chosen: ends the list of a driver that does not end it


@dataclass(frozen=True, kw_only=True)
class Offer:
    """One pixel format in one size, or in a range of sizes, with its frame rates."""

    letters: str
    width: int
    height: int
    """the largest, where a range is offered"""
    rates: tuple[float, ...]
    """frames per second, highest first; empty where the camera does not list them"""
    smallest: tuple[int, int] | None = None
    """(width, height) of the smallest, where a range is offered"""
    step: tuple[int, int] = (1, 1)
    any_rate: bool = False
    """every rate between the highest and the lowest is offered, not these two alone"""

    def has(self, width: int, height: int) -> bool:
        """Whether it comes in this size."""
        if self.smallest is None:
            return (width, height) == (self.width, self.height)
        widths = range(self.smallest[0], self.width + 1, self.step[0])
        return width in widths and height in range(self.smallest[1], self.height + 1, self.step[1])

    def rate_near(self, fps: float) -> float:
        """Return the offered rate nearest to `fps`; `fps` itself where the camera lists none."""
        if not self.rates:
            return fps
        if self.any_rate:
            return min(max(fps, self.rates[-1]), self.rates[0])
        return min(self.rates, key=lambda rate: abs(rate - fps))

    def __str__(self) -> str:
        """In words: MJPG 640x480 at 30, 15 fps."""
        first = f"{self.smallest[0]}x{self.smallest[1]} to " if self.smallest else ""
        rates = (" to " if self.any_rate else ", ").join(f"{rate:g}" for rate in self.rates) or "?"
        return f"{self.letters} {first}{self.width}x{self.height} at {rates} fps"


@dataclass(frozen=True, kw_only=True)
class Wanted:
    """What is asked of a camera; None leaves it to the choice."""

    width: int | None = None
    height: int | None = None
    letters: str | None = None
    fps: float | None = None

    def __str__(self) -> str:
        """In words."""
        size = f"{self.width}x{self.height}" if self.width else "any size"
        return f"{self.letters or ' or '.join(DECODABLE)} {size}" + (f" at {self.fps:g} fps" if self.fps else "")


@dataclass(frozen=True, kw_only=True)
class Mode:
    """What a camera is set to."""

    letters: str
    width: int
    height: int
    fps: float
    line_bytes: int = 0
    """of a picture line in memory; 0 for compressed pictures"""

    def __str__(self) -> str:
        """In words."""
        return f"{self.letters} {self.width}x{self.height} at {self.fps:g} fps"


def offers(ask: Ask) -> tuple[Offer, ...]:
    """List everything the camera offers, in its own order."""
    described = _entries(ask, v.ENUM_FMT, lambda index: v.FormatDescription(index=index, type=v.CAPTURE))
    formats = [v.fourcc(entry.pixelformat) for entry in described]
    return tuple(_with_rates(ask, size) for letters in formats for size in _sizes(ask, letters))


def choose(offered: Sequence[Offer], wanted: Wanted, *, path: str) -> Mode:
    """Return the best mode that is what was wanted; CameraError lists what is offered where none is."""
    letters = (wanted.letters,) if wanted.letters else DECODABLE
    modes = [_mode_of(offer, wanted) for offer in offered if offer.letters in letters]
    fitting = [mode for mode in modes if mode is not None]
    if not fitting or (wanted.letters or DECODABLE[0]) not in DECODABLE:
        raise CameraError(not_offered(offered, wanted, path=path))
    usual = wanted.fps or USUAL_FPS
    return min(fitting, key=lambda mode: (DECODABLE.index(mode.letters), -mode.width * mode.height,
                                          abs(mode.fps - usual)))  # fmt: skip


def not_offered(offered: Sequence[Offer], wanted: Wanted, *, path: str) -> str:
    """Return the message that lists what a camera offers instead."""
    usable = "; ".join(str(offer) for offer in offered if offer.letters in DECODABLE)
    other = ", ".join(sorted({offer.letters for offer in offered} - set(DECODABLE)))
    listed = usable or "nothing that can be decoded"
    return (
        f"{path} does not offer {wanted}; it offers {listed}{f' (and {other}, not decoded)' if other else ''}: choose "
        "one of these with ?width=&height=&format=&fps=, and the calibration bundle that was made with it"
    )


def _mode_of(offer: Offer, wanted: Wanted) -> Mode | None:
    width, height = wanted.width or offer.width, wanted.height or offer.height
    if not offer.has(width, height):
        return None
    fps = offer.rate_near(wanted.fps or USUAL_FPS) if wanted.fps or offer.rates else 0.0
    if wanted.fps and abs(fps - wanted.fps) > RATE_TOLERANCE * wanted.fps:
        return None
    return Mode(letters=offer.letters, width=width, height=height, fps=fps)


def _entries(ask: Ask, request: int, entry: Callable[[int], Structure]) -> Iterator[Structure]:
    """Yield the entries of a list that the kernel numbers and ends with EINVAL (ENOTTY: it has no such list)."""
    for index in range(_TOO_MANY):
        found = entry(index)
        try:
            ask(request, found)
        except OSError as error:
            if error.errno in (errno.EINVAL, errno.ENOTTY):
                return
            raise
        yield found


def _sizes(ask: Ask, letters: str) -> list[Offer]:
    code = v.code_of(letters)
    found = []
    for entry in _entries(ask, v.ENUM_FRAMESIZES, lambda index: v.FrameSize(index=index, pixel_format=code)):
        values = list(entry.size.values)
        if entry.type == v.FRAME_DISCRETE:
            found.append(Offer(letters=letters, width=values[0], height=values[1], rates=()))
        else:
            low_x, high_x, step_x, low_y, high_y, step_y = values
            found.append(Offer(letters=letters, width=high_x, height=high_y, rates=(), smallest=(low_x, low_y),
                               step=(max(step_x, 1), max(step_y, 1))))  # fmt: skip
            break  # a range is the only entry, whatever is asked for further
    return found


def _with_rates(ask: Ask, size: Offer) -> Offer:
    code, rates, any_rate = v.code_of(size.letters), set(), False
    for entry in _entries(
        ask, v.ENUM_FRAMEINTERVALS,
        lambda index: v.FrameInterval(index=index, pixel_format=code, width=size.width, height=size.height),
    ):  # fmt: skip
        values = list(entry.values)
        any_rate = entry.type != v.FRAME_DISCRETE
        intervals = [values[:2], values[2:4]] if any_rate else [values[:2]]
        rates |= {round(below / above, 3) for above, below in intervals if above and below}
        if any_rate:
            break  # a range is the only entry, whatever is asked for further
    return replace(size, rates=tuple(sorted(rates, reverse=True)), any_rate=any_rate)


def decode(data: bytes, mode: Mode) -> NDArray[np.uint8]:
    """Return (H, W, 3) uint8 RGB of a picture taken in `mode`; CorruptPictureError unless it is whole."""
    if mode.letters == "MJPG":
        return decode_jpeg(data, (mode.height, mode.width))
    pixel_bytes = {"YUYV": 2, "RGB3": 3, "GREY": 1}[mode.letters]
    line_bytes = mode.line_bytes or mode.width * pixel_bytes
    if len(data) < line_bytes * mode.height:
        raise CorruptPictureError(f"{len(data)} bytes instead of {line_bytes * mode.height}")
    lines = np.frombuffer(data, np.uint8, line_bytes * mode.height).reshape(mode.height, line_bytes)
    pixels = np.ascontiguousarray(lines[:, : mode.width * pixel_bytes]).reshape(mode.height, mode.width, pixel_bytes)
    if mode.letters == "YUYV":
        return np.asarray(cv2.cvtColor(pixels, cv2.COLOR_YUV2RGB_YUYV), np.uint8)
    return np.repeat(pixels, 3, axis=2) if mode.letters == "GREY" else pixels.copy()
