"""What runs, times what is put in while it runs.

A ball is pressed 1 mm deep. Each pair feels it, or is refused and what ran before feels it, two frames later.

Trigger (`ext`) and free are lights that nobody waits for; the strobe of `sim://` is a wire to its board. Three kinds of
rows cannot be with them: network mode refuses them without a sequence, and a bundle with a lens or a view has no
photometric mode. One with lights of its own is put in.
"""

import time
from collections.abc import Callable

import numpy as np
import pytest

from gellight.base.errors import GellightError
from gellight.base.settings import Settings
from gellight.bundle.bundle import Bundle
from gellight.daemon.bundle_choice import placeholder
from gellight.daemon.session import SensorSession
from gellight.frames.camera import Camera, ReconnectingError
from gellight.frames.camera_wrapper import CameraWrapper
from gellight.frames.frames import CameraFrame
from gellight.frames.picture import PictureSteps
from gellight.frames.view import View
from gellight.opening import open_camera
from tests.helpers import small_bundles as small

SMALL = {"image_width_px": small.SHAPE[1], "image_height_px": small.SHAPE[0], "pixel_size_mm": small.PIXEL_MM}
PRESSED_MM = 1.0
URL = f"sim://?object=BALL&depth={PRESSED_MM}"
MOVED_ON = {"free": "&fps=10", "ext": "&fps=10&strobe=1"}
"""lights that are not waited for need time between the frames on a busy machine"""
WITHIN = 0.05
"""of what is pressed"""
PATIENCE_S = 60.0
LONGEST_S = 200.0
"""a pair that takes longer hangs; on a busy machine the slowest took 15 s"""
AWAY_READS = 5
pytestmark = pytest.mark.timeout(900)
ROWS = {
    "network": ("ordinary", "network", "hold"),
    "network, lens": ("lens", "network", "hold"),
    "network, view": ("view", "network", "hold"),
    "network, dots": ("dots", "network", "hold"),
    "network, lights": ("directions", "network", "hold"),
    "no bundle": ("none", "network", "hold"),
    "photometric": ("ordinary", "photometric", "hold"),
    "photometric, dots": ("dots", "photometric", "hold"),
    "photometric, lights": ("directions", "photometric", "hold"),
    "photometric, trigger": ("ordinary", "photometric", "ext"),
    "photometric, free": ("ordinary", "photometric", "free"),
}
"""bundle, mode and light mode of what runs"""
BY_DAY = ("network", "network, view", "no bundle", "photometric")
BUNDLES = ("ordinary", "lens", "view", "dots", "directions", "none")
COLUMNS = (
    *BUNDLES, "zero", "light", "calibrated", "aborted", "unplugged", "unheard", "to network", "to photometric"
)  # fmt: skip


class Unplugged(CameraWrapper):
    """A camera that can be away for some reads, with its ring and controls or without."""

    def __init__(self, camera: Camera) -> None:
        super().__init__(camera)
        self._left, self._bare = 0, False

    def pull(self, *, bare: bool) -> None:
        """Let the next reads fail; bare: ring and controls are gone meanwhile."""
        self._bare, self._left = bare, AWAY_READS

    def __getattribute__(self, name: str) -> object:
        if name in ("ring", "controls") and self._left and self._bare:
            return None
        return super().__getattribute__(name)

    def read(self) -> CameraFrame:
        if self._left:
            time.sleep(0.05)
            self._left -= 1
            raise ReconnectingError(f"{self.url} was unplugged: plug it in")
        return self._camera.read()


@pytest.fixture(scope="session")
def bundles() -> dict[str, Bundle]:
    whole = small.ordinary()
    return {
        "ordinary": whole, "lens": small.with_lens(whole), "view": small.with_view(whole),
        "dots": small.with_dots(whole), "directions": small.with_directions(whole), "none": placeholder(small.SHAPE),
    }  # fmt: skip


def felt(session: SensorSession) -> None:
    """The second frame from now feels what is pressed, and nothing without a calibration."""
    last = session.wait_frame(-1, PATIENCE_S).camera_frame.sequence
    for _ in range(2):
        frame = session.wait_frame(last, PATIENCE_S)
        last = frame.camera_frame.sequence
    assert session.status()["error"] is None, session.status()["error"]
    assert session.zeroed_bundle.source == session.bundle.source, "another bundle computes"
    share = frame.contact.indentation_mm / PRESSED_MM
    if session.bundle.calibrated:
        assert share == pytest.approx(1, abs=WITHIN), f"{session.mode} {session.bundle.source} feels {share:.3f}"
    else:
        assert np.isnan(share)


def put_in(session: SensorSession, camera: Unplugged, what: str, bundles: dict[str, Bundle]) -> None:
    """Put it in, and take it back; it is felt in between, or after what leaves nothing behind."""
    light_mode = session._active.config.light.light_mode
    if what in bundles:
        back = session.replace_bundle(bundles[what])
    elif what.startswith("to "):
        mode = session._active.config.settings.reconstruction.mode
        session.change_mode(what[3:])
        back = lambda: session.change_mode(mode)  # noqa: E731
    else:
        PASSING[what](session, camera)
        back = lambda: None  # noqa: E731
    try:
        felt(session)
    finally:
        back()
        assert session._active.config.light.light_mode is light_mode or what in bundles


def zero(session: SensorSession, camera: Unplugged) -> None:
    stage = session.stage
    stage.release()
    try:
        patient(session.rezero)
    finally:
        stage.press("BALL", PRESSED_MM, 0.0, 0.0)
        settled(session)


def patient(job: Callable[[], object], patience_s: float = 4.0) -> None:
    """Do it as soon as it is not refused; raise the last refusal."""
    until_s = time.monotonic() + patience_s
    while True:
        try:
            job()
        except GellightError as error:
            if time.monotonic() > until_s or "so its zero cannot be set" in str(error):
                raise
            time.sleep(0.2)
        else:
            return


def settled(session: SensorSession) -> None:
    """Wait for a picture that was taken from now on, and for a result that does not say that the gel moved."""
    frame = session.wait_frame(session.camera.read().sequence, PATIENCE_S)
    until_s = time.monotonic() + PATIENCE_S
    while frame.exposures is not None and frame.exposures.moved:
        assert time.monotonic() < until_s, "it says for ever that the gel moves"
        frame = session.wait_frame(frame.camera_frame.sequence, PATIENCE_S)


def light(session: SensorSession, camera: Unplugged) -> None:
    session.light(np.full((12, 3), 40, np.uint8))
    settled(session)
    session.light(None)


def calibrated(session: SensorSession, camera: Unplugged) -> None:
    session.begin_calibration()
    try:
        session.camera.adopt({"exposure_us": 4000.0}, np.full((12, 3), 90, np.uint8))
        settled(session)
    finally:
        assert session.end_calibration()


def aborted(session: SensorSession, camera: Unplugged) -> None:
    session.begin_calibration()
    try:
        back = session.prepare(PictureSteps.with_view(View.of_box(small.BOX, small.SHAPE)))
        session.camera.adopt({}, np.full((12, 3), 90, np.uint8))
        session.wait_frame(-1, PATIENCE_S)
        back()
    finally:
        assert session.end_calibration()


def unplugged(session: SensorSession, camera: Unplugged, *, bare: bool = False) -> None:
    camera.pull(bare=bare)
    until_s = time.monotonic() + PATIENCE_S
    while session.status()["error"] is None:
        assert time.monotonic() < until_s, "nobody says that it is away"
    session.wait_frame(-1, PATIENCE_S)


def unheard(session: SensorSession, camera: Unplugged) -> None:
    unplugged(session, camera, bare=True)


PASSING: dict[str, Callable[[SensorSession, Unplugged], None]] = {
    "zero": zero, "light": light, "calibrated": calibrated, "aborted": aborted, "unplugged": unplugged,
    "unheard": unheard,
}  # fmt: skip


def opened(row: str, bundles: dict[str, Bundle]) -> tuple[SensorSession, Unplugged]:
    """Return the session of a row, not begun, and its camera."""
    name, mode, light_mode = ROWS[row]
    url, bundle = URL + MOVED_ON.get(light_mode, ""), bundles[name]
    settings = Settings.model_validate(
        {
            "sensor": {"url": url},
            "geometry": SMALL,
            "reconstruction": {"mode": mode},
            "lighting": {"light_mode": light_mode},
        }
    )
    camera = Unplugged(open_camera(url, geometry=settings.geometry.overrides(), bundle=lambda _: bundle))
    return SensorSession(camera, bundle, settings), camera


def wrong_with(session: SensorSession, camera: Unplugged, what: str, bundles: dict[str, Bundle]) -> list[str]:
    """Put it in; return what must not be of what comes of it."""
    photometric = session.mode == "photometric" and session.bundle.source != bundles["directions"].source
    try:
        put_in(session, camera, what, bundles)
    except GellightError as error:
        if "\n" in str(error):
            return [f"{what}: more than one line: {error}"]
        if what == "zero" and photometric and "change to network mode" not in str(error):
            return [f"{what}: no remedy: {error}"]
    except AssertionError as error:
        return [f"{what}: {error}"]
    return []


@pytest.mark.parametrize(
    "row", [row if row in BY_DAY else pytest.param(row, marks=pytest.mark.nightly) for row in ROWS]
)
def test_what_runs_takes_what_is_put_in_or_refuses_it_and_feels_on(row: str, bundles: dict[str, Bundle]) -> None:
    wrong: list[str] = []
    running, camera = opened(row, bundles)
    with running as session:
        felt(session)
        for what in COLUMNS:
            begun_s = time.monotonic()
            wrong += wrong_with(session, camera, what, bundles)
            try:
                felt(session)  # what ran before feels what is pressed
            except AssertionError as error:
                wrong.append(f"after {what}: {error}")
            if time.monotonic() - begun_s > LONGEST_S:
                wrong.append(f"{what}: took {time.monotonic() - begun_s:.1f} s")
    assert wrong == []
