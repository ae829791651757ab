"""What was felt live a replay and an export feel too, of every kind of bundle and light; else nothing is recorded."""

import time
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest

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
from gellight.recording.recording_file import Recording
from gellight.recording.replay_camera import open_replay
from gellight.stream.recorder import Recorder
from tests.helpers.small_bundles import with_lens

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


def fields(frame: TactileFrame) -> object:
    """Places of dots are recorded to a thousandth of a pixel."""
    return frame.shear and pytest.approx(frame.shear.field_mm, abs=2e-4, nan_ok=True)


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
            if live[number].shear:
                assert again.shear.field_mm == fields(live[number])


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
