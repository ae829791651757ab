"""The mode of a running sensor is changed: frames go on, numbered on; what cannot be leaves everything as it was."""

from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from gellight.base.errors import BundleError, CameraError, InputError
from gellight.base.settings import load_settings
from gellight.daemon import switched_camera
from gellight.daemon.assembly import open_session
from gellight.daemon.bundle_choice import placeholder
from gellight.daemon.configuration import STILL, LightPlan
from gellight.daemon.session import SensorSession
from gellight.daemon.switched_camera import SensorState, SwitchedCamera
from gellight.frames.camera import Camera
from gellight.frames.camera_wrapper import CameraWrapper
from gellight.frames.frames import CameraFrame
from gellight.frames.picture import PictureSteps
from gellight.frames.view import View
from gellight.stream.publisher import Publisher
from gellight.stream.subscription import subscribe
from tests.helpers.scripted_camera import ScriptedCamera

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
