"""Simulated touches as the frames of a recording, which the writers of `gellight.recording` take."""

from collections.abc import Iterable, Iterator

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import InputError
from gellight.frames.frames import CameraFrame, TactileFrame
from gellight.frames.measures import Confidence, Force
from gellight.frames.shear import DotsSeen
from gellight.reconstruction.confidence import confidence_of
from gellight.reconstruction.stages import Stages, tactile_frame
from gellight_touch.layer import Floats
from gellight_touch.touch_sensor import Felt, TouchSensor


def tactile_frames(sensor: TouchSensor, touches: Iterable[Felt], *, fps: float) -> Iterator[TactileFrame]:
    """Yield a tactile frame of each touch, `fps` a second from 0 s on.

    Depth and force are those of the layer; the contact is found in the depth, as that of a real sensor is. The noise of
    the pictures is the sensor's next. Raises InputError for a rate that is not above 0.
    """
    if not 0 < fps < np.inf:
        raise InputError(f"{fps:g} frames a second: give a number above 0")
    size_mm = (sensor.geometry.pixel_size_mm,) * 2
    rest: NDArray[np.float32] | None = None
    for number, felt in enumerate(touches):
        if rest is None:
            rest = sensor.grey(_nothing(felt)).astype(np.float32)
        depth_mm, right, down = (part.astype(np.float32) for part in sensor.surface(felt))
        taken = CameraFrame(image=sensor.picture(felt), time_s=number / fps, sequence=number)
        gradient = np.stack([right, down], axis=-1)
        known = _Known(rest, sensor, felt)
        yield tactile_frame(taken, taken.image - rest, gradient, depth_mm, size_mm, Stages(), measures=known)


def _nothing(felt: Felt) -> Felt:
    return Felt(np.zeros_like(felt.pressure_mpa), np.zeros_like(felt.depth_mm), felt.at_mm)


class _Known:
    """The force is the layer's; nothing else is known of a simulated frame."""

    from_network = False

    def __init__(self, untouched: Floats, sensor: TouchSensor, felt: Felt) -> None:
        self._untouched, self._sensor, self._felt = np.asarray(untouched, np.float32), sensor, felt

    def force(self, depth_mm: NDArray[np.float32]) -> Force:
        """Return the force of the layer, which is exact in the simulation."""
        return Force(
            normal_n=self._felt.force_n, error_n=0.0, pressure_of=lambda: self._sensor.pressure_map_mpa(self._felt)
        )

    def shear(self, depth_mm: NDArray[np.float32], dots: DotsSeen, force: Force | None) -> None:
        """There are no dots."""

    def dot_motion(self, depth_mm: NDArray[np.float32], dots: DotsSeen) -> None:
        """There are no dots."""

    def confidence(self, image: NDArray[np.uint8], gradient_map: NDArray[np.float32]) -> Confidence:
        """Judge the pixels by their light."""
        return confidence_of(image, self._untouched, gradient_map, None)

    def never_seen(self, image: NDArray[np.uint8], pixels: NDArray[np.intp]) -> NDArray[np.bool_]:
        """Nothing was learnt, so nothing is beyond it."""
        return np.zeros(len(pixels), np.bool_)

    def error_bounds(
        self, gradient_map: NDArray[np.float32], depth_mm: NDArray[np.float32], touched: NDArray[np.bool_]
    ) -> None:
        """Nobody knows them."""
