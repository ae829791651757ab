"""A daemon is recorded beside its work; and what was felt live a replay and an export feel too."""

import errno
import threading
import time
from collections.abc import Mapping
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest.mock import Mock

import numpy as np
import pytest
from mcap.reader import make_reader

import gellight
from gellight.base.errors import InputError
from gellight.base.settings import load_settings
from gellight.bundle.bundle import Bundle
from gellight.cli.running.export import tactile_frames
from gellight.daemon.assembly import open_session
from gellight.daemon.session import SensorSession
from gellight.frames.frames import TactileFrame
from gellight.frames.image_files import ImageCamera
from gellight.frames.picture import PictureSteps
from gellight.frames.view import View
from gellight.lab.report.pictures import encode_png
from gellight.opening import open_camera
from gellight.recording.kinds import DepthKind
from gellight.recording.recording_file import Recording
from gellight.recording.replay_camera import open_replay
from gellight.stream import recorder as recorder_module
from gellight.stream.recorder import Recorder
from tests.helpers.small_bundles import with_lens
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


# ---- live, replayed, exported: of every kind of bundle and light ----


VIEW = View.of_box((80, 60, 640, 480), (600, 800))
FRAMES = 5


def _of_a_view(folder: Path, synthetic: Bundle) -> SensorSession:
    """Pictures of a ball, of a camera that shows more than the gel."""
    with gellight.connect("sim://?programme=0&object=BALL&depth=1") as sensor:
        image = sensor.next_frame(30).camera_frame.image
    around = np.pad(image, ((60, 60), (80, 80), (0, 0)))
    for number in range(3 * FRAMES):
        (folder / f"{number}.png").write_bytes(encode_png(around))
    bundle = synthetic.with_files(PictureSteps.with_view(VIEW).files())
    return SensorSession(ImageCamera(sorted(folder.glob("*.png"))), bundle, load_settings({}), every=True)


def _session(kind: str, folder: Path, synthetic: Bundle) -> SensorSession:
    if kind == "view":
        return _of_a_view(folder, synthetic)
    url = "sim://?programme=0&object=BALL&depth=1" + ("&dots=9x7" if kind == "dots" else "")
    if kind == "lens":
        return SensorSession(open_camera(url), with_lens(synthetic), load_settings({}), every=True)
    sequence, _, light_mode = kind.partition(" ")
    settings: Mapping[str, object] = (
        {"lighting.sequence": sequence, "lighting.light_mode": light_mode} if light_mode else {}
    )
    return open_session(load_settings({"sensor.url": url, **settings}), every=True)


def figures(frame: TactileFrame) -> tuple[object, ...]:
    light = frame.camera_frame.light
    return (
        frame.depth_mm.tobytes(), frame.gradient_map.tobytes(),
        frame.contact.indentation_mm if frame.contact.area_mm2 > 0 else None,
        frame.shear and frame.shear.unknown, frame.force and frame.force.normal_n,
        None if light is None else light.tobytes(), frame.camera_frame.label,
    )  # fmt: skip


@pytest.mark.parametrize("kind", ["plain", "view", "dots", "lens", "rgb hold", "rgb free", "single hold"])
def test_live_is_replay_is_export(kind: str, tmp_path: Path, synthetic: Bundle) -> None:
    path, sequence, live = tmp_path / "one.mcap", -1, dict[int, TactileFrame]()
    daemon = _session(kind, tmp_path, synthetic)
    with Recorder(daemon, path) as recorder, daemon:
        while recorder.status.frames < FRAMES:
            frame = daemon.next_frame(sequence, 30)
            sequence = frame.camera_frame.sequence
            live[sequence] = frame
    exported = {one.camera_frame.sequence: one for one in tactile_frames(Recording(path), None)}
    with gellight.connect(f"replay://{path}?speed=0", every=True) as replay:
        replayed = {one.camera_frame.sequence: one for one in replay}
    assert list(exported) == list(replayed)
    both = set(live) & set(exported)
    assert both
    for number in both:
        for again in (replayed[number], exported[number]):
            assert figures(again) == figures(live[number])
            if live[number].shear:  # places of dots are recorded to a thousandth of a pixel
                assert again.shear.field_mm == pytest.approx(live[number].shear.field_mm, abs=2e-4, nan_ok=True)


@pytest.mark.parametrize("light_mode", ["hold", "free"])
@pytest.mark.parametrize("groups", ["triples", pytest.param("singles", marks=pytest.mark.nightly)])
def test_series_of_exposures_are_refused_before_the_first_frame(light_mode: str, groups: str, tmp_path: Path) -> None:
    """However the light goes on, and of however many exposures."""
    mode = {"reconstruction.mode": "photometric", "reconstruction.light_groups": groups}
    settings = load_settings({"sensor.url": "sim://?programme=0", **mode, "lighting.light_mode": light_mode})
    with open_session(settings) as daemon, pytest.raises(InputError, match="a recording does not hold: record in mode"):
        Recorder(daemon, tmp_path / "series.mcap")
    assert not list(tmp_path.iterdir())


def test_a_replay_beyond_its_end_is_refused_and_one_that_waits_hours_ends_at_once(recording: Path) -> None:
    with pytest.raises(InputError, match=r"ends before 1000 s: begin earlier"):
        open_replay(f"replay://{recording}?start=1000")
    with gellight.connect(f"replay://{recording}?speed=0.00001") as replay:
        replay.next_frame(60)
        begun_s = time.monotonic()
    assert time.monotonic() - begun_s < 200, "a frame would come each fourteen hours"
