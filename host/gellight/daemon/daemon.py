"""The running sensor: a stream of depth, whose bundle, zero and light can be changed while it goes on."""

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import BundleError, CameraError, GellightError, InputError
from gellight.base.mailbox import Mailbox
from gellight.bundle.bundle import Bundle
from gellight.bundle.placeholder import placeholder
from gellight.daemon.frame_threads import FrameThreads, SharedCamera
from gellight.daemon.in_use import InUse, touch_of
from gellight.daemon.setting import Setting
from gellight.daemon.switched_camera import Equip, SwitchedCamera
from gellight.frames.camera import Camera, PressStage
from gellight.frames.frames import CameraFrame, FrameJudge, SelfCheckResult, TactileFrame
from gellight.frames.picture import FILE_NAME as PICTURE_STEPS
from gellight.frames.picture import PictureSteps
from gellight.reconstruction.picture_path import PicturePath
from gellight.reconstruction.pipeline import FramePath, Reconstructor
from gellight.watch.monitor import PERIOD_S, SensorWatch

SELFCHECK_PERIOD_S = 1.0
CALIBRATING_PAUSE_S = 0.3
"""between two reconstructions while a calibration goes on: it needs the processor, and under its light depth means
nothing"""


@dataclass(frozen=True, kw_only=True)
class Equipment:
    """What a sensor needs to run in one mode."""

    equip: Equip
    """puts in front of the camera what the mode needs"""
    rebuild: Callable[[Bundle], FramePath]
    """makes the frame path of a bundle"""
    watched: bool
    """whether the watch can look at the frames"""
    rezero: bool
    """whether the zero follows slow drift by itself"""


class Daemon:
    """Runs a camera and a reconstructor; a context manager that stops its threads and closes the camera."""

    def __init__(
        self,
        camera: Camera,
        reconstructor: FramePath,
        *,
        selfcheck: FrameJudge | None = None,
        rebuild: Callable[[Bundle], FramePath] = Reconstructor,
        watch: SensorWatch | None = None,
        equipment: Callable[[Bundle, str], Equipment] | None = None,
        every: bool = False,
        realtime: bool = False,
    ) -> None:
        """Take over `camera` (it is closed at the end); `selfcheck` judges frames that carry their truth.

        `rebuild` makes the reconstructor of a bundle that replaces the running one. `watch` looks at what comes and
        says what has changed since the calibration. `equipment` says what another mode needs with a bundle;
        without it the mode cannot be changed. every: the pictures of files wait until `next_frame` asks for them.
        realtime: camera and reconstruction run before all other programs.
        """
        self._camera = camera
        self._equipment = equipment
        self._rebuild = rebuild
        bundle = reconstructor.bundle
        self._in_use = InUse(bundle=bundle, reconstructor=reconstructor, watch=watch, selfcheck=selfcheck)
        self._lent: Setting | None = None
        """how the sensor was set before a calibration; None while none goes on"""
        self._changing = threading.RLock()
        """held while bundle, zero or light are changed"""
        self._selfcheck_result: SelfCheckResult | None = None
        self._threads = FrameThreads(
            camera, lambda frame: self._in_use.reconstruct(frame), every=every, realtime=realtime
        )
        if selfcheck:
            self._threads.also(self.check, SELFCHECK_PERIOD_S)
        if watch or equipment:
            self._threads.also(self._watch_now_and_then, PERIOD_S)

    def __enter__(self) -> Self:
        """Start the threads; InputError where the system does not let them run first."""
        try:
            self._threads.start()
        except InputError:
            self.__exit__()
            raise
        return self

    def __exit__(self, *problem: object) -> None:
        """Stop the threads and close the camera, which makes the LEDs dark."""
        self._threads.stop()
        with self._changing:  # nobody lights the LEDs after that
            self._camera.close()

    @property
    def stage(self) -> PressStage | None:
        """Where objects can be pressed into the gel, if the camera offers that."""
        return self._camera.stage

    @property
    def pixel_size_mm(self) -> tuple[float, float]:
        """(x, y) size of a camera pixel on the gel."""
        return self._in_use.reconstructor.bundle.pixel_size_mm

    @property
    def mode(self) -> str:
        """How slopes are found: network or photometric."""
        return str(self._in_use.reconstructor.status()["mode"])

    @property
    def bundle(self) -> Bundle:
        """The bundle in use, as it was installed: a zero that followed the light is not in it."""
        return self._in_use.bundle

    @property
    def zeroed_bundle(self) -> Bundle:
        """The bundle in use with the zero in use."""
        return self._in_use.reconstructor.bundle

    @property
    def camera(self) -> Camera:
        """The camera as another reader sees it: its newest frames, controls and ring; closing it does nothing."""
        return SharedCamera(self._camera, self._threads.captured)

    @property
    def watch(self) -> SensorWatch | None:
        """What watches for changes since the calibration; another one after the calibration was replaced."""
        return self._in_use.watch

    # ---- another bundle, another zero, another light ----

    def replace_bundle(self, bundle: Bundle) -> Callable[[], object]:
        """Reconstruct with another bundle from the next frame on; the stream goes on.

        Returns what takes this back: bundle, zero, camera and LEDs are then as before. Raises BundleError for a bundle
        of another image size or with a network that cannot be run, and what the camera raises that cannot be set as
        the bundle says; then nothing has changed.
        """
        bundle.check_fits(self._camera.url, self._camera.image_shape)
        if bundle.files.get(PICTURE_STEPS) != self._camera.picture_files.get(PICTURE_STEPS):
            raise BundleError(
                f"{bundle.source} takes another view of the gel, or fills other dots, than the running sensor: stop "
                "it, and start it with this bundle"
            )
        judge = self._in_use.selfcheck
        replacement = InUse(
            bundle=bundle,
            reconstructor=self._rebuild(bundle),
            watch=self._watch_of(bundle),
            selfcheck=self._camera.selfcheck(bundle.pixel_size_mm) if judge else None,
        )
        with self._changing:
            before = self._in_use
            setting = self._use(replacement, Setting.said_by(bundle))
        return lambda: self._use(before, setting)

    def prepare(self, steps: PictureSteps) -> Callable[[], object]:
        """Prepare the pictures so from the next frame on; nothing is felt until a bundle for them replaces this one.

        Returns what takes this back. Raises InputError where the bundle in use prepares them already, BundleError for a
        view of pictures of another size.
        """
        camera = self._camera
        if not isinstance(camera, SwitchedCamera):
            raise InputError(f"how the pictures of {camera.url} are prepared cannot be changed while it runs")
        if PICTURE_STEPS in camera.picture_files:
            raise InputError(
                "the bundle in use takes a view or fills marker dots already, and a calibration beside it keeps that: "
                "choose neither, forget an interrupted calibration with others, or calibrate in the terminal"
            )
        bundle = placeholder((steps.image_height_px, steps.image_width_px))
        before = self._in_use
        nothing = InUse(bundle=bundle, reconstructor=PicturePath(bundle), watch=None, selfcheck=None)
        self._change_pictures(camera, steps, nothing)
        return lambda: self._change_pictures(camera, None, before)

    def _change_pictures(self, camera: SwitchedCamera, steps: PictureSteps | None, used: InUse) -> None:
        with self._changing, self._threads.halted():
            camera.prepare(steps)
            self._in_use = used

    def _watch_of(self, bundle: Bundle) -> SensorWatch | None:
        """Return what watches with a bundle that replaces the running one; the first bundle begins the watch."""
        watch = self._in_use.watch
        if watch is None and not self._in_use.bundle.calibrated and self._equipment is not None:
            needed = self._equipment(bundle, self.mode)
            return SensorWatch(bundle, rezero=needed.rezero) if needed.watched else None
        return SensorWatch(bundle, rezero=watch.rezero) if watch else None

    def _use(self, replacement: InUse, setting: Setting) -> Setting:
        """Go on with another bundle and light; return how the sensor was set before."""
        with self._changing:
            before = self._set(setting)
            if replacement.watch is not None:
                replacement.watch.paused = self._lent is not None
            self._in_use = replacement
        return before

    def _set(self, setting: Setting) -> Setting:
        """Set and light the sensor, and deliver no frame from before; return how it was set before.

        Raises CameraError once the daemon is stopped, else as `Setting.apply`.
        """
        if self._threads.ended:
            raise CameraError(f"{self._camera.url} was stopped: its LEDs stay dark")
        before = setting.apply(self._camera)
        self._threads.note("setting", None)
        self._threads.throw_away()
        return before

    def lend(self) -> None:
        """Let a calibration set camera and LEDs: the watch rests, and few frames are reconstructed.

        Raises what the camera raises that does not say how it is set.
        """
        with self._changing:
            self._lent = Setting.of(self._camera)
            self._threads.pause_s = CALIBRATING_PAUSE_S
            if self.watch is not None:
                self.watch.paused = True

    def take_back(self) -> bool:
        """Set and light the sensor as the running bundle says, and go on as before `lend`; whether that is done.

        What goes wrong stands in the status until it has been done. After the daemon was stopped nothing is lit.
        """
        with self._changing:
            if self._lent is None or self._threads.ended:
                return True
            try:
                self._set(Setting.said_by(self._in_use.bundle).over(self._lent))
            except GellightError as error:
                self._threads.note("setting", f"the sensor is not set as its bundle says: {error}")
                return False
            self._lent, self._threads.pause_s = None, 0.0
            if self.watch is not None:
                self.watch.paused = False
            return True

    def light(self, colours: NDArray[np.uint8] | None) -> None:
        """Show (n, 3) uint8 RGB on the n LEDs from now on, or the light of the bundle again (None).

        Depth means something only under the light of the bundle. Raises InputError while a calibration goes on,
        where the sensor has no ring or another number of LEDs, else as `Camera.adopt`.
        """
        with self._changing:
            if self._lent is not None:
                raise InputError("a calibration goes on, which sets the light: wait for its end, or stop it")
            if self._camera.ring is None:
                raise InputError(f"{self._camera.url} has no light ring that can be driven")
            if colours is not None and len(colours) != self._camera.ring.led_count:
                raise InputError(
                    f"{len(colours)} colours, the ring has {self._camera.ring.led_count} LEDs: give one each"
                )
            if self.mode != "network":
                raise InputError(f"the sensor runs in mode {self.mode}, which changes the light all the time")
            self._set(Setting(controls={}, colours=self.bundle.colours if colours is None else colours))

    def change_mode(self, mode: str) -> None:
        """Go on in another mode: network or photometric. The sensor is lit as the bundle says, or as it needs.

        Raises InputError while a calibration goes on, for an unknown mode, and for a sensor whose mode is fixed;
        BundleError, CameraError or BoardError where the mode cannot be. Then it goes on as before.
        """
        with self._changing:
            if self._lent is not None:
                raise InputError("a calibration goes on, which sets the light: wait for its end, or stop it")
            if self._equipment is None or not isinstance(self._camera, SwitchedCamera):
                raise InputError(f"the mode of {self._camera.url} cannot be changed while it runs")
            if self._threads.ended:
                raise CameraError(f"{self._camera.url} was stopped: its LEDs stay dark")
            used = self._in_use
            new = self._equipment(used.bundle, mode)
            path = new.rebuild(used.bundle)
            watch = SensorWatch(used.bundle, rezero=new.rezero) if new.watched else None
            with self._threads.halted():
                self._camera.switch(new.equip, used.bundle.controls, used.bundle.colours)
                self._rebuild = new.rebuild
                self._in_use = replace(used, reconstructor=path, watch=watch)

    def rezero(self, *, asked: bool = True) -> None:
        """Set the zero of the depth to the gel as it is now; the stream goes on.

        asked: a person says that nothing touches; else it is the watch, for slow drift. Raises InputError, saying why,
        where the zero must not be set.
        """
        with self._changing:
            bundle, watch = self._in_use.bundle, self._in_use.watch
            if watch is None:
                raise InputError("this sensor is not watched, so its zero cannot be set: switch watch.enabled on")
            zero = watch.propose_zero(asked=asked)
            zeroed = bundle.with_reference(zero.reference, frames=bundle.manifest.reference_frames)
            self._in_use = replace(self._in_use, reconstructor=self._rebuild(zeroed))
            watch.accept_zero(zero)

    # ---- what comes out ----

    @property
    def captured(self) -> Mailbox[CameraFrame]:
        """The newest camera frame; `copied` gives them all."""
        return self._threads.captured

    @property
    def delivered(self) -> Mailbox[TactileFrame]:
        """The newest tactile frame; `copied` gives them all."""
        return self._threads.delivered

    def wait_frame(self, after_sequence: int, timeout_s: float) -> TactileFrame:
        """Wait for a tactile frame whose camera sequence number is greater than `after_sequence`.

        Raises TimeoutError, or what ended the run (`EndOfStream`
        when the images are used up).
        """
        deadline = time.monotonic() + timeout_s
        number = 0
        while True:
            number, frame = self._threads.delivered.take(number, max(deadline - time.monotonic(), 0.0))
            if frame.camera_frame.sequence > after_sequence:
                return frame

    def next_frame(self, after_sequence: int, timeout_s: float) -> TactileFrame:
        """Do as `wait_frame` for the one reader of a daemon with `every`: pictures of files wait for this call."""
        self.go_on_after(after_sequence)
        return self.wait_frame(after_sequence, timeout_s)

    def go_on_after(self, sequence: int) -> None:
        """Say that the one reader of a daemon with `every` has the frames up to this sequence number."""
        self._threads.note_asked(sequence)

    def check(self, frame: TactileFrame) -> SelfCheckResult | None:
        """Compare `frame` with the reference simulator now; None where the truth cannot be known."""
        judge = self._in_use.selfcheck
        if judge is None or frame.camera_frame.truth is None:
            return None
        self._selfcheck_result = judge.compare(frame)
        return self._selfcheck_result

    def touch(self) -> dict[str, object] | None:
        """Return what the newest frame feels, as `touch_of`; None before the first frame."""
        try:
            _, frame = self._threads.delivered.take(0, 0.0)
        except Exception:  # none is there yet, or the frames ended before one was
            return None
        return touch_of(frame)

    def status(self) -> dict[str, object]:
        """Return what is known of the sensor, ready for JSON.

        Keys: sensor (URL), frames, fps, frame_age_ms {median, p95}, dropped, lost, repeated, stage_ms {stage: ms},
        mode and what else the frame path says, selfcheck (None, or its figures by name, `passed`, and `bounds` by the
        same names), touch (see `touch_of`), calibration {sensor, identity, verified: None, or its errors on fresh
        presses, force: None, or its constant and errors}, watch (None, or see `SensorWatch.status`), error (text or
        None) and camera (what the camera says).
        """
        result, camera, used = self._selfcheck_result, self._camera.status(), self._in_use
        return {
            "sensor": self._camera.url,
            **used.reconstructor.status(),
            **self._threads.statistics.as_json(time.monotonic()),
            "selfcheck": result.as_json() if result else None,
            "touch": self.touch(),
            "calibration": {
                "sensor": used.bundle.manifest.sensor,
                "identity": used.bundle.identity,
                "verified": used.verified,
                "force": used.force,
            },
            "watch": used.watch.status() if used.watch else None,
            "error": self._threads.problem or camera.get("why"),
            "camera": camera,
        }

    def _watch_now_and_then(self, frame: TactileFrame) -> None:
        """Let the watch look at a frame, and let the zero follow slow drift."""
        watch = self.watch
        if watch is None:  # in this mode
            return
        watch.note(frame)
        with self._changing:  # nobody replaces the bundle or sets a zero between the question and the zero
            if self.watch is watch and not watch.refusal(asked=False):
                self.rezero(asked=False)
