"""Series of exposures, one under each light, from the frames of a light sequence."""

import time
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import BoardError, CameraError
from gellight.frames.camera import ReconnectingError
from gellight.frames.camera_wrapper import CameraWrapper
from gellight.frames.frames import CameraFrame, ExposureSeries
from gellight.sensor.lighting.sequenced import LightMode, SequencedCamera

EXPOSURE = "exposure_us"
PATIENCE_S = 10.0
"""a sequence without a whole window for longer does not work"""
REMEDIES = {
    LightMode.FREE: "set lighting.light_mode = hold, a shorter exposure, or a less busy computer",
    LightMode.EXT: "connect the camera's strobe to the trigger pin of the board, or set lighting.light_mode = free",
}


class SeriesCamera(CameraWrapper):
    """Delivers series of exposures that a repetition of the first light closes, by which motion is found.

    Where the sequence stops at each light (HOLD), a series is one turn of it, and its repetition opens the next. Else
    each clean frame gives a series: a window of that frame and the newest one of every other light, which opens with
    the last frame under the same light, one turn earlier. Frames that saw two lights are passed over; they do not count
    as lost.
    """

    def __init__(self, camera: SequencedCamera, groups: NDArray[np.uint8], *, exposure_us: float | None) -> None:
        """Take over `camera`, which shows `groups` (G, 12, 3) uint8, exposed `exposure_us` where that can be set."""
        super().__init__(camera)
        self._sequence = camera
        self._groups, self._exposure_us = groups, exposure_us
        self._skipped = 0
        self._begin()

    def _begin(self) -> None:
        self._newest: dict[int, tuple[CameraFrame, ...]] = {}
        """by light group"""
        self._turn_before: dict[int, CameraFrame] = {}
        """by light group: the last frame of the turn before"""
        self._last = -1
        """light group of the frame before"""

    def adopt(self, controls: Mapping[str, float], colours: NDArray[np.uint8] | None) -> None:
        """Set the camera inside, but for the exposure, which is that of the series; the next one begins anew."""
        if self._exposure_us is not None:
            controls = {**controls, EXPOSURE: self._exposure_us}
        with self._alone():
            super().adopt(controls, colours)
            self._begin()

    def release(self) -> None:
        """End the sequence."""
        self._sequence.release()

    def read(self) -> ExposureSeries:
        """Return the next series; raises what the camera raises, and CameraError where no whole window comes."""
        given_up_s = time.monotonic() + PATIENCE_S
        while True:
            with self._alone():
                series = self._next()
            if series is not None:
                return series
            self._skipped += 1
            if self._sequence.mode in REMEDIES and time.monotonic() > given_up_s:
                raise CameraError(
                    f"{self.url}: no frame of each light within {PATIENCE_S:g} s ({self.status()['light_sequence']}): "
                    f"{REMEDIES[self._sequence.mode]}"
                )

    def _next(self) -> ExposureSeries | None:
        """Return the series that ends with the next frame, None where it ends none."""
        try:
            frame = self._camera.read()
        except (ReconnectingError, BoardError):
            self._begin()
            raise
        if frame.label is None or frame.label.group is None:
            return None
        take = self._turn if self._sequence.mode is LightMode.HOLD else self._window
        return take(frame, frame.label.group)

    def _turn(self, frame: CameraFrame, group: int) -> ExposureSeries | None:
        """Return the turn that the first frame of the next one closes."""
        taken = self._newest
        if group == 0 and len(taken) == len(self._groups):
            self._newest = {0: (frame,)}
            opening = taken[0][0]
            return self._series(opening, opening, frame, taken)
        taken[group] = (*taken.get(group, ()), frame)
        return None

    def _window(self, frame: CameraFrame, group: int) -> ExposureSeries | None:
        """Return the window that ends with a frame, unless a light is missing from it."""
        if group != self._last and group in self._newest:
            (self._turn_before[group],) = self._newest[group]
        self._newest[group], self._last = (frame,), group
        opening = self._turn_before.get(group)
        if opening is None or len(self._newest) < len(self._groups):
            return None
        if any(other.time_s < opening.time_s for (other,) in self._newest.values()):
            return None  # a light of this turn was missed
        return self._series(frame, opening, frame, self._newest)

    def _series(
        self, shown: CameraFrame, opening: CameraFrame, closing: CameraFrame, taken: dict[int, tuple[CameraFrame, ...]]
    ) -> ExposureSeries:
        """Put frames together; `shown` is what the series is as a camera frame."""
        same = {**vars(shown), "sequence": closing.sequence - self._skipped}
        return ExposureSeries(
            **same, groups=self._groups, frames=tuple(taken[k] for k in range(len(self._groups))),
            opening=opening, closing=closing, exposure_us=self._exposure_us,
        )  # fmt: skip
