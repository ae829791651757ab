"""The running sensor: a capture thread, a reconstruction thread, and between them a mailbox that keeps the latest.

The camera never waits for the reconstruction: a frame that is not taken in time is replaced by a newer one and counted
as dropped, so what comes out is as fresh as the machine allows. What ends either thread (the last image of a folder, a
camera that fails) is raised where frames are waited for. A sensor that was unplugged ends nothing: while it is away the
status says so, and nobody gets a frame from before.
"""

import logging
import threading
import time
from collections.abc import Callable
from types import TracebackType
from typing import Self

from gellight.base.errors import CameraError, InputError
from gellight.base.mailbox import Mailbox
from gellight.bundle.bundle import Bundle
from gellight.daemon.shared_camera import SharedCamera
from gellight.daemon.statistics import Statistics
from gellight.frames.camera import Camera, EndOfStream, PressStage, ReconnectingError
from gellight.frames.frames import CameraFrame, TactileFrame
from gellight.frames.judging import FrameJudge, SelfCheckResult
from gellight.reconstruction.pipeline import FramePath, Reconstructor
from gellight.watch.monitor import PERIOD_S, Watch

logger = logging.getLogger(__name__)

POLL_S = 0.5
"""how often a waiting thread looks whether it should stop"""
SELFCHECK_PERIOD_S = 1.0
PAUSED_S = 0.3
"""between two frames while somebody else rules the light"""


class Daemon:
    """Runs a camera and a reconstructor; a context manager that stops its threads and closes the camera."""

    def __init__(
        self,
        camera: Camera,
        reconstructor: FramePath,
        *,
        selfcheck: FrameJudge | None = None,
        rebuild: Callable[[Bundle], FramePath] = Reconstructor,
        watch: Watch | None = None,
    ) -> None:
        """Take over `camera` (it is closed at the end); `selfcheck` judges frames that carry their truth.

        `rebuild` makes the reconstructor of a bundle that replaces the running one. `watch` looks at what comes and
        says what has changed since the calibration.
        """
        self._camera = camera
        self._reconstructor = reconstructor
        self._rebuild = rebuild
        self._bundle = reconstructor.bundle
        self._watch = watch
        self._paused = False
        self._replacing = threading.RLock()
        """held while the reconstructor is replaced"""
        self._selfcheck = selfcheck
        self._selfcheck_result: SelfCheckResult | None = None
        self._statistics = Statistics()
        self._captured: Mailbox[CameraFrame] = Mailbox()
        self._delivered: Mailbox[TactileFrame] = Mailbox()
        self._stopping = threading.Event()
        self._error: str | None = None
        self._away: str | None = None
        self._newest = self._void = -1
        """camera sequence numbers: the last that came, and the last from before the sensor was away"""
        self._presence = threading.Lock()
        """held while a frame is handed on or the sensor is found to be away"""
        jobs = [self._capture, self._reconstruct]
        jobs += [self._check_now_and_then] if selfcheck else []
        jobs += [self._watch_now_and_then] if watch else []
        self._threads = [threading.Thread(target=job, name=job.__name__.strip("_"), daemon=True) for job in jobs]

    def __enter__(self) -> Self:
        """Start the threads."""
        for thread in self._threads:
            thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Stop the threads and close the camera."""
        self._stopping.set()
        self._delivered.close(CameraError("the daemon was stopped"))
        for thread in self._threads:
            thread.join()
        self._camera.close()

    @property
    def stage(self) -> PressStage | None:
        """Where objects can be pressed into the gel, if the camera offers that."""
        return self._camera.stage

    @property
    def pixel_size_mm(self) -> tuple[float, float]:
        """(x, y) size of a camera pixel on the gel."""
        return self._reconstructor.bundle.pixel_size_mm

    @property
    def mode(self) -> str:
        """How slopes are found: network, photometric or hybrid."""
        return str(self._reconstructor.status()["mode"])

    @property
    def bundle(self) -> Bundle:
        """The bundle in use, as it was installed: a zero that followed the light is not in it."""
        return self._bundle

    @property
    def camera(self) -> Camera:
        """The camera as another reader sees it: its newest frames, controls and ring; closing it does nothing."""
        return SharedCamera(self._camera, self._captured)

    @property
    def watch(self) -> Watch | None:
        """What watches for changes since the calibration; another one after the calibration was replaced."""
        return self._watch

    def replace_bundle(self, bundle: Bundle) -> None:
        """Reconstruct with another bundle from the next frame on; the stream goes on.

        Raises BundleError for a bundle of another image size or with a network that cannot be run, and what the
        camera raises that cannot be set as the bundle says; then the old one stays in use.
        """
        bundle.check_fits(self._camera.url, self._camera.image_shape)
        replacement = self._rebuild(bundle)
        watch = Watch(bundle, rezero=self._watch.rezero) if self._watch else None
        judge = self._camera.selfcheck(bundle.pixel_size_mm) if self._selfcheck else None
        with self._replacing:
            self._camera.adopt(bundle.controls, bundle.colours)
            if watch and self._watch:
                watch.paused = self._watch.paused
            self._reconstructor, self._bundle, self._watch, self._selfcheck = replacement, bundle, watch, judge

    def pause(self, paused: bool) -> None:
        """Let somebody else rule the light: the watch rests, and no more than some frames a second are reconstructed.

        What is felt under another light means nothing, and whoever calibrates needs the processor.
        """
        with self._replacing:
            self._paused = paused
            if self._watch is not None:
                self._watch.paused = paused

    def rezero(self, *, asked: bool = True) -> None:
        """Set the zero of the depth to the gel as it is now; the stream goes on.

        asked: a person says that nothing touches; else it is the watch, for slow drift. Raises InputError, saying why,
        where the zero must not be set.
        """
        with self._replacing:
            if self._watch is None:
                raise InputError("this sensor is not watched, so its zero cannot be set: switch watch.enabled on")
            zero = self._watch.propose_zero(asked=asked)
            zeroed = self._bundle.with_reference(zero.reference, frames=self._bundle.manifest.reference_frames)
            self._reconstructor = self._rebuild(zeroed)
            self._watch.accept_zero(zero)

    @property
    def selfcheck_result(self) -> SelfCheckResult | None:
        """The newest comparison with the reference simulator; None before the first, or without truth."""
        return self._selfcheck_result

    def wait_frame(self, after_sequence: int, timeout_s: float) -> TactileFrame:
        """Wait for a tactile frame whose camera sequence number is greater than `after_sequence`.

        Raises TimeoutError, or what ended the run (`EndOfStream` when the images are used up).
        """
        deadline = time.monotonic() + timeout_s
        number = 0
        while True:
            number, frame = self._delivered.take(number, max(deadline - time.monotonic(), 0.0))
            if frame.camera_frame.sequence > after_sequence:
                return frame

    def check(self, frame: TactileFrame) -> SelfCheckResult | None:
        """Compare `frame` with the reference simulator now; None where the truth cannot be known."""
        if self._selfcheck is None or frame.camera_frame.truth is None:
            return None
        self._selfcheck_result = self._selfcheck.compare(frame)
        return self._selfcheck_result

    def status(self) -> dict[str, object]:
        """Counters, rates and the self-check, ready for JSON."""
        result, camera = self._selfcheck_result, self._camera.status()
        return {
            "sensor": self._camera.url,
            **self._reconstructor.status(),
            **self._statistics.as_json(time.monotonic()),
            "selfcheck": result.as_json() if result else None,
            "calibration": {"sensor": self._bundle.manifest.sensor, "identity": self._bundle.identity},
            "watch": self._watch.status() if self._watch else None,
            "error": self._error or self._away or camera.get("why"),
            "camera": camera,
        }

    def _capture(self) -> None:
        try:
            while not self._stopping.is_set():
                try:
                    frame = self._camera.read()
                except ReconnectingError as error:
                    self._leave(str(error))
                    continue
                self._away, self._newest = None, frame.sequence
                self._statistics.note_captured(frame)
                self._captured.put(frame)
        except Exception as error:
            self._note(error)
            self._captured.close(error)

    def _reconstruct(self) -> None:
        number = 0
        try:
            while not self._stopping.wait(PAUSED_S if self._paused else 0):
                try:
                    number, frame = self._captured.take(number, POLL_S)
                except TimeoutError:
                    continue
                self._deliver(self._reconstructor.reconstruct(frame))
        except Exception as error:
            self._note(error)
            self._delivered.close(error)
            self._stopping.set()

    def _leave(self, why: str) -> None:
        """Note that the sensor is away, and throw away what was not taken yet: it is not true any more."""
        with self._presence:
            if self._away is None:
                logger.warning("%s", why)
            self._away, self._void = why, self._newest
            self._captured.clear()
            self._delivered.clear()

    def _deliver(self, frame: TactileFrame) -> None:
        with self._presence:
            if frame.camera_frame.sequence > self._void:
                self._statistics.note_delivered(frame, time.monotonic())
                self._delivered.put(frame)

    def _check_now_and_then(self) -> None:
        number = 0
        while not self._stopping.wait(SELFCHECK_PERIOD_S):
            try:
                number, frame = self._delivered.take(number, POLL_S)
                self.check(frame)
            except TimeoutError:
                continue
            except Exception as error:
                self._note(error)
                return

    def _watch_now_and_then(self) -> None:
        number = 0
        while not self._stopping.wait(PERIOD_S):
            watch = self._watch
            assert watch is not None
            try:
                number, frame = self._delivered.take(number, POLL_S)
                watch.note(frame)
                if not watch.refusal(asked=False):
                    self.rezero(asked=False)
            except TimeoutError:
                continue
            except Exception as error:
                self._note(error)
                return

    def _note(self, error: Exception) -> None:
        if isinstance(error, EndOfStream) or self._stopping.is_set():
            return
        logger.error("%s: %s", threading.current_thread().name, error)
        self._error = str(error)
