"""Cameras that drive the light ring: what they deliver are series of exposures, or frames with a series now and then.

Both wrap the camera of a sensor and stand in for it. The frames that were spent on changing the light are not counted
as lost: the sequence numbers go on as if the camera had rested meanwhile.
"""

import time
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import BoardError, CameraError
from gellight.frames.camera import Camera, ReconnectingError
from gellight.frames.camera_wrapper import CameraWrapper
from gellight.frames.frames import CameraFrame, ExposureSeries
from gellight.reconstruction.photometric.static_scene import BLOCK_PX, repetition_limit
from gellight.reconstruction.pixel_grid import block_means
from gellight.sensor.lighting.hold import Hold
from gellight.sensor.set_and_light import set_and_settle

EXPOSURE = "exposure_us"
LOOK_EVERY = 5
"""frames between two looks at whether the scene rests"""
LOOKS_AT_REST = 3
"""so many looks in a row without a change are a scene at rest"""
MEASURE_EVERY_S = 10.0
"""from the end of one series to the next: what the stream pauses for stays a small share"""


class RingCamera(CameraWrapper):
    """A camera whose ring it lights; base of those below."""

    def __init__(self, camera: Camera, groups: NDArray[np.uint8], *, exposure_us: float | None, frames: int) -> None:
        """Take over `camera`, and light `groups` (G, 12, 3) uint8 in turn, `frames` of each, exposed `exposure_us`.

        Without `exposure_us` the exposure is left as it is. Raises CameraError for a camera without a light ring.
        """
        super().__init__(camera)
        if camera.ring is None:
            raise CameraError(
                f"{camera.url} has no light ring that can be driven, and photometric stereo needs one light after the "
                "other: connect the ring's board, or use --mode network"
            )
        self._groups = groups
        self._frames = frames
        self._bright_us = exposure_us
        self._skipped = 0

    def adopt(self, controls: Mapping[str, float], colours: NDArray[np.uint8] | None) -> None:
        """Set and light the camera inside, between two series."""
        with self._alone():
            super().adopt(controls, colours)
            self._forget()

    def _forget(self) -> None:
        """Begin anew: another light was on, or another exposure was set."""

    def _expose(self, hold: Hold, index: int) -> tuple[CameraFrame, ...]:
        """Take the frames of one group; the light stays on after that."""
        return hold.expose(self._groups[index], index, self._frames)

    def _set_exposure(self, exposure_us: float | None) -> float | None:
        """Set it, wait until frames show it, and return what holds now; None where the camera does not tell."""
        controls = self.controls
        if controls is None or EXPOSURE not in controls.names():
            return None
        if exposure_us is not None:
            set_and_settle(self._camera, {EXPOSURE: exposure_us})
        return controls.read(EXPOSURE)

    def _numbered(self, frame: CameraFrame) -> int:
        return frame.sequence - self._skipped


class SeriesCamera(RingCamera):
    """Delivers one series of exposures after the other; the repetition of the first light opens the next series."""

    _hold: Hold | None = None
    _next: CameraFrame | None = None
    _exposure_us: float | None = None
    _taken = 0
    """series so far, which is how they are numbered"""

    def read(self) -> ExposureSeries:
        """Take the exposures of all groups; raises what they raise, ReconnectingError while the sensor is away."""
        with self._alone():
            if self.ring is None:
                self._camera.read()  # raises ReconnectingError while the sensor is away
            ring = self.ring
            try:
                return self._take()
            except ReconnectingError:
                self._forget()
                raise
            except BoardError as error:
                self._forget()
                raise self._why_failed(error, ring) from error

    def _forget(self) -> None:
        self._hold = self._next = None

    def _take(self) -> ExposureSeries:
        if self._hold is None:
            self._exposure_us = self._set_exposure(self._bright_us)
            self._hold = Hold(self._camera).__enter__()
        hold = self._hold
        first = (self._next,) if self._next and self._frames == 1 else self._expose(hold, 0)
        opening = first[0]
        frames = (first, *(self._expose(hold, index) for index in range(1, len(self._groups))))
        self._next = closing = hold.expose(self._groups[0], 0)[0]
        self._taken += 1
        return as_series(opening, closing, frames, self._groups, number=self._taken, exposure_us=self._exposure_us)

    def release(self) -> None:
        """Give the ring back."""
        hold, self._hold = self._hold, None
        if hold is not None:
            hold.__exit__()

    def close(self) -> None:
        """Give the ring back and close the camera."""
        self.release()
        super().close()


class RestingCamera(RingCamera):
    """Delivers the frames of its camera, and a series when the scene rests and something touches the gel.

    A series opens and closes with a frame under the light of the stream, by which motion is found out. While it is
    taken no other frame comes: some two periods of the camera for each exposure.
    """

    def __init__(
        self, camera: Camera, groups: NDArray[np.uint8], *, exposure_us: float | None, frames: int,
        untouched: NDArray[np.float32], noise_grey: float,
    ) -> None:  # fmt: skip
        """As the base; `untouched` (H, W, 3) is the reference image, `noise_grey` that of a pixel of one frame."""
        super().__init__(camera, groups, exposure_us=exposure_us, frames=frames)
        self._untouched = _small(untouched)
        self._limit = repetition_limit(noise_grey) * 2
        """the picture is thinned out by 2 in both directions, which leaves a quarter of the pixels in a block"""
        self._seen = self._untouched
        self._looks_at_rest = 0
        self._read = 0
        self._due_s = time.monotonic()

    def read(self) -> CameraFrame:
        """Return the next frame, or a series; raises what camera and ring raise."""
        frame = self._camera.read()
        self._read += 1
        if self._read % LOOK_EVERY == 0:
            self._look(frame)
        if self._looks_at_rest < LOOKS_AT_REST or time.monotonic() < self._due_s:
            return replace(frame, sequence=self._numbered(frame))
        with self._alone():
            ring = self.ring
            try:
                series = self._series(frame)
            except BoardError as error:
                raise self._why_failed(error, ring) from error
        self._due_s = time.monotonic() + MEASURE_EVERY_S
        return series

    def _look(self, frame: CameraFrame) -> None:
        small = _small(frame.image)
        moved = np.abs(small - self._seen).max() > self._limit
        touched = np.abs(small - self._untouched).max() > self._limit
        self._seen = small
        self._looks_at_rest = 0 if moved or not touched else self._looks_at_rest + 1

    def _series(self, opening: CameraFrame) -> ExposureSeries:
        before = self._set_exposure(None)
        whole_ring = self.ring.still if self.ring else None
        if whole_ring is None:
            raise CameraError(f"{self.url} streams without a still light: set one before hybrid mode starts")
        try:
            held = self._set_exposure(self._bright_us)
            with Hold(self._camera) as hold:
                frames = tuple(self._expose(hold, index) for index in range(len(self._groups)))
        finally:
            self._set_exposure(before)
        with Hold(self._camera) as hold:
            closing = hold.expose(whole_ring, len(self._groups))[0]
        number = self._numbered(opening)
        self._skipped += closing.sequence - opening.sequence
        return as_series(opening, closing, frames, self._groups, number=number, exposure_us=held)


def as_series(
    opening: CameraFrame, closing: CameraFrame, frames: tuple[tuple[CameraFrame, ...], ...],
    groups: NDArray[np.uint8], *, number: int, exposure_us: float | None,
) -> ExposureSeries:  # fmt: skip
    """Put frames together; what the series shows as a camera frame is `opening`, with the sequence number `number`."""
    opening = replace(opening, sequence=number)
    return ExposureSeries(
        **vars(opening), groups=groups, frames=frames, opening=opening, closing=closing, exposure_us=exposure_us
    )


def _small(image: NDArray[np.uint8] | NDArray[np.float32]) -> NDArray[np.float32]:
    """(H / 16, W / 16, 3) means over blocks of every other pixel."""
    return block_means(image[::2, ::2], BLOCK_PX)
