"""A camera that drives the light ring: what it delivers are series of exposures, one light after the other."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import BoardError, CameraError
from gellight.frames.camera import Camera, ReconnectingError
from gellight.frames.camera_wrapper import CameraWrapper
from gellight.frames.frames import CameraFrame, ExposureSeries
from gellight.sensor.lighting.hold import Hold
from gellight.sensor.set_and_light import set_and_settle

EXPOSURE = "exposure_us"


class SeriesCamera(CameraWrapper):
    """Delivers one series of exposures after the other; the repetition of the first light opens the next series."""

    _hold: Hold | None = None
    _next: CameraFrame | None = None
    _exposure_us: float | None = None
    _taken = 0
    """number of the last series"""

    def __init__(self, camera: Camera, groups: NDArray[np.uint8], *, exposure_us: float | None, frames: int) -> None:
        """Take over `camera`, and light `groups` (G, 12, 3) uint8 in turn, `frames` of each, exposed `exposure_us`.

        Without `exposure_us` the exposure is left as it is. Raises CameraError for a camera without a light ring.
        """
        super().__init__(camera)
        if camera.ring is None:
            raise CameraError(
                f"{camera.url} has no light ring that can be driven, and photometric stereo needs one light after the "
                "other: connect the ring's board, or set reconstruction.mode = network"
            )
        self._groups = groups
        self._frames = frames
        self._bright_us = exposure_us

    def adopt(self, controls: Mapping[str, float], colours: NDArray[np.uint8] | None) -> None:
        """Set and light the camera inside, between two series."""
        with self._alone():
            super().adopt(controls, colours)
            self._forget()

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
        """Begin anew: another light was on, or another exposure was set."""
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


def as_series(
    opening: CameraFrame, closing: CameraFrame, frames: tuple[tuple[CameraFrame, ...], ...],
    groups: NDArray[np.uint8], *, number: int, exposure_us: float | None,
) -> ExposureSeries:  # fmt: skip
    """Put frames together; what the series shows as a camera frame is `opening`, with the sequence number `number`."""
    opening = replace(opening, sequence=number)
    return ExposureSeries(
        **vars(opening), groups=groups, frames=frames, opening=opening, closing=closing, exposure_us=exposure_us
    )
