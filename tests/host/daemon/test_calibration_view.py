"""A view of the gel and marker dots that are chosen before a calibration, on a sensor that runs."""

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from gellight.base.errors import BundleError, InputError
from gellight.bundle.bundle import Bundle, extend_bundle
from gellight.daemon.bundle_choice import placeholder
from gellight.daemon.calibration_service import CalibrationRequest as Request
from gellight.daemon.calibration_service import CalibrationService as Service
from gellight.daemon.calibration_service import ViewFile
from gellight.daemon.session import SensorSession
from gellight.frame_path.sequence_path import PicturePath
from gellight.frames.camera import Camera
from gellight.frames.picture import PictureSteps
from gellight.frames.view import View
from tests.helpers.begun_calibration import begun_in, identity
from tests.helpers.dotted import sloping_gel, with_dots
from tests.helpers.linear_sensor import verified_bundle
from tests.helpers.scripted_camera import ScriptedCamera
from tests.helpers.scripted_routine import ScriptedRoutine, served
from tests.helpers.sessions import session_of
from tests.helpers.waiting import eventually

SHAPE = (120, 160)
VIEW = View.of_box((16, 16, 128, 96), SHAPE)
CHOSEN = ViewFile(name="view.json", content=VIEW.model_dump_json())


class SeeingRoutine(ScriptedRoutine):
    """A routine that looks once at the camera it was given."""

    def __init__(self, camera: Camera, request: Request, install: Callable[[Bundle], object]) -> None:
        super().__init__(request, install)
        self.camera, self.seen = camera, camera.read().image


@pytest.fixture(params=[True])
def daemon(request: pytest.FixtureRequest) -> Iterator[SensorSession]:
    """Sees an untouched gel, brighter on the right, with marker dots or without."""
    gel = sloping_gel(SHAPE)
    camera = ScriptedCamera(with_dots(gel) if request.param else gel, period_s=0.005)
    with session_of(camera, PicturePath(placeholder(SHAPE))) as daemon:
        yield daemon


@pytest.fixture
def routines() -> list[SeeingRoutine]:
    return []


@pytest.fixture
def service(daemon: SensorSession, tmp_path: Path, routines: list[SeeingRoutine]) -> Iterator[Service]:
    with served(daemon, tmp_path, routines, lambda *given: SeeingRoutine(daemon.camera, *given)) as service:
        yield service


def comes(daemon: SensorSession, shape: tuple[int, int]) -> None:
    """Wait until the frames have a shape (H, W)."""
    eventually(lambda: daemon.wait_frame(-1, 60).depth_mm.shape == shape)


def test_the_calibration_and_the_page_see_the_view_without_its_dots(
    service: Service, daemon: SensorSession, routines: list[SeeingRoutine]
) -> None:
    assert service.state().picture == ""
    service.begin(Request(view=CHOSEN, dots=True))
    seen = routines[0].seen
    plain = sloping_gel(SHAPE)[16:112, 16:144]
    assert seen.shape == (96, 128, 3)
    assert np.abs(seen.astype(int) - plain).max() < 8, "the dots are filled"
    assert "picture.json" in routines[0].camera.bundle_files
    comes(daemon, (96, 128))
    assert service.state().picture.startswith("a view of 128 x 96 px is taken and ")
    routines[0].over.set()
    comes(daemon, SHAPE)  # no bundle came of it: the pictures are as before
    assert service.state().picture == ""


def test_a_bundle_that_passed_keeps_its_view_in_service(
    service: Service, daemon: SensorSession, routines: list[SeeingRoutine], tmp_path: Path
) -> None:
    service.begin(Request(view=CHOSEN))
    made = verified_bundle(tmp_path / "made", sensor=service.sensor, shape=VIEW.image_shape)
    routines[0].install(extend_bundle(made, tmp_path / "seen", PictureSteps.with_view(VIEW).files()))
    routines[0].over.set()
    comes(daemon, VIEW.image_shape)
    assert daemon.bundle.calibrated
    assert np.isfinite(daemon.wait_frame(-1, 60).depth_mm).all()
    assert service.state().picture == "a view of 128 x 96 px is taken"
    again = View.of_box((0, 0, 64, 64), VIEW.image_shape)
    with pytest.raises(InputError, match="takes a view or fills marker dots already"):
        service.begin(Request(dots=True, view=ViewFile(name="v", content=again.model_dump_json())))


@pytest.mark.parametrize("daemon", [False], indirect=True)
@pytest.mark.parametrize(("wrong", "error", "says"), [
    (Request(view=ViewFile(name="photo.json", content="{}")), InputError, r"photo\.json is no view \(taken_"),
    (Request(view=ViewFile(name="x.png", content="\x89PNG")), InputError, r"x\.png is no view \(it is no JSON"),
    (Request(view=ViewFile(name="view.json", content=View.of_box((0, 0, 80, 60), (240, 320)).model_dump_json())),
     BundleError, "delivers 160x120 pixels, the calibration takes its view from 320x240"),
    (Request(dots=True), InputError, "no marker dots are seen"),
])  # fmt: skip
def test_a_wrong_choice_is_told_and_changes_nothing(
    service: Service,
    daemon: SensorSession,
    routines: list[SeeingRoutine],
    wrong: Request,
    error: type[Exception],
    says: str,
) -> None:
    with pytest.raises(error, match=says):
        service.begin(wrong)
    assert routines == []
    assert not service.calibrating
    assert daemon.wait_frame(-1, 60).depth_mm.shape == SHAPE
    service.begin(Request())
    assert routines[0].seen.shape == (*SHAPE, 3)


def test_an_interrupted_calibration_goes_on_with_its_own_view(
    service: Service, routines: list[SeeingRoutine], tmp_path: Path
) -> None:
    begun = identity().model_copy(update={"picture": PictureSteps.with_view(VIEW)})
    begun_in(tmp_path / "state", begun)
    assert service.state().interrupted_picture == "a view of 128 x 96 px is taken"
    assert service.state().picture == "", "the sensor itself runs without"
    with pytest.raises(InputError, match="has its own view and dots"):
        service.begin(Request(dots=True))
    service.begin(Request())
    assert routines[0].seen.shape == (96, 128, 3)


def test_a_wrong_view_does_not_cost_the_interrupted_calibration(
    service: Service, routines: list[SeeingRoutine], tmp_path: Path
) -> None:
    begun_in(tmp_path / "state", identity())
    with pytest.raises(InputError, match="is no view"):
        service.begin(Request(anew=True, view=ViewFile(name="photo.json", content="{}")))
    assert service.state().interrupted
    service.begin(Request(anew=True, view=CHOSEN))
    assert not service.state().interrupted
    assert routines[0].seen.shape == (96, 128, 3)


def test_a_damaged_state_takes_the_view_back(service: Service, daemon: SensorSession, tmp_path: Path) -> None:
    (tmp_path / "state").mkdir()
    (tmp_path / "state" / "state.json").write_text("{")
    with pytest.raises(BundleError, match="cannot be read"):
        service.begin(Request(anew=True, view=CHOSEN))
    comes(daemon, SHAPE)
    assert service.state().picture == ""
