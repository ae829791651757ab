"""A daemon is recorded beside its work; the verbs record, replay and export a simulated sensor."""

import errno
import threading
import time
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest.mock import Mock

import pytest
from mcap.reader import make_reader

import gellight
from gellight.base.errors import InputError
from gellight.recording.kinds import DepthKind
from gellight.recording.recording_file import Recording
from gellight.stream import recorder as recorder_module
from gellight.stream.recorder import Recorder
from tests.helpers.streamed import bump_daemon
from tests.helpers.waiting import eventually


def test_frames_that_wait_for_the_disk_keep_the_zero_that_they_were_taken_under(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nor is one of them lost, though the daemon delivers none from before another bundle."""
    with gellight.connect("sim://?programme=0&fps=5", patience_s=120) as sensor:
        sensor.next_frame()
        before = sensor.bundle
        after = before.with_reference(before.reference + 1, frames=before.manifest.reference_frames)
        with Recorder(sensor.daemon, tmp_path / "a.mcap", depth=DepthKind.UINT16) as recorder:
            add, disk = recorder._writer.add, threading.Event()
            monkeypatch.setattr(recorder._writer, "add", lambda *frame, packed: (disk.wait(60), add(*frame)))
            first, _ = sensor.daemon.captured.take(0, 20)
            number = first
            while number < first + 5:
                number, frame = sensor.daemon.captured.take(number, 20)
            sensor.daemon.replace_bundle(after)
            last = frame.sequence
            while sensor.next_frame().provenance.zero != after.identity:
                pass
            disk.set()
    recorded = Recording(tmp_path / "a.mcap")
    zeros = {record.info.sequence: record.info.zero for record in recorded.frames()}
    waited = [sequence for sequence in zeros if sequence <= last]
    assert waited == list(range(min(zeros), last + 1)), "none is lost"
    assert recorder.status.lost == 0
    assert {zeros[sequence] for sequence in waited} == {before.identity}
    assert zeros[max(zeros)] == after.identity
    depths = [info for info, _ in recorded.depths() if info.sequence in zeros]
    assert [zeros[info.sequence] for info in depths] == [info.zero for info in depths] != []


def test_what_is_recorded_of_one_frame_has_one_time(recording: Path) -> None:
    times: dict[str, set[int]] = {}
    with recording.open("rb") as file:
        for _, channel, message in make_reader(file).iter_messages():
            times.setdefault(channel.topic, set()).add(message.log_time)
    assert set() != times["/sim/depth"] <= times["/sim/image_raw/compressed"]


def test_a_disk_that_is_nearly_full_is_told_before(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(recorder_module, "_free_bytes", lambda folder: 209_000_000)
    daemon, _ = bump_daemon()
    with daemon:
        with pytest.raises(InputError, match="free some space"):
            Recorder(daemon, tmp_path / "a.mcap")
        assert list(tmp_path.iterdir()) == []
        monkeypatch.setattr(recorder_module, "_free_bytes", lambda folder: 210_000_000)
        with Recorder(daemon, tmp_path / "a.mcap"):
            pass  # so much is enough


def test_a_disk_that_fills_ends_the_recording_whole(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    free = [10**9]
    monkeypatch.setattr(recorder_module, "_free_bytes", lambda folder: free[0])
    monkeypatch.setattr(recorder_module, "LOOK_S", 0.3)
    with gellight.connect("sim://?object=BALL&depth=1&fps=5", patience_s=120) as sensor:
        with Recorder(sensor.daemon, tmp_path / "a.mcap") as recorder:
            while not recorder.ended:
                time.sleep(0.05)
                if recorder.status.frames:
                    free[0] = 104_000_000
        assert recorder.status.ended == "the recording stopped: the disk is nearly full"
        sensor.next_frame()  # the sensor goes on
    recorded = Recording(tmp_path / "a.mcap")
    assert len(list(recorded.frames())) == recorder.status.frames
    assert recorded.whole


def test_a_disk_that_refuses_ends_the_recording_and_nothing_else(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with gellight.connect("sim://?object=BALL&depth=1&fps=5", patience_s=120) as sensor:
        with Recorder(sensor.daemon, tmp_path / "a.mcap") as recorder:
            eventually(lambda: recorder.status.frames, 120)
            monkeypatch.setattr(
                recorder._writer, "add", Mock(side_effect=OSError(errno.ENOSPC, "No space left on device"))
            )
            eventually(lambda: recorder.ended, 120)
            recorder._thread.join(60)
            assert sensor.daemon.captured._copies == sensor.daemon.delivered._copies == (), "no frame is kept for it"
        assert "disk is full" in recorder.status.ended
        sensor.next_frame()
    assert len(list(Recording(tmp_path / "a.mcap").frames())) == recorder.status.frames


@pytest.mark.parametrize("frames", [0, 3])
def test_a_recorder_that_is_slower_than_the_camera_ends_all_the_same(
    frames: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It wrote on for as long as frames came: 20 were asked for, and 1,200 written."""
    with gellight.connect("sim://?programme=0&fps=60&board=0", patience_s=120) as sensor:
        sensor.next_frame()
        with Recorder(sensor.daemon, tmp_path / "a.mcap", frames=frames) as recorder:
            add = recorder._writer.add
            monkeypatch.setattr(recorder._writer, "add", lambda *frame, packed: (time.sleep(0.1), add(*frame)))
            eventually(lambda: recorder.status.frames >= 3, 120)
            taken_at_the_end = sensor.daemon.captured.newest
        assert recorder.status.frames == frames or recorder.status.frames <= taken_at_the_end
        assert not recorder._thread.is_alive()
    assert len(list(Recording(tmp_path / "a.mcap").frames())) == recorder.status.frames


def test_what_a_minute_takes_is_what_a_frame_takes_at_the_rate_of_the_camera() -> None:
    stamps = iter([(3, 10.0), (4, 10.5), (13, 11.0)])  # frames are left out on the way

    def next_frame(*_: object) -> SimpleNamespace:
        sequence, time_s = next(stamps)
        return SimpleNamespace(camera_frame=SimpleNamespace(sequence=sequence, time_s=time_s))

    writer = SimpleNamespace(bytes_of=lambda frame: 1000)
    recorder: Any = SimpleNamespace(_daemon=SimpleNamespace(next_frame=next_frame), _writer=writer)
    assert Recorder.bytes_a_minute(recorder) == pytest.approx(1000 * 60 / 0.1)
