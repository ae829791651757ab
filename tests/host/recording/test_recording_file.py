"""A recording gives back what went in; what is damaged, cut off or foreign is refused or read as far as it goes."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mcap.writer import CompressionType, Writer
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import Reader
from rosbags.typesys import Stores, get_typestore

from gellight.base.errors import InputError
from gellight.bundle.bundle import Bundle
from gellight.frame_path.pipeline import Reconstructor
from gellight.frames.camera import EndOfStream
from gellight.frames.frames import CameraFrame, CaptureStamp, EncodedImage, LightLabel, LightState
from gellight.frames.measures import MapOnRequest
from gellight.opening import open_camera
from gellight.recording import recording_file
from gellight.recording.frame_record import FrameRecord
from gellight.recording.recording_file import (
    ContactInfo,
    DepthKind,
    Recording,
    RecordingWriter,
    depth_image,
    topic_name,
)
from gellight.recording.replay_camera import ReplayCamera
from tests.helpers.linear_sensor import linear_bundle
from tests.helpers.streamed import full_frame
from tests.helpers.weighed import HeavyFrames

SHAPE = (48, 64)
LIGHT = np.arange(36, dtype=np.uint8).reshape(12, 3)


def picture(seed: int) -> np.ndarray:
    return cv2.GaussianBlur(np.random.default_rng(seed).integers(0, 256, (*SHAPE, 3), np.uint8), (9, 9), 3)


def plain(sequence: int) -> CameraFrame:
    """A frame of a camera that gives no bytes of its own."""
    label = LightLabel(state=LightState.CLEAN, group=2)
    return CameraFrame(image=picture(sequence), time_s=sequence / 30, sequence=sequence, light=LIGHT, label=label)


def encoded(sequence: int, letters: str) -> CameraFrame:
    """A frame whose image was decoded from the camera's bytes; only the bytes count."""
    rgb = picture(sequence)
    line_bytes = 0
    if letters == "MJPG":
        data = cv2.imencode(".jpg", rgb)[1].tobytes()
    elif letters == "GREY":
        line_bytes = 80  # wider in memory than the picture
        data = np.pad(rgb[..., 0], ((0, 0), (0, 16))).tobytes()
    else:
        data = np.random.default_rng(sequence).integers(0, 256, (*SHAPE, 2), np.uint8).tobytes()
    encoded = EncodedImage(data=data, letters=letters, line_bytes=line_bytes)
    return CameraFrame(image=rgb, time_s=sequence / 30, sequence=sequence, encoded=encoded)


@pytest.fixture
def bundle(tmp_path: Path) -> Bundle:
    return linear_bundle(tmp_path / "bundle", shape=SHAPE)


Record = Callable[..., Path]


@pytest.fixture
def record(tmp_path: Path, bundle: Bundle) -> Record:
    """Write a recording of some frames, 30 a second."""

    def write(frames: list[CameraFrame], name: str = "a.mcap", depth: DepthKind = DepthKind.NONE) -> Path:
        with RecordingWriter(tmp_path / name, "left finger", depth=depth) as writer:
            for frame in frames:
                unix_s = 1e9 + frame.time_s
                writer.add(frame, CaptureStamp(zeroed=bundle, unix_s=unix_s))
                felt = full_frame()
                writer.add_felt(replace(felt, camera_frame=frame, provenance=replace(felt.provenance, unix_s=unix_s)))
        return tmp_path / name

    return write


def read_all(url: str) -> list[CameraFrame]:
    frames = []
    with open_camera(url) as camera:
        try:
            while True:
                frames.append(camera.read())
        except EndOfStream:
            return frames


def test_frames_come_back_with_time_light_and_label(record: Record) -> None:
    sent = [plain(number) for number in (3, 4, 7)]
    got = read_all(f"replay://{record(sent)}?speed=0")
    assert [frame.sequence for frame in got] == [3, 4, 7]
    for one, other in zip(got, sent, strict=True):
        assert np.array_equal(one.image, other.image)
        assert np.array_equal(one.light, LIGHT)
        assert one.label == other.label


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


def test_depth_computed_again_equals_the_live_one_bit_for_bit(record: Record, bundle: Bundle) -> None:
    """The picture, the reference image and the network are those of the time of recording."""
    live = Reconstructor(bundle)
    frames = [plain(number) for number in range(3)]
    felt = [live.reconstruct(frame) for frame in frames]
    recording = Recording(record(frames))
    again = Reconstructor(recording.bundle)
    for frame, before in zip(read_all(f"replay://{recording.path}?speed=0"), felt, strict=True):
        now = again.reconstruct(frame)
        assert now.depth_mm.tobytes() == before.depth_mm.tobytes()
        assert now.gradient_map.tobytes() == before.gradient_map.tobytes()


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


def test_the_contact_of_an_older_recording_is_read() -> None:
    old = ContactInfo(sequence=1, calibration="c", zero="z", indentation_mm=1.0, area_mm2=2.0, centroid_mm=(0.0, 1.0))
    assert ContactInfo.model_validate_json(old.model_dump_json(exclude={"contacts"})) == old


def test_maps_come_back_and_open_in_ros(tmp_path: Path, bundle: Bundle) -> None:
    path, felt, frame = tmp_path / "maps.mcap", replace(full_frame(), measures=HeavyFrames()), plain(1)
    with RecordingWriter(path, "finger", maps=list(MapOnRequest)) as writer:
        writer.add(frame, CaptureStamp(zeroed=bundle, unix_s=1e9))
        writer.add_felt(felt)
    for name, values in felt.maps_on_request().items():
        ((info, image),) = Recording(path).maps(name)
        assert (info.force_n, info.force_error_n) == (1.25, 0.1)
        assert np.array_equal(np.frombuffer(image.data, values.dtype).reshape(SHAPE), values)
    jazzy = get_typestore(Stores.ROS2_JAZZY)
    with AnyReader([path], default_typestore=jazzy) as reader:
        seen = {
            connection.topic: reader.deserialize(content, connection.msgtype)
            for connection, _, content in reader.messages()
        }
    assert {topic: seen[f"/finger/{topic}"].encoding for topic in ("pressure_mpa", "confidence", "quality_flags")} == {
        "pressure_mpa": "32FC1", "confidence": "32FC1", "quality_flags": "mono8",
    }  # fmt: skip


def test_depth_that_uint16_cannot_hold_is_clipped() -> None:
    depth = np.array([[-0.5, 7.0, 0.00005]], np.float32)
    assert np.frombuffer(depth_image(depth, DepthKind.UINT16).data, "<u2").tolist() == [0, 65535, 0]


# ---- its pace ----


def test_it_is_played_at_its_own_pace_or_another(record: Record) -> None:
    path = record([plain(number) for number in range(4)])

    def seconds(query: str) -> float:
        frames = read_all(f"replay://{path}?{query}")
        return frames[-1].time_s - frames[0].time_s

    assert seconds("speed=1") == pytest.approx(0.1, abs=1e-6)
    assert seconds("speed=0.5") == pytest.approx(0.2, abs=1e-6)


def test_it_begins_where_it_is_asked_to_and_begins_again(record: Record) -> None:
    path = record([plain(number) for number in range(4)])
    assert [frame.sequence for frame in read_all(f"replay://{path}?speed=0&start=0.05")] == [2, 3]
    with open_camera(f"replay://{path}?speed=0&loop=1") as camera:
        assert [camera.read().sequence for _ in range(9)] == [0, 1, 2, 3, 4, 5, 6, 7, 8]


@pytest.mark.parametrize("query", ["speed=-1", "speed=nan", "start=-3", "sped=1", "loop=maybe"])
def test_a_wrong_parameter_is_refused(record: Record, query: str) -> None:
    with pytest.raises(InputError, match=query.partition("=")[0]):
        open_camera(f"replay://{record([plain(0)])}?{query}")


# ---- other programs ----


def test_it_opens_as_a_bag_of_ros_2(record: Record) -> None:
    path = record([plain(1), encoded(2, "MJPG"), encoded(3, "YUYV")], depth=DepthKind.FLOAT32)
    store, seen = get_typestore(Stores.ROS2_HUMBLE), {}
    from rosbags.highlevel import AnyReader

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
    assert seen["/left_finger/image_raw"][0][1].encoding == "yuv422_yuy2"
    depth = seen["/left_finger/depth"][0][1]
    assert depth.encoding == "32FC1"
    assert np.abs(depth.data.view("<f4") * 1e3 - full_frame().depth_mm.ravel()).max() < 1e-6, "metres"
    assert json.loads(seen["/left_finger/frame"][0][1].data)["sequence"] == 1
    assert Reader is not None


@pytest.mark.parametrize(
    ("name", "topic"), [("left finger", "left_finger"), ("12AB", "gellight_12AB"), ("é", "gellight__")]
)
def test_a_topic_is_one_that_ros_allows(name: str, topic: str) -> None:
    assert topic_name(name) == topic


# ---- what is not right ----


def test_a_recording_that_was_cut_short_gives_its_whole_chunks(record: Record, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(recording_file, "CHUNK_BYTES", 1 << 20)
    path = record([plain(number) for number in range(2000)])
    content = path.read_bytes()
    assert len(content) > 8e6
    path.write_bytes(content[: len(content) // 2])
    recording = Recording(path)
    numbers = [one.info.sequence for one in recording.frames()]
    assert not recording.whole
    assert numbers == list(range(len(numbers)))
    assert 600 < len(numbers) < 1000


def test_a_whole_recording_says_so(record: Record) -> None:
    recording = Recording(record([plain(0)]))
    list(recording.frames())
    assert recording.whole


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


@pytest.mark.parametrize(
    ("content", "says"),
    [(b"", "no frames"), (b"GELF" * 100, "no MCAP file"), (b"\x89MCAP0\r\n", "no frames"), (b"\x89MCA", "no frames")],
)
def test_what_is_no_recording_is_refused(tmp_path: Path, content: bytes, says: str) -> None:
    (tmp_path / "a.mcap").write_bytes(content)
    with pytest.raises(InputError, match=says):
        Recording(tmp_path / "a.mcap")


def test_a_file_that_is_not_there_is_told(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"b\.mcap cannot be read \(No such file"):
        open_camera(f"replay://{tmp_path}/b.mcap")


def test_a_recording_of_another_program_is_refused(tmp_path: Path) -> None:
    with (tmp_path / "a.mcap").open("wb") as file:
        writer = Writer(file)
        writer.start(profile="ros2", library="libmcap 1.4")
        writer.finish()
    with pytest.raises(InputError, match=r"written by libmcap 1\.4"):
        Recording(tmp_path / "a.mcap")


def test_a_recording_packed_otherwise_is_refused_with_the_remedy(tmp_path: Path) -> None:
    with (tmp_path / "a.mcap").open("wb") as file:
        writer = Writer(file, compression=CompressionType.LZ4)
        writer.start(library="gellight")
        schema = writer.register_schema("x", "", b"")
        writer.add_message(writer.register_channel("/x", "cdr", schema), 0, bytes(10**6), 0)
        writer.finish()
    with pytest.raises(InputError, match=r"is packed by lz4.*compress --compression zstd"):
        Recording(tmp_path / "a.mcap")


def test_a_chunk_that_unpacks_to_more_than_any_has_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """How much it unpacks to is said by the file itself, and may be anything."""
    monkeypatch.setattr(recording_file, "MOST_RECORD_BYTES", 10**6)
    with (tmp_path / "a.mcap").open("wb") as file:
        writer = Writer(file, compression=CompressionType.ZSTD)
        writer.start(library="gellight")
        schema = writer.register_schema("x", "", b"")
        writer.add_message(writer.register_channel("/x", "cdr", schema), 0, bytes(10**6), 0)
        writer.finish()
    assert (tmp_path / "a.mcap").stat().st_size < 1000
    with pytest.raises(InputError, match=r"damaged .a chunk says a size"):
        Recording(tmp_path / "a.mcap")


def test_a_recording_of_before_which_is_not_packed_is_read(
    tmp_path: Path, bundle: Bundle, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(recording_file, "CompressionType", SimpleNamespace(ZSTD=CompressionType.NONE))
    with RecordingWriter(tmp_path / "a.mcap", "finger") as writer:
        writer.add(plain(1), CaptureStamp(zeroed=bundle, unix_s=1e9), packed=False)
    assert plain(1).image.tobytes() in (tmp_path / "a.mcap").read_bytes()
    assert np.array_equal(Recording(tmp_path / "a.mcap").first.image("a"), plain(1).image)


def test_a_frame_that_came_too_late_to_be_packed_is_the_same(tmp_path: Path, bundle: Bundle) -> None:
    with RecordingWriter(tmp_path / "a.mcap", "finger") as writer:
        for packed in (False, True):
            writer.add(plain(1), CaptureStamp(zeroed=bundle, unix_s=1e9), packed=packed)
    raw, packed = Recording(tmp_path / "a.mcap").frames()
    assert (raw.info.letters, packed.info.letters) == ("RGB3", "PNG")
    assert np.array_equal(raw.image("a"), packed.image("a"))


@pytest.mark.parametrize("damage", [b"", b"PNG", b"huge"])
def test_a_picture_that_is_damaged_is_refused(damage: bytes, bundle: Bundle) -> None:
    whole = FrameRecord.of(plain(1), CaptureStamp(zeroed=bundle, unix_s=1e9))
    data = {b"huge": whole.data[:16] + b"\x7f\xff\xff\xff" * 2 + whole.data[24:]}.get(damage, damage)
    with pytest.raises(InputError, match=r"here: frame 1 cannot be decoded: record it again"):
        FrameRecord(info=whole.info, data=data).image("here")


def test_an_existing_file_is_not_replaced(record: Record) -> None:
    path = record([plain(0)])
    with pytest.raises(InputError, match="exists"):
        RecordingWriter(path, "finger")


@given(data=st.data())
@settings(max_examples=120, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_hostile_bytes_in_a_file_neither_crash_nor_take_memory(
    record: Record, tmp_path: Path, data: st.DataObject
) -> None:
    """Whatever bytes are changed: frames come, or a refusal."""
    path = tmp_path / "a.mcap"
    content = bytearray(
        path.read_bytes() if path.exists() else record([plain(number) for number in range(2)]).read_bytes()
    )
    end = content.index(b"image_raw") + 400
    for place in data.draw(st.lists(st.integers(0, end), min_size=1, max_size=6)):
        content[place] = data.draw(st.integers(0, 255))
    (tmp_path / "b.mcap").write_bytes(content)
    try:
        list(Recording(tmp_path / "b.mcap").frames())
        list(Recording(tmp_path / "b.mcap").depths())
    except InputError:
        pass


def test_a_recording_brings_its_bundle(record: Record, bundle: Bundle) -> None:
    with open_camera(f"replay://{record([plain(0)])}") as camera:
        assert isinstance(camera, ReplayCamera)
        assert camera.bundle.identity == bundle.identity


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
