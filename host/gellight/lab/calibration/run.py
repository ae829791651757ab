"""What the steps of a calibration share: camera, options, state on disk, display, and the actions of the user."""

import queue
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

from gellight.base.errors import CameraError, GellightError
from gellight.frames.camera import Camera, EndOfStream
from gellight.frames.frames import CameraFrame
from gellight.frames.picture import steps_in
from gellight.lab.calibration.choices import LEAST_PRESSES, RoutineOptions
from gellight.lab.calibration.display import Display
from gellight.lab.calibration.folder import Folder
from gellight.lab.calibration.readiness import check_target
from gellight.lab.calibration.state import Identity, discard
from gellight.lab.simulator.virtual_hand import VirtualHand
from gellight.reconstruction.force import Layer


class Aborted(Exception):  # noqa: N818  (the user asked for it, nothing failed)
    """The user stopped the calibration."""


class CalibrationRun:
    """One calibration while it runs: used by the thread of the routine; any thread may use `submit` and `display`."""

    def __init__(
        self,
        camera: Camera,
        options: RoutineOptions,
        folder: Path,
        *,
        hand: VirtualHand | None = None,
        anew: bool = False,
    ) -> None:
        """Open the state in `folder`; InputError or BundleError for a folder or a bundle that cannot be written.

        anew: what is in the folder is removed, after everything else was found to be possible.
        """
        check_target(options, folder, camera.image_shape)
        self.camera = camera
        self.hand = hand
        self.display = Display()
        if anew:
            discard(folder)
        self.folder = Folder.open(folder, _identity(camera, options))
        self.options = replace(options, like=self.folder.keep_like(options.like))
        if options.name:
            self.folder.state.name = options.name
            self.folder.save()
        if camera.stage is not None:
            camera.stage.take_over()
        self._actions: queue.Queue[tuple[str, dict[str, float]]] = queue.Queue()
        self._stopped = threading.Event()

    @property
    def gel_thickness_mm(self) -> float:
        """Thickness of the soft gel; 0 where nobody told."""
        return self.camera.stage.gel_thickness_mm if self.camera.stage else self.options.gel_thickness_mm

    @property
    def layer(self) -> Layer | None:
        """The soft gel; None where nobody told how thick it is."""
        return Layer(self.gel_thickness_mm) if self.gel_thickness_mm else None

    @property
    def camera_height_mm(self) -> float:
        """How high the camera seems to stand above the gel; infinite where nobody told."""
        return self.camera.stage.camera_height_mm if self.camera.stage else self.options.camera_height_mm

    def drop_like(self) -> None:
        """Forget the like unit; without one fewer than `LEAST_PRESSES` are not enough."""
        self.folder.drop_like(LEAST_PRESSES)
        self.options = replace(self.options, like=None, presses=max(self.options.presses, LEAST_PRESSES))

    def submit(self, action: str, arguments: dict[str, float]) -> None:
        """Hand an action of the user to the thread of the routine."""
        if action == "abort":
            self._stopped.set()
        else:
            self._actions.put((action, arguments))

    def next_action(self) -> tuple[str, dict[str, float]] | None:
        """Return the next action of the user, or None; raises Aborted if that is what they want."""
        self.check_stopped()
        try:
            return self._actions.get_nowait()
        except queue.Empty:
            return None

    def check_stopped(self) -> None:
        """Raise Aborted if the user wants to stop."""
        if self._stopped.is_set():
            raise Aborted

    def frame(self) -> CameraFrame:
        """Wait for the next frame; Aborted if the user stops meanwhile, CameraError if no more come."""
        self.check_stopped()
        try:
            return self.camera.read()
        except EndOfStream as error:
            raise CameraError(f"{error}; a calibration needs a camera that goes on delivering") from error

    @contextmanager
    def offering(self, *actions: str) -> Iterator[None]:
        """Offer the user these actions, besides abort, while the block runs."""
        self.display.update(actions=(*actions, "abort"))
        try:
            yield
        finally:
            self.display.update(actions=("abort",))

    def wait_for_next(self, instruction: str) -> None:
        """Show an instruction and wait until the user says next; an automatic hand goes on at once."""
        self.display.update(instruction=instruction)
        if self.hand:
            return
        with self.offering("next"):
            while (chosen := self.next_action()) is None or chosen[0] != "next":
                self.display.show(live=self.frame().image)

    def refuse(self, error: GellightError, *, tolerate: bool = False) -> None:
        """Show why something is refused; raise it where no user can do it again, unless it is to be tolerated."""
        if self.hand and not tolerate:
            raise error
        self.display.update(problem=str(error))

    def wait_for_acceptance(self, problem: str, *, retry: bool = False) -> bool:
        """Show what looks wrong until the user accepts it (True) or, where that is offered, says next (False)."""
        before = self.display.shown.actions
        self.display.update(problem=problem)
        with self.offering("accept", *(("next",) if retry else ())):
            while (chosen := self.next_action()) is None or chosen[0] not in ("accept", "next"):
                self.display.show(live=self.frame().image)
        self.display.update(problem="", actions=before)
        return chosen[0] == "accept"


def _identity(camera: Camera, options: RoutineOptions) -> Identity:
    height, width = camera.image_shape
    return Identity(
        sensor=options.sensor,
        image_size_px=(width, height),
        **options.tools.sizes(),
        picture=steps_in(camera.bundle_files),
    )
