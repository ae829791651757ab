"""The mode of a running sensor is changed: frames go on, numbered on; what cannot be leaves everything as it was."""

import json
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from gellight.base.errors import BundleError, CameraError, ConfigError, InputError
from gellight.base.settings import ReconstructionSettings, Settings, load_settings
from gellight.bundle.bundle import load_bundle
from gellight.daemon import switched_camera
from gellight.daemon.active_pipeline import path_for
from gellight.daemon.assembly import open_session
from gellight.daemon.bundle_choice import placeholder
from gellight.daemon.configuration import STILL, LightPlan, mode_config
from gellight.daemon.session import SensorSession
from gellight.daemon.switched_camera import SensorState, SwitchedCamera
from gellight.frames.camera import Camera
from gellight.frames.camera_wrapper import CameraWrapper
from gellight.frames.frames import CameraFrame
from gellight.frames.picture import PictureSteps
from gellight.frames.view import View
from gellight.stream.publisher import Publisher
from gellight.stream.subscription import subscribe
from sim_reference.geometry import AS_BUILT
from tests.benchmarks.photometric import Bench
from tests.helpers.children import gellight
from tests.helpers.scripted_camera import ScriptedCamera
from tests.helpers.simulated_bundle import ball_presses

HELD = "sim://?object=BALL&depth=1.0&x=3&y=-2"


@pytest.fixture
def running(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> Iterator[SensorSession]:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path_factory.mktemp("runtime")))
    with open_session(load_settings({"sensor.url": HELD})) as daemon:
        yield daemon


def test_another_program_changes_the_mode_and_the_frames_go_on(running: SensorSession) -> None:
    with Publisher(running, name="changed") as publisher, subscribe(publisher.name, patience_s=60) as frames:
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


def test_the_photometric_demo_works_at_once_and_feels_the_ball() -> None:
    run = gellight("demo", "--set", "reconstruction.mode=photometric", "--frames", "2", "--json", "--sensor", HELD)
    assert run.returncode == 0, run.stderr
    status = json.loads(run.stdout.splitlines()[-1])
    assert status["mode"] == "photometric"
    assert status["exposures"]["exposures"] == 4
    assert status["exposures"]["moved"] is False
    assert status["lost"] == 0
    assert status["selfcheck"]["passed"], status["selfcheck"]
    assert status["selfcheck"]["contact_normal_error_deg"] < 0.3
    assert status["selfcheck"]["depth_error_mm"] < 0.005
    assert status["indentation_mm"] == pytest.approx(1.0, abs=0.02)


def test_a_camera_without_a_ring_says_how_to_go_on() -> None:
    settings = load_settings({"sensor.url": "sim://?board=0", "reconstruction.mode": "photometric"})
    with pytest.raises(CameraError, match="no light ring"):
        open_session(settings)


def test_an_unknown_mode_lists_the_modes() -> None:
    with pytest.raises(ConfigError, match="network, photometric"):
        load_settings({"reconstruction.mode": "magic"})


@pytest.mark.nightly
def test_a_second_look_under_other_lights_errs_by_little_more_than_half_as_much() -> None:
    """Over four balls; over twenty it is 0.54."""
    bench = Bench(load_bundle("synthetic"), 1.0, 31)
    rows = bench.measure("balls", list(ball_presses(AS_BUILT, 4, np.random.default_rng(8))))
    assert [row.exposures for row in rows] == [1, 4, 12, 4, 12]
    assert rows[0].over_network == 1.0
    assert rows[3].over_network < 0.6
    assert rows[4].over_network < 0.6
    assert rows[3].exposure_us == pytest.approx(24400, rel=0.02)


@pytest.mark.parametrize("wanted", [True, False])
def test_the_settings_say_whether_cast_shadows_are_made_good(wanted: bool) -> None:
    settings = Settings(reconstruction=ReconstructionSettings(cast_shadows=wanted))
    bundle = load_bundle("synthetic")
    path = path_for(mode_config(bundle, settings), bundle)
    assert path._network.cast_shadows is wanted
