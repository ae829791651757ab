"""What is recorded of one camera frame: the bytes as the camera gave them, its time and its light."""

import struct
from dataclasses import dataclass
from typing import Annotated

import cv2
import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from gellight.base.allowed import MOST_SIDE_PX, Byte, StrictModel
from gellight.base.errors import InputError
from gellight.base.png import is_whole
from gellight.frames.frames import CameraFrame, CaptureStamp, ExposureSeries, LightLabel
from gellight.frames.jpeg import CorruptPictureError
from gellight.frames.shear import DotFigures, DotsSeen
from gellight.recording.ros_messages import RosImage, decode_compressed, encode_compressed
from gellight.sensor.v4l2.formats import Mode, decode

NO_SERIES = (
    "depth is made of several pictures under different lights, which a recording does not hold: record in mode "
    "network, with a bundle of one light"
)
JPEG, PNG = "MJPG", "PNG"
_PACKING = (cv2.IMWRITE_PNG_STRATEGY, cv2.IMWRITE_PNG_STRATEGY_HUFFMAN_ONLY,
            cv2.IMWRITE_PNG_FILTER, cv2.IMWRITE_PNG_FILTER_AVG)  # fmt: skip
"""what packs the noise of a camera best: to 0.32, in 10 ms of 640 x 480 pixels; OpenCV's own choice 0.34 and 12 ms"""
ENCODINGS = {"RGB3": "rgb8", "GREY": "mono8", "YUYV": "yuv422_yuy2"}
"""of ROS, by the format of the camera"""
_PNG_SIZE = slice(16, 24)
"""where a PNG says its width and height"""
Size = Annotated[int, Field(gt=0, le=MOST_SIDE_PX)]  # of a picture


class FrameInfo(StrictModel):
    """What stands beside the picture, as JSON."""

    sequence: int
    time_s: float
    """start of the exposure on the monotonic clock of the computer that recorded"""
    unix_s: float
    """the same on the clock of `time.time`"""
    letters: str
    """format of the bytes, as V4L2 names it, MJPG, YUYV, RGB3 or GREY; or PNG where the camera gave no bytes"""
    width: Size
    height: Size
    line_bytes: int = Field(ge=0, le=4 * MOST_SIDE_PX)
    light: tuple[tuple[Byte, Byte, Byte], ...] | None
    label: LightLabel | None
    zero: str
    """identity of the calibration bundle with the zero that was in use; an attachment holds it"""
    dots: DotFigures | None = None
    """where the marker dots were, which are filled in the picture; not there for a gel without"""


@dataclass(frozen=True, kw_only=True)
class FrameRecord:
    """A frame as it stands in a recording."""

    info: FrameInfo
    data: bytes
    """as the camera gave it; where it gave no bytes, RGB, packed or not: nothing is lost"""

    @classmethod
    def of(cls, frame: CameraFrame, stamp: CaptureStamp, *, packed: bool = True) -> "FrameRecord":
        """Return what is recorded of a camera frame and its stamp; packed: a picture without the camera's own bytes.

        InputError for a series of exposures, of which a recording would keep the first.
        """
        if isinstance(frame, ExposureSeries):
            raise InputError(NO_SERIES)
        encoded, (height, width) = frame.encoded, frame.image.shape[:2]
        info = FrameInfo(
            sequence=frame.sequence,
            time_s=frame.time_s,
            unix_s=stamp.unix_s,
            letters=encoded.letters if encoded else PNG if packed else "RGB3",
            width=width,
            height=height,
            line_bytes=encoded.line_bytes if encoded else 0,
            light=None if frame.light is None else tuple(map(tuple, frame.light.tolist())),
            label=frame.label,
            zero=stamp.zeroed.identity,
            dots=DotFigures.of(frame.dots) if frame.dots else None,
        )
        own = packed_picture(frame.image) if packed and not encoded else frame.image.tobytes()
        return cls(info=info, data=encoded.data if encoded else own)

    @property
    def compressed(self) -> bool:
        """Whether the bytes are a JPEG or a PNG."""
        return self.info.letters in (JPEG, PNG)

    def message(self, frame_id: str) -> bytes:
        """Return the message of ROS 2: CompressedImage of a JPEG or a PNG, else Image."""
        info = self.info
        if self.compressed:
            return encode_compressed(self.data, info.unix_s, frame_id, "png" if info.letters == PNG else "jpeg")
        encoding, step = ENCODINGS[info.letters], info.line_bytes or len(self.data) // info.height
        data = self.data[: step * info.height]
        image = RosImage(height=info.height, width=info.width, encoding=encoding, step=step, data=data)
        return image.encode(info.unix_s, frame_id)

    @classmethod
    def read(cls, info: FrameInfo, message: bytes) -> "FrameRecord":
        """Return the frame of a message; ValueError where it is damaged."""
        data = decode_compressed(message) if info.letters in (JPEG, PNG) else RosImage.decode(message).data
        return cls(info=info, data=data)

    def camera_frame(self, source: str) -> CameraFrame:
        """Return the frame as it was live, without its stamp; InputError, naming `source`, where it is damaged."""
        info = self.info
        light = None if info.light is None else np.array(info.light, np.uint8).reshape(-1, 3)
        return CameraFrame(
            image=self.image(source), time_s=info.time_s, sequence=info.sequence, source=source, light=light,
            label=info.label, dots=self._dots(source),
        )  # fmt: skip

    def _dots(self, source: str) -> DotsSeen | None:
        try:
            return self.info.dots.dots() if self.info.dots else None
        except ValueError as error:
            raise InputError(f"{source}: the dots of frame {self.info.sequence} are damaged ({error})") from None

    def image(self, source: str) -> NDArray[np.uint8]:
        """Return (H, W, 3) RGB, decoded as when it was live; InputError, naming `source`, for a damaged picture."""
        info = self.info
        if info.letters == PNG:
            return self._unpacked(source)
        mode = Mode(letters=info.letters, width=info.width, height=info.height, fps=1.0, line_bytes=info.line_bytes)
        try:
            return decode(self.data, mode)
        except (CorruptPictureError, KeyError) as error:
            raise InputError(f"{source}: frame {info.sequence} cannot be decoded ({error}): record it again") from error

    def _unpacked(self, source: str) -> NDArray[np.uint8]:
        # A damaged header would take all memory.
        said = self.data[_PNG_SIZE] == struct.pack(">II", self.info.width, self.info.height)
        sound = said and is_whole(self.data)
        image = cv2.imdecode(np.frombuffer(self.data, np.uint8), cv2.IMREAD_COLOR_RGB) if sound else None
        if image is None:
            raise InputError(f"{source}: frame {self.info.sequence} cannot be decoded: record it again")
        return np.asarray(image, np.uint8)


def packed_picture(image: NDArray[np.uint8]) -> bytes:
    """Return a (H, W, 3) RGB picture as a PNG."""
    return cv2.imencode(".png", cv2.cvtColor(image, cv2.COLOR_RGB2BGR), _PACKING)[1].tobytes()
