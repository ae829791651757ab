"""Recordings that are cut short, damaged, foreign or of before are read as far as they go, or refused."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer

from gellight.base.errors import InputError
from gellight.bundle.bundle import Bundle
from gellight.frames.frames import CaptureStamp
from gellight.frames.shear import DotsSeen
from gellight.opening import open_camera
from gellight.recording import recording_file
from gellight.recording.frame_record import FrameRecord
from gellight.recording.recording_file import Recording, RecordingWriter
from tests.helpers.recorded import plain

Record = Callable[..., Path]


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
