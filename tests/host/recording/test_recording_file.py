"""A recording gives back what went in; what is damaged, cut off or foreign is read as far as it goes, or refused."""

import json
import struct
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.writer import MCAP0_MAGIC, CompressionType, Writer

from gellight.base.errors import InputError
from gellight.bundle.bundle import Bundle
from gellight.frames.frames import CaptureStamp
from gellight.frames.measures import MapOnRequest
from gellight.frames.shear import DotsSeen
from gellight.opening import open_camera
from gellight.recording import recording_file
from gellight.recording.frame_record import FrameRecord
from gellight.recording.kinds import DepthKind
from gellight.recording.recording_file import (
    ContactInfo,
    Recording,
    RecordingWriter,
    depth_image,
    topic_name,
)
from gellight.recording.ros_messages import RosImage, encode_compressed, encode_string
from tests.helpers.recorded import SHAPE, encoded, picture, plain, read_all
from tests.helpers.streamed import full_frame
from tests.helpers.weighed import HeavyFrames

Record = Callable[..., Path]


@pytest.mark.parametrize("letters", ["MJPG", "YUYV", "GREY"])
def test_the_bytes_of_the_camera_are_kept_and_decoded_as_when_they_were_live(record: Record, letters: str) -> None:
    sent = encoded(5, letters)
    recording = Recording(record([sent]))
    assert recording.first.data == sent.encoded.data
    (got,) = read_all(f"replay://{recording.path}?speed=0")
    assert got.image.shape == (*SHAPE, 3)
    if letters == "MJPG":
        assert np.array_equal(got.image, cv2.imdecode(np.frombuffer(sent.encoded.data, np.uint8), cv2.IMREAD_COLOR_RGB))
    if letters == "GREY":
        assert np.array_equal(got.image[..., 0], sent.image[..., 0])


@pytest.mark.parametrize(("kind", "error_mm"), [(DepthKind.FLOAT32, 1e-7), (DepthKind.UINT16, 0.51e-4)])
def test_recorded_depth_comes_back(record: Record, kind: DepthKind, error_mm: float) -> None:
    recording = Recording(record([plain(1)], depth=kind))
    ((info, image),) = recording.depths()
    sent = full_frame()
    assert info.indentation_mm == sent.contact.indentation_mm
    assert info.contacts == sent.contacts
    numbers = np.frombuffer(image.data, "<f4" if kind is DepthKind.FLOAT32 else "<u2").reshape(SHAPE)
    got_mm = numbers * (1e3 if kind is DepthKind.FLOAT32 else 1e-4)
    assert np.abs(got_mm - np.clip(sent.depth_mm, 0, 6.5535)).max() < error_mm


def test_the_contact_of_an_older_recording_is_read_and_depth_that_uint16_cannot_hold_is_clipped() -> None:
    old = ContactInfo(sequence=1, calibration="c", zero="z", indentation_mm=1.0, area_mm2=2.0, centroid_mm=(0.0, 1.0))
    assert ContactInfo.model_validate_json(old.model_dump_json(exclude={"contacts"})) == old
    depth = np.array([[-0.5, 7.0, 0.00005]], np.float32)
    assert np.frombuffer(depth_image(depth, DepthKind.UINT16).data, "<u2").tolist() == [0, 65535, 0]


def test_maps_come_back(tmp_path: Path, bundle: Bundle) -> None:
    path, felt, frame = tmp_path / "maps.mcap", replace(full_frame(), measures=HeavyFrames()), plain(1)
    with RecordingWriter(path, "finger", maps=list(MapOnRequest)) as writer:
        writer.add(frame, CaptureStamp(zeroed=bundle, unix_s=1e9))
        writer.add_tactile(felt)
    for name, values in felt.maps_on_request().items():
        ((info, image),) = Recording(path).maps(name)
        assert (info.force_n, info.force_error_n) == (1.25, 0.1)
        assert np.array_equal(np.frombuffer(image.data, values.dtype).reshape(SHAPE), values)
        assert (image.height, image.width, image.step) == (*SHAPE, SHAPE[1] * values.itemsize)
        assert image.encoding == ("mono8" if name == "quality_flags" else "32FC1")


# ---- its pace ----


def test_it_is_played_at_its_own_pace_or_another(record: Record) -> None:
    path = record([plain(number) for number in range(4)])

    def seconds(query: str) -> float:
        frames = read_all(f"replay://{path}?{query}")
        return frames[-1].time_s - frames[0].time_s

    assert seconds("speed=1") == pytest.approx(0.1, abs=1e-6)
    assert seconds("speed=0.5") == pytest.approx(0.2, abs=1e-6)


def test_it_begins_where_it_is_asked_to_and_begins_again(record: Record) -> None:
    path = record([plain(number) for number in range(10, 14)])
    assert [frame.sequence for frame in read_all(f"replay://{path}?speed=0&start=0.05")] == [12, 13]
    for start, begins in ((0, 10), (0.05, 12)):
        with open_camera(f"replay://{path}?speed=0&loop=1&start={start}") as camera:
            assert [camera.read().sequence for _ in range(9)] == list(range(begins, begins + 9)), "none seems lost"
            assert (camera.status()["recording"], camera.status()["speed"]) == (str(path), 0)


@pytest.mark.parametrize("query", ["speed=-1", "speed=nan", "start=-3", "sped=1", "loop=maybe"])
def test_a_wrong_parameter_is_refused(record: Record, query: str) -> None:
    with pytest.raises(InputError, match=query.partition("=")[0]):
        open_camera(f"replay://{record([plain(0)])}?{query}")


# ---- other programs ----


def test_a_record_in_a_chunk_that_says_it_is_longer_than_any_memory_is_damaged(tmp_path: Path) -> None:
    header = struct.pack("<II8s", 0, 8, b"gellight")
    record = struct.pack("<BQ", 0x7F, 1 << 63)  # of no kind that is known
    chunk = struct.pack("<QQQI", 0, 0, len(record), 0) + struct.pack("<IQ", 0, len(record)) + record
    path = tmp_path / "long.mcap"
    with path.open("wb") as file:
        file.write(MCAP0_MAGIC)
        for code, content in ((Opcode.HEADER, header), (Opcode.CHUNK, chunk)):
            file.write(struct.pack("<BQ", code, len(content)) + content)
    with pytest.raises(InputError, match=r"long\.mcap is damaged .*: copy or record it again"):
        Recording(path)


def test_messages_are_the_bytes_that_ros_2_reads() -> None:
    """CDR in little-endian order: each number at a multiple of its size, texts with their 0."""
    header = "00010000 01000000 0065cd1d 04000000 63616d00"
    image = RosImage(height=2, width=1, encoding="mono8", step=1, data=b"ab")
    sent = "02000000 01000000 06000000 6d6f6e6f3800 00 00 01000000 02000000 6162"
    assert image.encode(1.5, "cam") == bytes.fromhex(header + sent)
    assert encode_compressed(b"ab", 1.5, "cam", "png") == bytes.fromhex(header + "04000000 706e6700 02000000 6162")
    assert encode_string("é") == bytes.fromhex("00010000 03000000 c3a900")


@pytest.mark.nightly
def test_it_opens_as_a_bag_of_ros_2(record: Record) -> None:
    path = record([plain(1), encoded(2, "MJPG"), encoded(3, "YUYV"), encoded(4, "GREY")], depth=DepthKind.FLOAT32)
    from rosbags.highlevel import AnyReader
    from rosbags.typesys import Stores, get_typestore

    store, seen = get_typestore(Stores.ROS2_HUMBLE), {}
    with AnyReader([path], default_typestore=store) as reader:
        for connection, stamp, raw in reader.messages():
            seen.setdefault(connection.topic, []).append((stamp, reader.deserialize(raw, connection.msgtype)))
    assert set(seen) == {
        f"/left_finger/{part}" for part in ("frame", "image_raw", "image_raw/compressed", "depth", "contact")
    }
    stamp, image = seen["/left_finger/image_raw/compressed"][0]
    assert image.format == "png"
    assert np.array_equal(cv2.imdecode(image.data, cv2.IMREAD_COLOR_RGB), picture(1)), "nothing is lost"
    assert image.header.stamp.sec * 10**9 + image.header.stamp.nanosec == stamp
    assert image.header.frame_id == "left finger"
    assert seen["/left_finger/image_raw/compressed"][1][1].format == "jpeg"
    raw, grey = (image for _, image in seen["/left_finger/image_raw"])
    assert (raw.encoding, raw.height, raw.width, raw.step) == ("yuv422_yuy2", *SHAPE, 2 * SHAPE[1])
    assert (grey.encoding, grey.step, len(grey.data)) == ("mono8", 80, 80 * SHAPE[0]), "lines as long as in memory"
    depth = seen["/left_finger/depth"][0][1]
    assert (depth.encoding, depth.height, depth.width, depth.step) == ("32FC1", *SHAPE, 4 * SHAPE[1])
    assert np.abs(depth.data.view("<f4") * 1e3 - full_frame().depth_mm.ravel()).max() < 1e-6, "metres"
    assert json.loads(seen["/left_finger/frame"][0][1].data)["sequence"] == 1


@pytest.mark.parametrize(
    ("name", "topic"), [("left finger", "left_finger"), ("12AB", "gellight_12AB"), ("é", "gellight__")]
)
def test_a_topic_is_one_that_ros_allows(name: str, topic: str) -> None:
    assert topic_name(name) == topic


# ---- cut short, damaged, foreign, or of before ----


def test_a_recording_that_was_cut_short_gives_its_whole_chunks(record: Record, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(recording_file, "CHUNK_BYTES", 1 << 17)
    path = record([plain(number) for number in range(250)])
    content = path.read_bytes()
    assert len(content) > 1e6
    path.write_bytes(content[: len(content) // 2])
    recording = Recording(path)
    numbers = [one.info.sequence for one in recording.frames()]
    assert not recording.whole
    assert numbers == list(range(len(numbers)))
    assert 75 < len(numbers) < 125


def test_a_chunk_can_be_read_as_soon_as_it_is_finished(
    tmp_path: Path, bundle: Bundle, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The end of the process, at any frame, costs less than one chunk, here of 8 frames."""
    monkeypatch.setattr(recording_file, "CHUNK_BYTES", 8 * len(plain(0).image.tobytes()))
    writer = RecordingWriter(tmp_path / "killed.mcap", "finger")
    for number in range(60):
        writer.add(plain(number), CaptureStamp(zeroed=bundle, unix_s=1e9 + number), packed=False)
        if number >= 8:
            recording = Recording(tmp_path / "killed.mcap")  # nothing more is written in its place
            assert len(list(recording.frames())) > number - 8
            assert not recording.whole
    writer.close()
    assert len(list(recording.frames())) == 60
    assert recording.whole


@pytest.mark.parametrize(
    ("content", "says"),
    [(b"", "no frames"), (b"GELF" * 100, "no MCAP file"), (b"\x89MCAP0\r\n", "no frames"), (b"\x89MCA", "no frames")],
)
def test_what_is_no_recording_is_refused(tmp_path: Path, content: bytes, says: str) -> None:
    (tmp_path / "a.mcap").write_bytes(content)
    with pytest.raises(InputError, match=says):
        Recording(tmp_path / "a.mcap")


def test_a_recording_of_another_program_is_refused(tmp_path: Path) -> None:
    with (tmp_path / "a.mcap").open("wb") as file:
        writer = Writer(file)
        writer.start(profile="ros2", library="libmcap 1.4")
        writer.finish()
    with pytest.raises(InputError, match=r"written by libmcap 1\.4"):
        Recording(tmp_path / "a.mcap")


@pytest.mark.parametrize(
    ("compression", "says"),
    [
        (CompressionType.LZ4, r"is packed by lz4.*compress --compression zstd"),
        (CompressionType.ZSTD, r"damaged .a chunk says a size"),
    ],
)
def test_a_recording_packed_otherwise_or_by_far_too_well_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, compression: CompressionType, says: str
) -> None:
    """How much a chunk unpacks to is said by the file itself, and may be anything."""
    monkeypatch.setattr(recording_file, "MOST_RECORD_BYTES", 10**6)
    with (tmp_path / "a.mcap").open("wb") as file:
        writer = Writer(file, compression=compression)
        writer.start(library="gellight")
        schema = writer.register_schema("x", "", b"")
        writer.add_message(writer.register_channel("/x", "cdr", schema), 0, bytes(10**6), 0)
        writer.finish()
    assert (tmp_path / "a.mcap").stat().st_size < 10_000
    with pytest.raises(InputError, match=says):
        Recording(tmp_path / "a.mcap")


def test_a_recording_of_before_and_a_frame_that_came_too_late_are_not_packed_and_read(
    tmp_path: Path, bundle: Bundle, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(recording_file, "CompressionType", SimpleNamespace(ZSTD=CompressionType.NONE))
    with RecordingWriter(tmp_path / "a.mcap", "finger") as writer:
        for packed in (False, True):
            writer.add(plain(1), CaptureStamp(zeroed=bundle, unix_s=1e9), packed=packed)
    assert plain(1).image.tobytes() in (tmp_path / "a.mcap").read_bytes()
    raw, packed = Recording(tmp_path / "a.mcap").frames()
    assert (raw.info.letters, packed.info.letters) == ("RGB3", "PNG")
    assert np.array_equal(raw.image("a"), plain(1).image)
    assert np.array_equal(packed.image("a"), plain(1).image)


@pytest.mark.parametrize("damage", [b"", b"PNG", b"huge"])
def test_a_picture_that_is_damaged_is_refused(damage: bytes, bundle: Bundle) -> None:
    whole = FrameRecord.of(plain(1), CaptureStamp(zeroed=bundle, unix_s=1e9))
    data = {b"huge": whole.data[:16] + b"\x7f\xff\xff\xff" * 2 + whole.data[24:]}.get(damage, damage)
    with pytest.raises(InputError, match=r"here: frame 1 cannot be decoded: record it again"):
        FrameRecord(info=whole.info, data=data).image("here")


def test_damaged_dots_are_refused(bundle: Bundle) -> None:
    dots = DotsSeen(rest_px=np.ones((2, 2)), places_px=np.ones((2, 2)), reasons=np.zeros(2, np.uint8))
    whole = FrameRecord.of(replace(plain(1), dots=dots), CaptureStamp(zeroed=bundle, unix_s=1e9))
    spoilt = whole.info.model_copy(update={"dots": whole.info.dots.model_copy(update={"reasons": (0,)})})
    with pytest.raises(InputError, match="the dots of frame 1 are damaged"):
        replace(whole, info=spoilt).camera_frame("x.mcap")


def test_a_bundle_is_attached_once(record: Record, bundle: Bundle) -> None:
    with record([plain(number) for number in range(3)]).open("rb") as file:
        (attached,) = make_reader(file).iter_attachments()
    assert attached.name == f"calibration-{bundle.identity}.gelcal"


@pytest.mark.parametrize("step_s", [-3600.0, 3600.0])
def test_a_recording_is_whole_and_plays_on_where_the_time_of_day_was_set(
    tmp_path: Path, bundle: Bundle, step_s: float
) -> None:
    path = tmp_path / "set.mcap"
    with RecordingWriter(path, "GL-7") as writer:
        for sequence in range(6):
            unix_s = 1e9 + sequence / 30 + (step_s if sequence > 2 else 0.0)
            writer.add(plain(sequence), CaptureStamp(zeroed=bundle, unix_s=unix_s))
    assert [record.info.sequence for record in Recording(path).frames()] == list(range(6))
    assert [record.info.sequence for record in Recording(path).frames(0.1)] == [3, 4, 5]
    with open_camera(f"replay://{path}") as camera:
        assert [camera.read().sequence for _ in range(6)] == list(range(6))
