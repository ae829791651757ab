"""What the wizard of the dashboard works with: begins a calibration beside the stream, installs what passes, restores.

The routine reads along the camera of the daemon, so the stream goes on, under whatever light the routine sets. The
watch rests meanwhile. However the routine ends, the sensor is then set and lit as the running bundle says.
"""

import threading
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

import numpy as np
import platformdirs
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field

from gellight.base.allowed import StrictModel
from gellight.base.errors import CameraError, GellightError, InputError
from gellight.bundle.bundle import Bundle
from gellight.bundle.store import BundleStore, ListedBundle
from gellight.daemon.bundle_choice import sensor_name
from gellight.daemon.installing import install, restore
from gellight.daemon.needs import Need, needs
from gellight.daemon.session import SensorSession
from gellight.frames.camera import Camera
from gellight.frames.picture import PictureSteps, chosen_steps, steps_in
from gellight.frames.view import View, view_in
from gellight.lab.calibration.choices import LEAST_WITH_LIKE, RoutineOptions, ToolSizes
from gellight.lab.calibration.presets import PRESETS, Preset
from gellight.lab.calibration.routine import Install, Routine
from gellight.lab.calibration.state import discard, kept_like, unfinished
from gellight.lab.simulator.virtual_hand import hand_of
from gellight.lab.training.table import table_of_like
from gellight.photometric.ring_geometry import RingGeometry
from gellight.photometric.window import seen_height_mm

Picture = NDArray[np.uint8]
RETRY_S = 1.0
"""between two attempts to set the sensor as its bundle says"""
SETTLE_S = 5.0
"""as long the next request waits until the sensor is set after a calibration"""


class ViewFile(StrictModel):
    """A file that `gellight calibrate view` wrote."""

    name: str = Field(max_length=255)
    content: str = Field(max_length=10_000)

    def view(self) -> View:
        """Return what it holds; InputError, with its name, for what is no view."""
        return view_in(self.content, self.name)


class CalibrationRequest(ToolSizes, StrictModel):
    """What a user chooses before a calibration begins."""

    presses: int = Field(default=40, ge=LEAST_WITH_LIKE, le=400)
    like: str = Field(default="", pattern="^[0-9a-f]{0,16}$")
    """identity of the bundle of a like unit; empty: none, or the one that an interrupted calibration was begun with"""
    view: ViewFile | None = None
    """part and perspective of the picture that is the gel; None: all of it"""
    dots: bool = False
    """the gel has marker dots, which are filled"""
    hand: bool = False
    """a virtual hand presses, on a simulated sensor"""
    anew: bool = False
    """forget an interrupted calibration instead of going on with it"""


class CalibrationState(BaseModel):
    """All that the wizard shows."""

    model_config = ConfigDict(frozen=True)

    sensor: str
    simulated: bool
    defaults: CalibrationRequest
    interrupted: bool
    """whether there is a calibration to go on with"""
    in_service: str
    """identity of the running bundle"""
    bundles: tuple[ListedBundle, ...]
    """of this sensor"""
    units: tuple[ListedBundle, ...]
    """the one in service of every sensor, for `CalibrationRequest.like`"""
    routine: Mapping[str, object] | None
    """see `Routine.snapshot`; None before the first"""
    hand: bool = False
    """whether the virtual hand presses in this routine"""
    needs: tuple[Need, ...] = ()
    """what a calibration needs; empty while one goes on"""
    picture: str = ""
    """how the pictures are prepared in use, in words; empty where they are as taken and a view can be chosen"""
    interrupted_picture: str = ""
    """the same of the calibration to go on with"""
    presets: tuple[Preset, ...] = PRESETS
    """kinds of sensors to choose from"""


MakeRoutine = Callable[[CalibrationRequest, Install], Routine]
"""Makes the routine that is asked for; `Install` installs the bundle that passes."""


class CalibrationService(AbstractContextManager["CalibrationService"]):
    """Calibrates a running sensor and changes its bundle; safe to use from any thread."""

    def __init__(
        self,
        daemon: SensorSession,
        *,
        store: BundleStore | None = None,
        folder: Path | None = None,
        geometry: Mapping[str, Any] | None = None,
        make_routine: MakeRoutine | None = None,
    ) -> None:
        """Calibrate the sensor of `daemon`; an interrupted calibration is kept in `folder`, by default the user's.

        geometry: how the sensor differs from the paper's, see `GeometrySettings.overrides`. `make_routine` makes
        another routine than the usual one, for tests.
        """
        self._daemon = daemon
        self._store = store or BundleStore()
        self.sensor = sensor_name(daemon.camera)
        self._folder = folder or platformdirs.user_state_path("gellight") / "calibration" / _plain(self.sensor)
        self._geometry = geometry or {}
        self._make_routine = make_routine or self._usual_routine
        self._routine: Routine | None = None
        self._hand = False
        self._end: threading.Thread | None = None
        """waits for the end of the routine, then sets the sensor as its bundle says"""
        self._closing = threading.Event()
        self._lock = threading.Lock()
        """held while a calibration begins or a bundle is restored"""

    def __exit__(self, *problem: object) -> None:
        """Stop a calibration that still runs, keep what it has measured, and set the sensor as its bundle says."""
        self._closing.set()
        if self._routine is not None and self.calibrating:
            self._routine.stop()
        if self._end is not None:
            self._end.join()

    @property
    def calibrating(self) -> bool:
        """Whether a calibration is going on: it sets the light and wants no other presses than its own."""
        return self._routine is not None and not self._routine.ended

    def state(self) -> CalibrationState:
        """Return all that the wizard shows."""
        interrupted, defaults, begun_picture = self._interrupted()
        listed = () if self.calibrating else needs(self._daemon, self._folder, defaults.presses)
        return CalibrationState(
            sensor=self.sensor,
            simulated=self._daemon.stage is not None,
            defaults=defaults,
            interrupted=interrupted,
            picture=_in_words(self._running_steps()),
            interrupted_picture=begun_picture,
            in_service=self._daemon.bundle.identity,
            bundles=tuple(self._store.bundles(self.sensor)),
            units=tuple(bundle for bundle in self._store.bundles() if bundle.in_service and not bundle.problem),
            routine=self._routine.snapshot() if self._routine else None,
            hand=self._hand,
            needs=listed,
        )

    def _interrupted(self) -> tuple[bool, CalibrationRequest, str]:
        """Return whether there is a calibration to go on with, its tools, and how it prepares its pictures.

        It goes on with no others.
        """
        hand = CalibrationRequest(hand=self._daemon.stage is not None)
        try:
            begun = unfinished(self._folder)
            tools = begun.sizes() if begun else {}
            picture = _in_words(begun.picture) if begun else ""
            return begun is not None, CalibrationRequest(hand=hand.hand, **tools), picture
        except GellightError:  # `begin` says what is wrong with the folder
            return True, hand, ""

    def begin(self, request: CalibrationRequest) -> None:
        """Begin a calibration; InputError while another one runs or for a request that cannot be met."""
        if self._daemon.mode != "network":
            raise InputError(
                f"the sensor streams in mode {self._daemon.mode}, which changes the light all the time: start it in "
                "network mode and without lighting.sequence to calibrate it"
            )
        with self._lock:
            self._check_idle("begin another")
            back, before = self._prepare(request), self._routine
            try:
                if request.like:
                    table_of_like(self._store.find(request.like).load(), self._daemon.camera.image_shape)
                self._daemon.begin_calibration()
                self._routine = routine = self._make_routine(request, self._install)
                routine.act("start")
            except BaseException:
                self._routine = before
                back()
                self._daemon.end_calibration()
                raise
            self._hand = request.hand
            self._end = threading.Thread(target=self._follow, args=(routine, back), name="calibration end", daemon=True)
            self._end.start()

    def _prepare(self, request: CalibrationRequest) -> Callable[[], object]:
        """Prepare the pictures as is asked for, or as an interrupted calibration has them; return what ends that.

        Raises InputError or BundleError where that cannot be; then nothing has changed.
        """
        begun = None if request.anew else unfinished(self._folder)
        if begun is not None:
            if request.view or request.dots:
                raise InputError("the interrupted calibration has its own view and dots: choose neither, or forget it")
            steps = begun.picture
        else:
            view = request.view.view() if request.view else None
            steps = chosen_steps(self._daemon.camera, view, dots=request.dots)
        return self._daemon.prepare(steps) if steps and steps != self._running_steps() else _nothing

    def _running_steps(self) -> PictureSteps | None:
        return steps_in(self._daemon.camera.bundle_files)

    def _follow(self, routine: Routine, back: Callable[[], object]) -> None:
        """Wait for the end of the routine, then set the sensor as its bundle says, as often as it takes."""
        routine.join()
        if not self._daemon.bundle.calibrated:  # none was made for the pictures as they are prepared
            back()
        while not self._daemon.end_calibration() and not self._closing.wait(RETRY_S):
            pass

    def _check_idle(self, intention: str) -> None:
        """Raise InputError while a calibration goes on, or while the sensor cannot be set as its bundle says."""
        if self.calibrating:
            raise InputError(f"a calibration is going on: stop it before you {intention}")
        if self._end is not None:
            self._end.join(SETTLE_S)
            if self._end.is_alive():
                raise InputError("the sensor cannot be set as its bundle says, its status says why: put that right")

    def act(self, action: str, **arguments: float) -> None:
        """Do what the user chose; InputError where it is not possible now."""
        if self._routine is None:
            raise InputError("no calibration is going on: begin one")
        self._routine.act(action, **arguments)

    def restore(self, identity: str) -> None:
        """Put a stored bundle into service again; InputError while a calibration goes on. Raises as `install`."""
        with self._lock:
            self._check_idle("restore a bundle")
            restore(identity, sensor=self.sensor, store=self._store, running=self._daemon, camera=self._present())

    def report(self, identity: str) -> bytes:
        """Return the report of a stored bundle, HTML; BundleError where there is none."""
        return self._store.find(identity).report()

    def picture(self, name: str) -> Picture:
        """Return a picture, (H, W, 3) RGB: "live" is the newest frame; InputError where there is none of that name."""
        if name == "live":
            return self._daemon.wait_frame(-1, 2.0).camera_frame.image
        pictures = self._routine.pictures() if self._routine else {}
        if name not in pictures:
            raise InputError(f"there is no picture {name!r} yet")
        return pictures[name]

    def _present(self) -> Camera:
        """Return the camera; CameraError while the sensor is away, when its board cannot remember a bundle."""
        camera = self._daemon.camera
        if sensor_name(camera) != self.sensor:
            raise CameraError(f"sensor {self.sensor} is away, and its board has to remember the bundle: plug it in")
        return camera

    def _install(self, bundle: Bundle) -> None:
        install(bundle, sensor=self.sensor, store=self._store, running=self._daemon, camera=self._present())
        # It lies in the store now, and an ended calibration is not to be gone on with.
        discard(self._folder)

    def _usual_routine(self, request: CalibrationRequest, install: Install) -> Routine:
        camera = self._daemon.camera
        if request.hand and camera.stage is None:
            raise InputError("the virtual hand needs a simulated sensor: untick it")
        options = RoutineOptions(
            out=self._folder.with_name(self._folder.name + ".bundle"),
            sensor=self.sensor,
            tools=ToolSizes.of(request.sizes()),
            presses=request.presses,
            like=self._like(request),
            overwrite=True,
            ring=RingGeometry.from_overrides(self._geometry),
            gel_thickness_mm=self._geometry.get("gel_thickness_mm", 0.0),
            camera_height_mm=seen_height_mm(self._geometry),
        )
        hand = hand_of(camera) if request.hand else None
        return Routine(camera, options, self._folder, hand=hand, install=install, anew=request.anew)

    def _like(self, request: CalibrationRequest) -> Bundle | None:
        if request.like:
            return self._store.find(request.like).load()
        return None if request.anew else kept_like(self._folder)


def _nothing() -> None:
    """Do nothing."""


def _in_words(steps: PictureSteps | None) -> str:
    """Return how pictures are prepared, for people; empty where they are as taken."""
    return steps.in_words() if steps else ""


def _plain(name: str) -> str:
    """A sensor's name as the name of a folder."""
    return "".join(letter if letter.isalnum() else "_" for letter in name)
