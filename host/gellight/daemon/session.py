"""The running sensor: a stream of depth, whose bundle, mode, zero and light can be changed while it goes on.

What runs is one value, an `ActivePipeline`, and one method, `SensorSession._switch`, exchanges it, under one lock: a
bundle that is installed or restored, another mode, another view, a zero, the light and the end of a calibration all go
that way. Where any part fails, what ran before goes on.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import CameraError, GellightError, InputError
from gellight.base.mailbox import Mailbox
from gellight.base.settings import Settings
from gellight.bundle.bundle import Bundle
from gellight.daemon.active_pipeline import ActivePipeline, build_pipeline, contact_summary, path_for
from gellight.daemon.bundle_choice import placeholder
from gellight.daemon.configuration import ModeConfig, PathKind, in_mode, mode_config
from gellight.daemon.frame_threads import FrameThreads, SharedCamera
from gellight.daemon.switched_camera import SensorState, SwitchedCamera
from gellight.frames.camera import Camera, PressStage
from gellight.frames.frames import CameraFrame, TactileFrame
from gellight.frames.picture import FILE_NAME as PICTURE_STEPS
from gellight.frames.picture import PictureSteps
from gellight.frames.status import SensorStatus
from gellight.reconstruction.following import ContactFollower, object_follower
from gellight.reconstruction.shear.slip import SlipFollower
from gellight.watch.monitor import PERIOD_S, SensorWatch

CALIBRATING_PAUSE_S = 0.3
"""between two reconstructions while a calibration goes on: it needs the processor, and under its light depth means
nothing"""


class SensorSession:
    """Runs a camera and what its frames go through; a context manager that stops its threads and closes the camera."""

    def __init__(
        self,
        camera: Camera,
        bundle: Bundle,
        settings: Settings,
        *,
        pipeline: ActivePipeline | None = None,
        every: bool = False,
    ) -> None:
        """Take over `camera`, set and lit as `bundle` says (it is closed at the end), and build what `settings` say.

        pipeline: run this first instead. every: the pictures of files wait until `next_frame` asks for them. Raises
        BundleError, ConfigError or InputError where bundle, settings and camera do not go together or nothing installed
        tracks, and what the camera raises that cannot take its frames so.
        """
        self._camera = SwitchedCamera(camera)
        self._settings = settings
        """as it was opened: a mode that uses no light sequence does not forget how the next one moves it on"""
        self._follow_object = object_follower() if settings.tracking.enabled else None
        """what gives frames the pose of their object; None: nobody asks for it"""
        self._calibration: SensorState | None = None
        """how the sensor was set before a calibration; None while none goes on"""
        self.recording: str | None = None
        """name of the file that a recorder writes now"""
        self._changing = threading.RLock()
        """held while what runs is changed"""
        config = pipeline.config if pipeline else mode_config(bundle, settings)
        prepared = self._camera.prepared(config)
        self._active = pipeline or build_pipeline(config, prepared)
        self._camera.switch(prepared, config.light, None)
        self._contacts, self._slips = ContactFollower(), SlipFollower()
        self._threads = FrameThreads(
            self._camera,
            self._felt,
            lambda: self.zeroed_bundle,
            every=every,
            realtime=settings.service.realtime,
        )
        self._threads.add_periodic(self._watch_now_and_then, PERIOD_S)

    def __enter__(self) -> Self:
        """Start the threads; InputError where the system does not let them run first."""
        try:
            self._threads.start()
        except BaseException:
            self.__exit__()
            raise
        return self

    def __exit__(self, *problem: object) -> None:
        """Stop the threads and close the camera, which makes the LEDs dark."""
        try:
            self._threads.stop()
        finally:
            with self._changing:  # nobody lights the LEDs after that
                self._camera.close()

    @property
    def stage(self) -> PressStage | None:
        """Where objects can be pressed into the gel, if the camera offers that."""
        return self._camera.stage

    @property
    def pixel_size_mm(self) -> tuple[float, float]:
        """(x, y) size of a camera pixel on the gel."""
        return self._active.path.bundle.pixel_size_mm

    @property
    def mode(self) -> str:
        """How slopes are found, see `FramePath.status`."""
        return str(self._active.path.status()["mode"])

    @property
    def bundle(self) -> Bundle:
        """The bundle in use, as it was installed: a zero that followed the light is not in it."""
        return self._active.bundle

    @property
    def zeroed_bundle(self) -> Bundle:
        """The bundle in use with the zero in use."""
        return self._active.path.bundle

    @property
    def camera(self) -> Camera:
        """The camera as another reader sees it: its newest frames, controls and ring; closing it does nothing."""
        return SharedCamera(self._camera, self._threads.captured)

    @property
    def calibrating(self) -> bool:
        """Whether a calibration goes on, which sets the light and wants no other presses than its own."""
        return self._calibration is not None

    @property
    def joins_exposures(self) -> bool:
        """Whether a tactile frame is made of several pictures, each under another light."""
        return self._active.config.light.joined

    @property
    def watch(self) -> SensorWatch | None:
        """What watches for changes since the calibration; another one after the calibration was replaced."""
        return self._active.watch

    # ---- what runs, and its exchange ----

    def replace_bundle(self, bundle: Bundle) -> Callable[[], object]:
        """Reconstruct with another bundle from the next frame on, in the same mode; the stream goes on.

        Returns what takes this back: bundle, zero, camera and LEDs are then as before. Raises BundleError for a bundle
        of another image size, with a network that cannot be run or without what the mode needs, ConfigError where mode
        and light do not go with it, and what the camera raises that cannot be set as the bundle says; then what ran
        before goes on.
        """
        with self._changing:
            return self._configure(mode_config(bundle, self._active.config.settings), SensorState.said_by(bundle))

    def change_mode(self, mode: str) -> None:
        """Go on in another mode: network or photometric. The sensor is lit as the bundle says, or as it needs.

        Raises InputError while a calibration goes on and for an unknown mode; BundleError, CameraError, ConfigError or
        BoardError where the mode cannot be. Then it goes on as before.
        """
        with self._changing:
            self._check_not_calibrating()
            bundle, settings = self._active.bundle, in_mode(self._settings, mode)
            self._configure(mode_config(bundle, settings), SensorState.said_by(bundle))

    def prepare(self, steps: PictureSteps) -> Callable[[], object]:
        """Prepare the pictures so from the next frame on; nothing is felt until a bundle for them replaces this one.

        Returns what takes this back. Raises InputError where the bundle in use prepares them already, BundleError for a
        view of pictures of another size.
        """
        with self._changing:
            if PICTURE_STEPS in self._camera.bundle_files:
                raise InputError(
                    "the bundle in use takes a view or fills marker dots already, and a calibration beside it keeps "
                    "that: choose neither, forget an interrupted calibration with others, or calibrate in the terminal"
                )
            bundle = placeholder((steps.image_height_px, steps.image_width_px))
            config = mode_config(bundle, self._active.config.settings)
            return self._configure(replace(config, pictures=steps), None)

    def rezero(self, *, asked: bool = True) -> None:
        """Set the zero of the depth to the gel as it is now; the stream goes on.

        asked: a person says that nothing touches; else it is the watch, for slow drift. Raises InputError, saying why,
        where the zero must not be set.
        """
        with self._changing:
            bundle, watch = self._active.bundle, self._active.watch
            if watch is None:
                raise InputError(
                    f"the gel is not watched, so its zero cannot be set: {_to_be_watched(self._active.config)}"
                )
            zero = watch.propose_zero(asked=asked)
            zeroed = bundle.with_reference(zero.reference, frames=bundle.manifest.reference_frames)
            self._switch(replace(self._active, path=path_for(self._active.config, zeroed)), None)
            watch.accept_zero(zero)

    def light(self, colours: NDArray[np.uint8] | None) -> None:
        """Show (n, 3) uint8 RGB on the n LEDs from now on, or the light of the bundle again (None).

        Depth means something only under the light of the bundle. Raises InputError while a calibration goes on,
        where the sensor has no ring or another number of LEDs, else as `Camera.adopt`.
        """
        with self._changing:
            self._check_not_calibrating()
            ring, bundle = self._camera.ring, self.bundle
            if ring is None:
                raise InputError(f"{self._camera.url} has no light ring that can be driven")
            if colours is not None and len(colours) != ring.led_count:
                raise InputError(f"{len(colours)} colours, the ring has {ring.led_count} LEDs: give one each")
            if self.mode != "network":
                raise InputError(f"the sensor runs in mode {self.mode}, which changes the light all the time")
            shown = bundle.colours if colours is None else colours
            self._switch(self._active, SensorState(controls=bundle.controls, colours=shown))

    def track(self, on: bool) -> None:
        """Give frames the pose of the object that touches from now on, or no more; where nothing changes, go on.

        Raises InputError where nothing that tracks is installed.
        """
        with self._changing:
            if on != (self._follow_object is not None):
                self._follow_object = object_follower() if on else None

    def begin_calibration(self) -> None:
        """Let a calibration set camera and LEDs: the watch rests, and few frames are reconstructed.

        Raises what the camera raises that does not say how it is set.
        """
        with self._changing:
            self._calibration = SensorState.of(self._camera)
            self._threads.pause_s = CALIBRATING_PAUSE_S
            if self.watch is not None:
                self.watch.paused = True

    def end_calibration(self) -> bool:
        """Set and light the sensor as the running bundle says, and go on as before the calibration; whether it is done.

        What goes wrong stands in the status until it has been done. After the session was stopped nothing is lit.
        """
        with self._changing:
            before = self._calibration
            if before is None or self._threads.ended:
                return True
            try:
                self._switch(self._active, SensorState.said_by(self._active.bundle).over(before))
            except GellightError as error:
                self._threads.note("setting", f"the sensor is not set as its bundle says: {error}")
                return False
            self._calibration, self._threads.pause_s = None, 0.0
            if self.watch is not None:
                self.watch.paused = False
            return True

    def _check_not_calibrating(self) -> None:
        if self.calibrating:
            raise InputError("a calibration goes on, which sets the light: wait for its end, or stop it")

    def _configure(self, config: ModeConfig, state: SensorState | None) -> Callable[[], object]:
        """Build what `config` says, and let it run; see `_switch`."""
        return self._switch(build_pipeline(config, self._camera.prepared(config)), state)

    def _switch(self, pipeline: ActivePipeline, state: SensorState | None) -> Callable[[], object]:
        """Let `pipeline` run from the next frame on, after the sensor was set and lit like `state` (None: as it is).

        Returns what takes this back. Raises CameraError once the session is stopped, else what cannot be set or lit;
        then what ran before goes on.
        """
        with self._changing:
            if self._threads.ended:
                raise CameraError(f"{self._camera.url} was stopped: its LEDs stay dark")
            before, config, set_before = self._active, pipeline.config, None
            if pipeline.watch is not None:
                pipeline.watch.paused = self.calibrating
            if state is None and config is before.config:  # another zero: the camera goes on as it is
                self._active = pipeline
            else:
                prepared = self._camera.prepared(config)
                with self._threads.halted():
                    set_before = self._camera.switch(prepared, config.light, state)
                    self._active = pipeline
                self._threads.note("setting", None)
        return lambda: self._switch(before, set_before if state else None)

    # ---- what comes out ----

    @property
    def captured(self) -> Mailbox[CameraFrame]:
        """The newest camera frame; `Mailbox.subscribe` gives them all."""
        return self._threads.captured

    @property
    def delivered(self) -> Mailbox[TactileFrame]:
        """The newest tactile frame; `Mailbox.subscribe` gives them all."""
        return self._threads.delivered

    def wait_frame(self, after_sequence: int, timeout_s: float) -> TactileFrame:
        """Wait for a tactile frame whose camera sequence number is greater than `after_sequence`.

        Raises TimeoutError, or what ended the run (`EndOfStream`
        when the images are used up).
        """
        self.go_on_after(-1)
        deadline = time.monotonic() + timeout_s
        number = 0
        while True:
            number, frame = self._threads.delivered.take(number, max(deadline - time.monotonic(), 0.0))
            if frame.camera_frame.sequence > after_sequence:
                return frame

    def next_frame(self, after_sequence: int, timeout_s: float) -> TactileFrame:
        """Do as `wait_frame` for the one reader of a session with `every`: pictures of files wait for this call."""
        self.go_on_after(after_sequence)
        return self.wait_frame(after_sequence, timeout_s)

    def go_on_after(self, sequence: int) -> None:
        """Say that the one reader of a session with `every` has the frames up to this sequence number."""
        self._threads.note_asked(sequence)

    def _newest(self) -> TactileFrame | None:
        try:
            return self._threads.delivered.take(0, 0.0)[1]
        except Exception:  # none is there yet, or the frames ended before one was
            return None

    def status(self) -> SensorStatus:
        """Return what is known of the sensor, ready for JSON."""
        camera, used = self._camera.status(), self._active
        ring, newest = self._camera.ring, self._newest()
        return {
            "sensor": self._camera.url,
            **used.path.status(),
            **self._threads.statistics.as_json(time.monotonic()),
            "touch": contact_summary(newest) if newest else None,
            "exposures": newest.exposures.as_json() if newest and newest.exposures else None,
            "calibration": {
                "sensor": used.bundle.manifest.sensor,
                "identity": used.bundle.identity,
                "verified": used.verified,
                "force": used.force,
            },
            "watch": used.watch.status() if used.watch else None,
            "ring": ring.heat.known() if ring else None,
            "tracking": self._follow_object is not None,
            "recording": self.recording,
            "priority": "real time" if self._settings.service.realtime else "as other programs",
            "error": self._threads.problem or camera.get("why"),
            "camera": camera,
        }

    def _felt(self, frame: CameraFrame) -> TactileFrame:
        """Return what a camera frame feels, with what the frames before say of it."""
        felt = self._slips.follow(self._contacts.follow(self._active.reconstruct(frame)))
        follow = self._follow_object
        return felt if follow is None else follow(felt)

    def _watch_now_and_then(self, frame: TactileFrame) -> None:
        """Let the watch look at a frame, and let the zero follow slow drift."""
        watch = self.watch
        if watch is None or frame.camera_frame.label is not None:  # in this mode, or of a sequence that was recorded
            return
        watch.note(frame)
        with self._changing:  # nobody replaces the bundle or sets a zero between the question and the zero
            if self.watch is watch and not watch.refusal(asked=False):
                self.rezero(asked=False)


def _to_be_watched(config: ModeConfig) -> str:
    """What lets the watch look at the frames."""
    if config.path is PathKind.NETWORK:
        return "switch watch.enabled on"
    return "change to network mode" if config.light.model is not None else "calibrate this sensor anew"
