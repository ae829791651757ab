"""The file of a recording: MCAP in the profile of ROS 2, packed by Zstandard, with the bundle as an attachment.

    /NAME/frame                        std_msgs/String, JSON: FrameInfo
    /NAME/image_raw[/compressed]       sensor_msgs/Image or CompressedImage: the bytes of the camera, or a PNG
    /NAME/depth                        sensor_msgs/Image 32FC1, metres, on request
    /NAME/depth_tenth_um               sensor_msgs/Image 16UC1, tenths of a micrometre, 0 to 6.5535 mm, on request
    /NAME/pressure_mpa                 sensor_msgs/Image 32FC1, N / mm2, on request, where the bundle knows its force
    /NAME/confidence                   sensor_msgs/Image 32FC1, 0.05 to 1, on request
    /NAME/quality_flags                sensor_msgs/Image mono8, with the confidence: bits, see `frames.measures`
    /NAME/contact                      std_msgs/String, JSON, with depth or one of these maps: ContactInfo
    calibration-IDENTITY.gelcal        attachments: the bundle with the zero in use; another one after each re-zero

The file is written in chunks of `CHUNK_BYTES`. What ends the writing at once, such as a loss of power, costs the last
chunk and the index, and what is left can be read.
"""

import os
import struct
import time
from collections.abc import Collection, Iterator
from contextlib import AbstractContextManager
from io import BufferedReader
from pathlib import Path
from typing import Any

import numpy as np
import zstandard
from mcap.exceptions import EndOfFile, InvalidMagic, McapError
from mcap.records import Attachment, Channel, Chunk, DataEnd, Header, McapRecord, Message
from mcap.stream_reader import StreamReader, breakup_chunk
from mcap.writer import CompressionType, Writer
from numpy.typing import NDArray
from pydantic import ValidationError

from gellight.base.allowed import StrictModel
from gellight.base.errors import BundleError, InputError, first_line
from gellight.bundle.bundle import Bundle, packed_bundle, unpack_bundle
from gellight.frames.frames import CameraFrame, CaptureStamp, Patch, Provenance, TactileFrame
from gellight.frames.measures import MapOnRequest
from gellight.frames.pose import PoseFigures
from gellight.frames.shear import ShearFigures
from gellight.recording.frame_record import FrameInfo, FrameRecord, packed_picture
from gellight.recording.kinds import DepthKind
from gellight.recording.ros_messages import (
    COMPRESSED_IMAGE,
    DEFINITIONS,
    IMAGE,
    STRING,
    RosImage,
    decode_string,
    encode_string,
)

CHUNK_BYTES = 4 << 20  # measured: a loss of power costs half a second of sim://
MOST_RECORD_BYTES = 1 << 28
"""of one record of the file: no picture and no bundle is larger"""
ZSTD = "zstd"
"""of a chunk, as MCAP names it; those of before are not packed"""
FRAME, IMAGE_RAW, COMPRESSED, DEPTH, DEPTH_16, CONTACT = (
    "frame", "image_raw", "image_raw/compressed", "depth", "depth_tenth_um", "contact",
)  # fmt: skip
TYPES = {FRAME: STRING, IMAGE_RAW: IMAGE, COMPRESSED: COMPRESSED_IMAGE, CONTACT: STRING}
"""of ROS, by topic; all others are `IMAGE`"""
_ENCODINGS = {"float32": "32FC1", "uint8": "mono8"}
"""of ROS, by NumPy's type of a map"""
_ATTACHED = "calibration-"
_M_PER_MM, _UNITS_PER_MM = np.float32(1e-3), 1e4  # ROS has metres; the integer depth tenths of a micrometre


class ContactInfo(StrictModel):
    """The contact of one frame, and with what its depth was computed."""

    sequence: int
    calibration: str
    zero: str
    indentation_mm: float
    area_mm2: float
    centroid_mm: tuple[float, float] | None
    force_n: float | None = None
    """normal force; None where the bundle has no constant for it"""
    force_error_n: float | None = None
    shear: ShearFigures | None = None
    """None for a gel without marker dots"""
    contacts: tuple[Patch, ...] = ()
    pose: PoseFigures | None = None
    """where the object has gone; None where nobody tracked it, or nothing touched"""


class RecordingWriter(AbstractContextManager["RecordingWriter"]):
    """Writes a recording; a context manager that finishes the file."""

    def __init__(
        self, path: Path, name: str, *, depth: DepthKind = DepthKind.NONE, maps: Collection[MapOnRequest] = ()
    ) -> None:
        """Begin a file; InputError where it exists or cannot be written. `name`: of the sensor, in topics."""
        self.path, self.name, self.depth, self.maps = path, name, depth, maps
        try:
            self._file = path.open("xb")
        except FileExistsError:
            raise InputError(f"{path} exists: choose another name") from None
        except OSError as error:
            raise InputError(f"{path} cannot be written ({error.strerror}): choose another folder") from error
        self._writer = Writer(self._file, chunk_size=CHUNK_BYTES, compression=CompressionType.ZSTD)
        self._writer.start(profile="ros2", library="gellight")
        self._channels: dict[str, int] = {}
        self._zeros: set[str] = set()

    def add(self, frame: CameraFrame, stamp: CaptureStamp, *, packed: bool = True) -> None:
        """Write a camera frame, and the bundle it was taken under, once. OSError where the disk is full."""
        record = FrameRecord.of(frame, stamp, packed=packed)
        if record.info.zero not in self._zeros:
            self._zeros.add(record.info.zero)
            name, now_ns = f"{_ATTACHED}{record.info.zero}.gelcal", time.time_ns()
            self._writer.add_attachment(now_ns, now_ns, name, "application/zip", packed_bundle(stamp.zeroed))
        self._put(FRAME, record.info, encode_string(record.info.model_dump_json(exclude_defaults=True)))
        self._put(COMPRESSED if record.compressed else IMAGE_RAW, record.info, record.message(self.name))

    @property
    def of_tactile_frames(self) -> bool:
        """Whether anything is written of tactile frames."""
        return self.depth is not DepthKind.NONE or bool(self.maps)

    def add_tactile(self, frame: TactileFrame) -> None:
        """Write contact, depth and maps of a frame, as far as they were asked for. OSError where the disk is full."""
        provenance = frame.provenance
        if not self.of_tactile_frames or provenance is None:
            return
        stamp = FrameStamp(sequence=frame.camera_frame.sequence, unix_s=provenance.unix_s)
        self._put(CONTACT, stamp, encode_string(_contact_info(frame, provenance).model_dump_json()))
        for topic, image in self._images(frame).items():
            self._put(topic, stamp, image.encode(provenance.unix_s, self.name))

    def bytes_of(self, frame: TactileFrame) -> int:
        """Return what is written of a camera frame and its maps, but for some figures."""
        taken = frame.camera_frame
        picture = taken.encoded.data if taken.encoded else packed_picture(taken.image)
        return sum(
            len(zstandard.compress(one)) for one in (picture, *(map_.data for map_ in self._images(frame).values()))
        )

    def _images(self, frame: TactileFrame) -> dict[str, RosImage]:
        """Return depth and maps as messages, by topic, as far as they were asked for."""
        images = {name: _map_image(values) for name, values in frame.maps_on_request(self.maps).items()}
        if self.depth is not DepthKind.NONE:
            topic = DEPTH if self.depth is DepthKind.FLOAT32 else DEPTH_16
            images[topic] = depth_image(frame.depth_mm, self.depth)
        return images

    def _put(self, topic: str, stamp: "FrameInfo | FrameStamp", content: bytes) -> None:
        if topic not in self._channels:
            kind = TYPES.get(topic, IMAGE)
            schema = self._writer.register_schema(kind, "ros2msg", DEFINITIONS[kind].encode())
            self._channels[topic] = self._writer.register_channel(f"/{topic_name(self.name)}/{topic}", "cdr", schema)
        time_ns = round(stamp.unix_s * 1e9)
        self._writer.add_message(self._channels[topic], time_ns, content, time_ns, stamp.sequence % 2**32)

    def flush(self) -> None:
        """Give finished chunks to the system: a process that is killed loses only what came after."""
        self._file.flush()

    def close(self) -> None:
        """Finish the file; OSError where the disk is full, and then the index at its end is missing."""
        try:
            self._writer.finish()  # type: ignore[no-untyped-call]  # mcap does not annotate it
        finally:
            self._file.close()

    def __exit__(self, *problem: object) -> None:
        """Finish the file."""
        self.close()


class FrameStamp(StrictModel):
    """Which frame a message belongs to."""

    sequence: int
    unix_s: float


def topic_name(name: str) -> str:
    """Return the name of a sensor as ROS allows it in a topic."""
    plain = "".join(letter if letter.isascii() and letter.isalnum() else "_" for letter in name)
    return plain if plain[:1].isalpha() else f"gellight_{plain}"


def depth_image(depth_mm: NDArray[np.float32], kind: DepthKind) -> RosImage:
    """Return depth as a message: metres in float32, or tenths of a micrometre in uint16, clipped to 0..6.5535 mm."""
    if kind is DepthKind.FLOAT32:
        values: NDArray[np.generic] = depth_mm * _M_PER_MM
        encoding, size = "32FC1", 4
    else:
        values = np.clip(np.rint(depth_mm * _UNITS_PER_MM), 0, 65535).astype("<u2")
        encoding, size = "16UC1", 2
    height, width = depth_mm.shape
    return RosImage(height=height, width=width, encoding=encoding, step=size * width, data=values.tobytes())


def _contact_info(frame: TactileFrame, provenance: Provenance) -> ContactInfo:
    contact = frame.contact
    return ContactInfo(
        sequence=frame.camera_frame.sequence,
        calibration=provenance.calibration,
        zero=provenance.zero,
        indentation_mm=contact.indentation_mm,
        area_mm2=contact.area_mm2,
        centroid_mm=contact.centroid_mm,
        force_n=frame.force.normal_n if frame.force else None,
        force_error_n=frame.force.error_n if frame.force else None,
        shear=ShearFigures.of(frame.shear) if frame.shear else None,
        contacts=frame.contacts,
        pose=frame.pose.figures() if frame.pose else None,
    )


def _map_image(values: NDArray[np.generic]) -> RosImage:
    """Return a (H, W) map as a message, its numbers as they are."""
    (height, width), encoding = values.shape, _ENCODINGS[values.dtype.name]
    return RosImage(height=height, width=width, encoding=encoding, step=width * values.itemsize, data=values.tobytes())


# ---- reading ----


class _Bounded:
    """A file of which nobody reads more at once than there is: a damaged length would take all memory."""

    def __init__(self, file: BufferedReader) -> None:
        self._file, self._size = file, os.fstat(file.fileno()).st_size

    def read(self, length: int) -> bytes:
        return self._file.read(max(min(length, self._size - self._file.tell()), 0))


class Recording:
    """A recording that is read from its beginning to its end, as often as asked."""

    def __init__(self, path: Path) -> None:
        """Look at the beginning; InputError for what is no recording of GelLight, with the reason."""
        self.path = path
        self.bundles: dict[str, Bundle] = {}
        """by identity, those that were met up to now"""
        self.whole = True
        """whether the end was found, where it was reached; else the writing was cut short"""
        first = next(self.frames(), None)
        if first is None or first.info.zero not in self.bundles:
            raise InputError(f"{path} has no frames of GelLight: record it again with `gellight record`")
        self.first = first

    @property
    def bundle(self) -> Bundle:
        """The calibration bundle with the zero of the first frame."""
        return self.bundles[self.first.info.zero]

    def frames(self, from_s: float = 0.0) -> Iterator[FrameRecord]:
        """Yield the frames, those before `from_s` after the first left out; InputError where the file is damaged.

        Times are those of the monotonic clock: the time of day may have been set while it was recorded.
        """
        info: FrameInfo | None = None
        begun_s: float | None = None
        for topic, content in self._messages():
            if topic == FRAME:
                info = self._info(content)
                begun_s = info.time_s if begun_s is None else begun_s
            elif topic in (IMAGE_RAW, COMPRESSED) and info is not None:
                if info.time_s - (begun_s or 0.0) >= from_s:
                    yield self._checked(info, content)
                info = None

    def depths(self) -> Iterator[tuple[ContactInfo, RosImage]]:
        """Yield recorded depth with its contact; InputError where the file is damaged."""
        return self.maps(DEPTH, DEPTH_16)

    def maps(self, *topics: str) -> Iterator[tuple[ContactInfo, RosImage]]:
        """Yield the recorded maps of some topics with their contact; InputError where the file is damaged."""
        info: ContactInfo | None = None
        for topic, content in self._messages():
            try:
                if topic == CONTACT:
                    info = ContactInfo.model_validate_json(decode_string(content))
                elif topic in topics and info is not None:
                    yield info, RosImage.decode(content)
            except ValueError as error:
                raise self._damaged(error) from None

    def _info(self, content: bytes) -> FrameInfo:
        try:
            return FrameInfo.model_validate_json(decode_string(content))
        except (ValueError, ValidationError) as error:
            raise self._damaged(error) from None

    def _checked(self, info: FrameInfo, content: bytes) -> FrameRecord:
        try:
            return FrameRecord.read(info, content)
        except ValueError as error:
            raise self._damaged(error) from None

    def _damaged(self, error: Exception) -> InputError:
        return InputError(f"{self.path} is damaged ({first_line(error)}): copy or record it again")

    def _messages(self) -> Iterator[tuple[str, bytes]]:
        """Yield what a message is of, and its content; note the bundles on the way."""
        topics: dict[int, str] = {}
        try:
            with self.path.open("rb") as file:
                for record in self._records(file):
                    if isinstance(record, Channel):
                        topics[record.id] = record.topic.split("/", 2)[-1]
                    elif isinstance(record, Message):
                        yield topics.get(record.channel_id, ""), record.data
                    elif isinstance(record, Attachment) and record.name.startswith(_ATTACHED):
                        self._note_bundle(record)
        except OSError as error:
            raise InputError(f"{self.path} cannot be read ({error.strerror}): check the name") from error

    def _note_bundle(self, attachment: Attachment) -> None:
        identity = attachment.name.removeprefix(_ATTACHED).removesuffix(".gelcal")
        if identity not in self.bundles:
            try:
                self.bundles[identity] = unpack_bundle(attachment.data, f"{self.path}: {attachment.name}")
            except BundleError as error:
                raise InputError(f"{error}; the recording {self.path} is damaged") from error

    def _records(self, file: BufferedReader) -> Iterator[McapRecord]:
        """Yield the records, those in chunks too; a file that is cut off ends with its last whole chunk."""
        bounded: Any = _Bounded(file)
        reader = iter(StreamReader(bounded, emit_chunks=True, record_size_limit=MOST_RECORD_BYTES).records)
        self.whole = False
        while True:
            try:
                record = next(reader)
                if isinstance(record, DataEnd):
                    self.whole = True
                    return
                yield from self._opened(record)
            except InvalidMagic:
                raise InputError(f"{self.path} is no MCAP file: give a recording of `gellight record`") from None
            except (StopIteration, EndOfFile, struct.error):
                return
            except (McapError, zstandard.ZstdError, ValueError, KeyError, OverflowError) as error:
                raise self._damaged(error) from None

    def _opened(self, record: McapRecord) -> list[McapRecord]:
        if isinstance(record, Header) and record.library != "gellight":
            raise InputError(
                f"{self.path} was written by {record.library or 'another program'}, not by `gellight record`"
            )
        if not isinstance(record, Chunk):
            return [record]
        if record.compression not in ("", ZSTD):
            raise InputError(f"{self.path} is packed by {record.compression}: give `mcap compress --compression zstd`")
        if record.compression and not 0 <= zstandard.frame_content_size(record.data) <= MOST_RECORD_BYTES:
            raise ValueError("a chunk says a size that none has")
        return breakup_chunk(record, validate_crc=True)
