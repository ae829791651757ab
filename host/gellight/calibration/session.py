"""What the steps of a calibration share: the camera, the options, the state on disk and the talk with the user."""

import queue
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Protocol

import numpy as np

from gellight.base.errors import BundleError, CameraError, InputError
from gellight.bundle.bundle import load_bundle
from gellight.calibration.bulletin import STEPS, Bulletin
from gellight.calibration.choices import RoutineOptions
from gellight.calibration.folder import Folder
from gellight.frames.camera import Camera, EndOfStream
from gellight.frames.frames import CameraFrame


class Aborted(Exception):  # noqa: N818  (it is a wish, not a fault)
    """The user stopped the calibration."""


class Hand(Protocol):
    """Presses the tools into the gel where no user does."""

    def cylinder(self, number: int) -> None:
        """Press the cylinder probe, the `number`-th time."""

    def grid(self) -> None:
        """Press the pin grid."""

    def ball(self, number: int, pixel_size_mm: float, image_shape: tuple[int, int]) -> None:
        """Press the ball at the `number`-th place to train on."""

    def check(self, number: int, pixel_size_mm: float, image_shape: tuple[int, int]) -> None:
        """Press the ball at the `number`-th fresh place."""

    def lift(self) -> None:
        """Take the tool off the gel."""


class Session:
    """One calibration while it runs; used by the thread of the routine, `ask` and `bulletin` by any."""

    def __init__(self, camera: Camera, options: RoutineOptions, folder: Any, *, hand: Hand | None = None) -> None:
        """Open the state in `folder`; InputError or BundleError for the folder or bundle of another sensor."""
        _check_target(options, camera.image_shape)
        if camera.stage is not None:
            camera.stage.take_over()
        self.camera = camera
        self.options = options
        self.hand = hand
        self.bulletin = Bulletin(steps=tuple(s for s in STEPS if s != "lens" or options.pin_pitch_mm is not None))
        self.folder = Folder.open(folder, _identity(camera, options))
        self._asked: queue.Queue[tuple[str, dict[str, float]]] = queue.Queue()
        self._stopped = threading.Event()

    def ask(self, action: str, arguments: dict[str, float]) -> None:
        """Hand an action of the user to the thread of the routine."""
        if action == "abort":
            self._stopped.set()
        self._asked.put((action, arguments))

    def asked(self) -> tuple[str, dict[str, float]] | None:
        """Return the next action of the user, or None; raises Aborted if that is what they want."""
        try:
            action, arguments = self._asked.get_nowait()
        except queue.Empty:
            return None
        if action == "abort":
            raise Aborted
        return action, arguments

    def frame(self) -> CameraFrame:
        """Wait for the next frame; Aborted if the user stops meanwhile, CameraError if no more come."""
        if self._stopped.is_set():
            raise Aborted
        try:
            return self.camera.read()
        except EndOfStream as error:
            raise CameraError(f"{error}; a calibration needs a camera that goes on delivering") from error

    def frames(self) -> Iterator[CameraFrame]:
        """Yield frames for ever."""
        while True:
            yield self.frame()

    @contextmanager
    def offering(self, *actions: str) -> Iterator[None]:
        """Offer these actions, and always to abort, for a while."""
        self.bulletin.post(actions=(*actions, "abort"))
        try:
            yield
        finally:
            self.bulletin.post(actions=("abort",))

    def relight(self) -> None:
        """Light the LEDs again as they were prepared: a board that was reset or kept waiting is dark."""
        levels, ring = self.folder.steps["prepare"]["led"], self.camera.ring
        if levels and ring is not None:
            ring.light(np.array(levels, np.uint8))

    def confirmed(self, instruction: str) -> None:
        """Show an instruction and wait until the user says next; a hand needs no telling."""
        self.bulletin.post(instruction=instruction)
        if self.hand:
            return
        with self.offering("next"):
            while (asked := self.asked()) is None or asked[0] != "next":
                self.bulletin.show(live=self.frame().image)

    def questioned(self, problem: str, *, retry: bool = False) -> bool:
        """Show what looks wrong until the user accepts it (True) or, where that is offered, says next (False)."""
        before = self.bulletin.actions
        self.bulletin.post(problem=problem)
        with self.offering("accept", *(("next",) if retry else ())):
            while (asked := self.asked()) is None or asked[0] not in ("accept", "next"):
                self.bulletin.show(live=self.frame().image)
        self.bulletin.post(problem="", actions=before)
        return asked[0] == "accept"


def _identity(camera: Camera, options: RoutineOptions) -> dict[str, Any]:
    height, width = camera.image_shape
    return {
        "sensor": options.sensor,
        "image_size_px": [width, height],
        "ball_radius_mm": options.ball_radius_mm,
        "cylinder_diameter_mm": options.cylinder_diameter_mm,
        "pin_pitch_mm": options.pin_pitch_mm,
    }


def _check_target(options: RoutineOptions, image_shape: tuple[int, int]) -> None:
    """Refuse before any work what could not be written at its end."""
    if not options.out.exists():
        return
    if not options.overwrite:
        raise InputError(f"{options.out} exists: choose another name or allow overwriting")
    old = load_bundle(options.out)
    if old.manifest.sensor != options.sensor:
        raise BundleError(
            f"{options.out} is the bundle of sensor {old.manifest.sensor!r}, not of {options.sensor!r}: "
            "choose another name for the new one"
        )
    if old.image_shape != image_shape:
        raise BundleError(
            f"{options.out} is for pictures of {old.image_shape[1]} x {old.image_shape[0]} px, the camera delivers "
            f"{image_shape[1]} x {image_shape[0]} px: choose another name for the new one"
        )
