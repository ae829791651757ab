"""The mode of a running sensor is changed: frames go on, numbered on; what cannot be leaves everything as it was."""

import threading
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest

import gellight
from gellight.base.errors import BundleError, CameraError, GellightError, InputError
from gellight.base.settings import ReconstructionSettings, Settings, load_settings
from gellight.bundle.bundle import Bundle, load_bundle
from gellight.daemon import active_pipeline, assembly, switched_camera
from gellight.daemon.active_pipeline import path_for
from gellight.daemon.assembly import open_session
from gellight.daemon.bundle_choice import placeholder
from gellight.daemon.configuration import STILL, LightPlan, PathKind, mode_config
from gellight.daemon.switched_camera import SensorState, SwitchedCamera
from gellight.frames.camera import Camera
from gellight.frames.camera_wrapper import CameraWrapper
from gellight.frames.frames import CameraFrame
from gellight.frames.picture import PictureSteps
from gellight.frames.view import View
from gellight.photometric.light_model import LightGroups
from gellight.sensor.series_camera import SeriesCamera
from gellight.stream.publisher import Publisher
from gellight.stream.subscription import subscribe
from sim_reference.geometry import AS_BUILT
from tests.benchmarks.photometric import Bench
from tests.helpers.linear_sensor import verified_bundle, with_lights_of_its_own
from tests.helpers.scripted_camera import ScriptedCamera
from tests.helpers.simulated_bundle import ball_presses

HELD = "sim://?object=BALL&depth=1.0&x=3&y=-2"


def test_another_program_changes_the_mode_and_the_frames_go_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    with (
        open_session(load_settings({"sensor.url": HELD})) as running,
        Publisher(running, name="changed") as publisher,
        subscribe(publisher.name, patience_s=60) as frames,
    ):
        before = frames.next_frame()
        assert before.exposures is None
        assert running.status()["watch"] is not None
        frames.mode("photometric")
        assert frames.status()["mode"] == "photometric"
        assert frames.status()["watch"] is None
        with pytest.raises(InputError, match="mode photometric, which changes the light"):
            frames.light(None)
        measured = frames.next_frame()
        while measured.exposures is None:  # sent before the mode was changed
            measured = frames.next_frame()
        assert measured.camera_frame.sequence > before.camera_frame.sequence
        assert measured.contact.indentation_mm == pytest.approx(1.0, abs=0.02)
        with pytest.raises(InputError, match="no mode 'magic': choose one of network, photometric"):
            frames.mode("magic")
        frames.mode("network")
        after = frames.next_frame()
        while after.exposures is not None:
            after = frames.next_frame()
        assert after.camera_frame.sequence > measured.camera_frame.sequence
        assert after.contact.indentation_mm == pytest.approx(1.0, abs=0.05), "under the light of the bundle again"
        assert frames.status()["error"] is None
        assert frames.status()["watch"] is not None


class Renumbering(CameraWrapper):
    """Numbers from 1, as series do."""

    def __init__(self, camera: Camera) -> None:
        super().__init__(camera)
        self.count, self.released = 0, False

    def read(self) -> CameraFrame:
        self.count += 1
        image = np.zeros((4, 4, 3), np.uint8)
        return CameraFrame(image=image, time_s=0.0, sequence=self.count)

    def release(self) -> None:
        self.released = True


IN_TURN, REFUSED, FAULTY = LightPlan(), LightPlan(), LightPlan()


def test_the_numbers_go_on_and_what_was_in_front_is_released(monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[Renumbering] = []

    def equip(camera: Camera, light: LightPlan) -> Camera:
        if light is STILL:
            return camera
        if light is REFUSED:
            raise CameraError("no ring")
        if light is FAULTY:
            raise ValueError("a fault of our own")
        made.append(Renumbering(camera))
        return made[-1]

    inner = ScriptedCamera()
    camera, dark = SwitchedCamera(inner), SensorState(controls={}, colours=None)
    monkeypatch.setattr(switched_camera, "camera_for", equip)
    numbers = [camera.read().sequence for _ in range(3)]
    camera.switch(inner, IN_TURN, dark)
    numbers += [camera.read().sequence for _ in range(2)]
    camera.switch(inner, STILL, dark)
    numbers += [camera.read().sequence for _ in range(2)]
    assert numbers == [1, 2, 3, 4, 5, 6, 7]
    assert made[0].released
    assert len(inner.adopted) == 2

    camera.switch(inner, IN_TURN, dark)
    for number, (light, error) in enumerate(((REFUSED, CameraError), (FAULTY, ValueError)), 8):
        with pytest.raises(error):
            camera.switch(inner, light, dark)
        assert camera.read().sequence == number
        assert camera._camera is made[-1], "the light of before stands in front again"


@pytest.mark.parametrize(("waits", "read", "refused"), [(True, True, True), (True, False, False), (False, True, False)])
def test_pictures_of_files_that_are_on_their_way_are_not_prepared_otherwise(
    waits: bool, read: bool, refused: bool
) -> None:
    inner: Any = ScriptedCamera(shape=(24, 32))
    inner.waits = waits
    camera = SwitchedCamera(inner)
    if read:
        camera.read()
    steps = PictureSteps.with_view(View.of_box((0, 0, 16, 12), (24, 32)))
    config: Any = SimpleNamespace(pictures=steps, bundle=placeholder((12, 16)))
    if refused:
        with pytest.raises(BundleError):
            camera.prepared(config)
        return
    assert camera.prepared(config).image_shape == (12, 16)


@pytest.mark.nightly
def test_a_second_look_under_other_lights_errs_by_little_more_than_half_as_much() -> None:
    """Over four balls; over twenty it is 0.46."""
    bench, presses = Bench(load_bundle("synthetic")), list(ball_presses(AS_BUILT, 4, np.random.default_rng(8)))
    ways = bench.ways()
    assert [way.kind for way in ways] == [None, *LightGroups, *LightGroups]
    assert ways[3].exposure_us == pytest.approx(24400, rel=0.02)
    network, of_four, of_twelve = (
        np.mean([bench.errors(press, way).contact_normal_deg for press in presses]) for way in (ways[0], *ways[3:])
    )
    assert max(of_four, of_twelve) < 0.6 * network


@pytest.mark.parametrize("wanted", [True, False])
def test_the_settings_say_whether_cast_shadows_are_made_good(wanted: bool) -> None:
    settings = Settings(reconstruction=ReconstructionSettings(cast_shadows=wanted))
    bundle = load_bundle("synthetic")
    path = path_for(mode_config(bundle, settings), bundle)
    assert path._network.cast_shadows is wanted


# ---- camera, frame path and watch always belong together ----


SHAPE = (24, 32)
SMALL = {"image_width_px": SHAPE[1], "image_height_px": SHAPE[0], "pixel_size_mm": 1.176}


@pytest.fixture
def ordinary(tmp_path: Path) -> Bundle:
    return verified_bundle(tmp_path / "ordinary", sensor="simulated", rgb=(200, 200, 200))


def test_two_who_change_what_runs_at_once_take_turns(ordinary: Bundle, monkeypatch: pytest.MonkeyPatch) -> None:
    building, go_on = threading.Event(), threading.Event()
    build = active_pipeline.path_for

    def slowly(*parts: Any) -> Any:
        path = build(*parts)
        building.set()
        assert go_on.wait(60)
        return path

    series = with_lights_of_its_own(ordinary)
    monkeypatch.setattr("gellight.daemon.bundle_choice.load_bundle", lambda name: ordinary)
    settings = {"sensor": {"url": "sim://?fps=200", "calibration": "it"}, "geometry": SMALL}
    with assembly.open_session(Settings.model_validate(settings)) as session:
        session.wait_frame(-1, 60)
        monkeypatch.setattr(active_pipeline, "path_for", slowly)
        first = threading.Thread(target=session.replace_bundle, args=(ordinary,))
        second = threading.Thread(target=session.replace_bundle, args=(series,))
        first.start()
        assert building.wait(60)
        second.start()
        second.join(0.3)
        assert second.is_alive(), "it waits for the first"
        go_on.set()
        first.join(60)
        second.join(60)
        assert session.bundle.source == "single lights"
        assert session._active.config.path == PathKind.OWN_LIGHTS
        assert isinstance(session._camera._camera, SeriesCamera)
        before = session.wait_frame(-1, 60).camera_frame.sequence
        assert session.wait_frame(before + 1, 60).camera_frame.sequence > before
        assert session.status()["error"] is None


def test_the_mode_of_files_that_wait_for_their_reader_is_changed_and_no_picture_is_missed(
    ordinary: Bundle, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pictures = tmp_path / "pictures"
    pictures.mkdir()
    for k in range(6):
        image = np.clip(np.rint(ordinary.reference), 0, 255).astype(np.uint8)
        assert cv2.imwrite(str(pictures / f"{k}.png"), image[..., ::-1])
    with gellight.connect(str(pictures), calibration=ordinary.source, every=True, patience_s=60) as sensor:
        seen = [sensor.next_frame().camera_frame.sequence]
        problems: list[GellightError] = []

        def change() -> None:
            try:
                sensor.mode("network")
            except GellightError as error:
                problems.append(error)

        changing = threading.Thread(target=change, daemon=True)
        changing.start()
        changing.join(60)
        assert not changing.is_alive(), "it waits for a reader who waits for it"
        assert problems == []
        seen += [frame.camera_frame.sequence for frame in sensor]
    assert len(seen) == 6
    assert seen == sorted(set(seen))


def test_a_picture_that_was_given_is_not_given_again_where_it_is_reconstructed_anew(
    ordinary: Bundle, tmp_path: Path
) -> None:
    """A reader may have taken it in the very moment in which the mode is changed."""
    image = np.clip(np.rint(ordinary.reference), 0, 255).astype(np.uint8)
    for k in range(3):
        assert cv2.imwrite(str(tmp_path / f"{k}.png"), image[..., ::-1])
    with gellight.connect(str(tmp_path), calibration=ordinary.source, every=True, patience_s=60) as sensor:
        first = sensor.next_frame()
        sensor.daemon.delivered.put(first)
        seen = [frame.camera_frame.sequence for frame in sensor]
    assert first.camera_frame.sequence not in seen
    assert len(seen) == 2
