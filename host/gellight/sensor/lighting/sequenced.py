"""A camera whose light follows a sequence, and whose frames know their light.

with SequencedCamera(camera, colour_triples(colours)) as sequenced:
    frame = sequenced.read()
    if frame.label.state is LightState.CLEAN: ... frame.label.group
"""

import logging
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import BoardError, CameraError, InputError
from gellight.frames.camera import Camera, CameraTiming, timing_of
from gellight.frames.camera_wrapper import CameraWrapper
from gellight.frames.frames import CameraFrame
from gellight.frames.status import CameraStatus
from gellight.ring import protocol
from gellight.ring.board_link import RefusedError
from gellight.ring.enumerations import State, Status, SyncMode
from gellight.ring.light_ring import LightRing, Step
from gellight.sensor.lighting.hold import expose
from gellight.sensor.lighting.label import UNKNOWN_LABEL
from gellight.sensor.lighting.light_watch import LightWatch
from gellight.sensor.lighting.lock import PhaseLock, Trim, hold_frames
from gellight.sensor.lighting.timeline import REPEAT_US

logger = logging.getLogger(__name__)
CLOCK_ERROR_S = 0.001
"""what the host is assumed to be off about the board's clock when the hold is chosen"""
EDGES_MISSED = 4  # chosen: strobes in a row that the board waits for in vain
TRIM_LIGHTS = 4
"""lights until a trim has taken effect"""


class LightMode(StrEnum):
    """What moves the light on."""

    HOLD = "hold"
    """every `read` shows the next group and waits for a frame of it: always clean, slow"""
    FREE = "free"
    """the board's clock, locked to the frames; frames come at the camera's rate and some are mixed"""
    EXT = "ext"
    """the strobe of the camera on the trigger pin of the board; no frame need be mixed"""


def clock_error_s(mode: LightMode) -> float:
    """Return what the host is assumed to be off about the time of a light when the hold is chosen."""
    return CLOCK_ERROR_S + (REPEAT_US * 1e-6 / 2 if mode is LightMode.EXT else 0.0)


class SequencedCamera(CameraWrapper):
    """Wraps a camera that has a ring; `read` gives its frames with their label. Closing it closes the camera."""

    def __init__(
        self, camera: Camera, groups: Sequence[NDArray[np.uint8]] | NDArray[np.uint8], *,
        mode: LightMode = LightMode.FREE, frames: int = 1, timing: CameraTiming | None = None,
    ) -> None:  # fmt: skip
        """Show `groups` (n, 12, 3) uint8 RGB in turn, each for the fewest frame periods that can do.

        `frames`: of each light that HOLD takes. `timing` is by default what `timing_of` tells. The edge of the strobe
        (EXT) is the start of the frame. Raises CameraError without a ring, BoardError where the board refuses,
        InputError for a number of groups that it cannot hold.
        """
        super().__init__(camera)
        if not 1 <= len(groups) <= protocol.GROUP_COUNT:
            raise InputError(f"{len(groups)} light groups: the board holds 1 to {protocol.GROUP_COUNT}")
        if camera.ring is None:
            raise CameraError(
                f"{camera.url} has no light ring to run a sequence on: connect the ring's board, or set "
                "reconstruction.mode = network without lighting.sequence"
            )
        self.mode = mode
        self.frames = frames
        self._given_timing = timing
        self._groups = [np.asarray(group, np.uint8) for group in groups]
        self._before = camera.ring.still
        self._counts = Counter[str]()
        self.watch: LightWatch | None = None
        self._started_on: LightRing | None = None
        self._next, self._sequence = 0, 0
        self._taken: list[CameraFrame] = []
        """of the group that HOLD shows"""
        self._start()

    def _start(self) -> None:
        """Begin the sequence on the ring as it is now."""
        ring = self.ring
        if ring is None:
            raise BoardError(f"{self.url} has lost its light ring: plug it in again")
        if ring.status().state == State.RUNNING:
            raise BoardError("the ring is running a sequence: stop the sequence before starting another one")
        self._timing = self._given_timing or timing_of(self._camera)
        self._trim, self._trimmed_light = Trim(0, 0.0), -TRIM_LIGHTS
        if self.mode is not LightMode.HOLD:
            self._run(ring)
        self._started_on = ring

    def _run(self, ring: LightRing) -> None:
        """Load the sequence and start it, in FREE mode with the period of the camera."""
        free, error_s = self.mode is LightMode.FREE, clock_error_s(self.mode)
        self.frames = hold_frames(self._timing, clock_error_s=error_s, leds=ring.led_count)
        self._lock = PhaseLock(self._timing, frames=self.frames, leds=ring.led_count)
        period_s = self._learn_period_s() if free else self._timing.period_s
        self._lock.dwell_us = max(round(self.frames * period_s * 1e6), protocol.DWELL_MIN_US)
        steps = [Step(group=k, dwell_us=self._lock.dwell_us if free else 0) for k in range(len(self._groups))]
        if free:
            ring.set_sync(SyncMode.FREE)
        else:
            missed_us = round(EDGES_MISSED * self.frames * self._timing.period_s * 1e6)
            delay_us = round(self._strobe_to_change_s() * 1e6)
            ring.set_sync(SyncMode.EXT, divider=self.frames, timeout_us=missed_us, delay_us=delay_us)
        ring.load_sequence(self._groups, steps)
        self._unwatch()
        self.watch = LightWatch(ring, self._timing, plan=self._planned_us if free else None)
        ring.start()

    def _strobe_to_change_s(self) -> float:
        """From the edge of the strobe to the next light, which may show from `REPEAT_US` before to a pulse after it.

        That lies in the middle between two frames, and where there is little room, as soon as the first surely is over.
        """
        timing = self._timing
        to_end_s = timing.duration_s + timing.stamp_delay_s
        least_s = timing.stamp_error_s + CLOCK_ERROR_S + REPEAT_US * 1e-6
        dark_s = timing.period_s - timing.duration_s
        return to_end_s + max(least_s, (dark_s + REPEAT_US * 1e-6 - timing.pulse_period_s) / 2)

    def _unwatch(self) -> None:
        watch, self.watch = self.watch, None
        if watch is not None:
            watch.close()

    def _learn_period_s(self) -> float:
        """Look at some frames: a sequence that is to be locked has to have nearly the camera's period."""
        while not self._lock.ready:
            frame = self._camera.read()
            self._lock.note_frame(frame.sequence, frame.time_s)
        _, period_s = self._lock.line()
        replace(self._timing, period_s=period_s)  # refuses an exposure that is longer
        return period_s

    def _planned_us(self, _last: protocol.LightEvent, event: protocol.LightEvent) -> float | None:
        """How long after the last light one was to begin; a few lights may have been planned before a trim or after."""
        if event.light_id <= self._trimmed_light + TRIM_LIGHTS:
            return None
        return self._lock.dwell_us * (1 + self._trim.period)

    # ---- a camera like every other ----

    def read(self) -> CameraFrame:
        """Return the next frame with its label; what the camera and the board raise comes through.

        A sensor that was unplugged has another ring when it is back: the sequence begins anew on that.
        """
        with self._alone():
            ring = self.ring
            try:
                frame = self._held() if self.mode is LightMode.HOLD else self._labelled()
            except BoardError as error:
                raise self._why_failed(error, ring) from error
        label = frame.label
        assert label is not None
        self._counts[label.state] += 1
        return replace(frame, light=None if label.group is None else self._groups[label.group])

    def _held(self) -> CameraFrame:
        """Return the next frame of the group that is shown, then show the next one; what fails begins anew."""
        if not self._taken:
            group, self._next = self._next, 0
            colours, timing = self._groups[group], self._timing
            self._taken = [*expose(self._camera, colours, group, timing=timing, frames=self.frames)]
            self._next = (group + 1) % len(self._groups)
        self._sequence += 1  # what was passed over between two lights is not lost
        return replace(self._taken.pop(0), sequence=self._sequence)

    def _labelled(self) -> CameraFrame:
        """Take the next frame and label it; begin the sequence anew where its ring is no longer the one there."""
        frame = self._camera.read()
        if self.ring is not self._started_on:
            self._start()
            frame = self._camera.read()
        assert self.watch is not None
        assert self._started_on is not None
        label = UNKNOWN_LABEL if frame.estimated else self.watch.label(frame.time_s, self.image_shape[0])
        frame = replace(frame, label=label)
        if self.watch.silenced():  # this program was held up, and the board ended the sequence
            logger.warning(
                "the board heard nothing from here and ended its sequence (machine busy?); it is started again"
            )
            self._started_on.start()
            self._trim = Trim(0, 0.0)  # a start forgets the trim
        elif self.mode is LightMode.FREE and not frame.estimated:
            self._steer(frame)
        return frame

    def adopt(self, controls: Mapping[str, float], colours: NDArray[np.uint8] | None) -> None:
        """Set the camera inside, and give this light back later; the sequence begins anew with the next frame."""
        with self._alone():
            self._end()
            self._camera.adopt(controls, colours)
            self._before = colours

    def _steer(self, frame: CameraFrame) -> None:
        """Keep the changes of the light between the frames."""
        assert self.watch is not None
        self._lock.note_frame(frame.sequence, frame.time_s)
        changes = self.watch.changes()
        trim = self._lock.trim(changes[-1].latched_s, self.watch.clock.drift) if changes else None
        if trim is None:
            return
        assert self._started_on is not None
        try:
            self._started_on.trim(phase_us=trim.phase_us, period=trim.period)
        except RefusedError as error:
            if error.status is not Status.NOT_RUNNING:
                raise
            return  # another thread has just ended the sequence, and no light of it is left to be moved
        self._trimmed_light = changes[-1].light_id
        self._trim = trim
        self._counts["trims"] += 1

    def status(self) -> CameraStatus:
        """Return what is known of the camera inside, and what became of the frames of the sequence."""
        return {
            **super().status(),
            "light_sequence": {
                "light_mode": str(self.mode), "groups": len(self._groups), "frames_per_light": self.frames,
                "clean": self._counts["clean"], "mixed": self._counts["mixed"], "unknown": self._counts["unknown"],
                "trims": self._counts["trims"],
            },
        }  # fmt: skip

    @property
    def timing(self) -> CameraTiming:
        """Exposure, readout and period that the labels go by."""
        return self._timing

    def release(self) -> None:
        """End the sequence; see `stop`."""
        self.stop()

    def stop(self) -> None:
        """End the sequence and give back the light of before (dark if there was none); the camera stays open."""
        with self._alone():
            self._end()
            if self.ring is not None:
                self.ring.light(self._before)

    def _end(self) -> None:
        """End the sequence; the next `read` starts it again."""
        self._unwatch()
        self._started_on, self._next, self._taken = None, 0, []
        if self.ring is not None:
            self.ring.blank()
