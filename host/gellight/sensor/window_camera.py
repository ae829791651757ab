"""A sliding window over the frames of a light sequence: every clean frame gives a series of exposures of all lights."""

import time
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import CameraError
from gellight.frames.camera import ReconnectingError
from gellight.frames.camera_wrapper import CameraWrapper
from gellight.frames.frames import CameraFrame, ExposureSeries, LightState
from gellight.sensor.lighting.sequenced import LightMode, SequencedCamera
from gellight.sensor.series_cameras import EXPOSURE

PATIENCE_S = 10.0
"""a sequence without a whole window for longer does not work"""
REMEDIES = {
    LightMode.FREE: "set lighting.light_mode = hold, a shorter exposure, or a less busy computer",
    LightMode.EXT: "connect the camera's strobe to the trigger pin of the board, or set lighting.light_mode = free",
    LightMode.HOLD: "see `gellight ring info`",
}


class WindowCamera(CameraWrapper):
    """Delivers a series for each clean frame: that frame, and the newest one of every other light group.

    The series opens with the last frame under the same light, one turn of the sequence earlier, by which motion inside
    the window is found. As a camera frame it is the newest frame. Frames that saw two lights are passed over; they do
    not count as lost.
    """

    def __init__(self, camera: SequencedCamera, groups: NDArray[np.uint8], *, exposure_us: float | None) -> None:
        """Take over `camera`, which shows `groups` (G, 12, 3) uint8, exposed `exposure_us` where that can be set."""
        super().__init__(camera)
        self._sequence = camera
        self._groups, self._exposure_us = groups, exposure_us
        self._mode = camera.mode
        self._skipped = 0
        self._begin()

    def _begin(self) -> None:
        self._newest: dict[int, CameraFrame] = {}
        """by light group"""
        self._turn_before: dict[int, CameraFrame] = {}
        """by light group: the last frame of the turn before"""
        self._last = -1
        """light group of the frame before"""

    def adopt(self, controls: Mapping[str, float], colours: NDArray[np.uint8] | None) -> None:
        """Set the camera inside, but for the exposure, which is that of the window; the window begins anew."""
        if self._exposure_us is not None:
            controls = {**controls, EXPOSURE: self._exposure_us}
        with self._alone():
            super().adopt(controls, colours)
            self._begin()

    def release(self) -> None:
        """End the sequence."""
        self._sequence.release()

    def read(self) -> ExposureSeries:
        """Return the next window; raises what the camera raises, and CameraError where no whole window comes."""
        given_up_s = time.monotonic() + PATIENCE_S
        while True:
            try:
                frame = self._camera.read()
            except ReconnectingError:
                self._begin()
                raise
            with self._alone():
                series = self._series(frame)
            if series is not None:
                return series
            self._skipped += 1
            if time.monotonic() > given_up_s:
                raise CameraError(
                    f"{self.url}: no frame of each light within {PATIENCE_S:g} s ({self.status()['light_sequence']}): "
                    f"{REMEDIES[self._mode]}"
                )

    def _series(self, frame: CameraFrame) -> ExposureSeries | None:
        """Return the series that ends with `frame`; None where a light is missing from it."""
        label = frame.label
        if label is None or label.state is not LightState.CLEAN or label.group is None:
            return None
        group = label.group
        if group != self._last and group in self._newest:
            self._turn_before[group] = self._newest[group]
        self._newest[group], self._last = frame, group
        opening = self._turn_before.get(group)
        if opening is None or len(self._newest) < len(self._groups):
            return None
        if any(other.time_s < opening.time_s for other in self._newest.values()):
            return None  # a light of this turn was missed
        shown = {**vars(frame), "sequence": frame.sequence - self._skipped}
        return ExposureSeries(
            **shown, groups=self._groups, frames=tuple((self._newest[k],) for k in range(len(self._groups))),
            opening=opening, closing=frame, exposure_us=self._exposure_us,
        )  # fmt: skip
