"""The camera of a daemon whose mode can be changed: what stands in front of the sensor is replaced while it runs."""

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import GellightError
from gellight.daemon.setting import Setting
from gellight.frames.camera import Camera
from gellight.frames.camera_wrapper import CameraWrapper
from gellight.frames.frames import CameraFrame
from gellight.frames.picture import PictureSteps, PreparedCamera
from gellight.sensor.series_cameras import EXPOSURE
from gellight.sensor.set_and_light import set_and_settle

Equip = Callable[[Camera], Camera]
"""what the mode of a sensor puts in front of its camera; the camera itself where it needs nothing"""


class SwitchedCamera(CameraWrapper):
    """Passes on what a mode makes of the camera; the sequence numbers go on through a change of the mode."""

    def __init__(self, camera: Camera, equip: Equip) -> None:
        """Take over `camera`, and put what `equip` makes of it in front of it."""
        self._exposure = Setting.of(camera, {EXPOSURE}).controls
        """what the modes change, as it was before; a bundle need not say it"""
        super().__init__(equip(camera))
        self._bare = self._sensor = camera
        self._equip = equip
        self._offset: int | None = 0
        self._last = 0

    def read(self) -> CameraFrame:
        """Return the next frame as the mode makes it."""
        frame = self._camera.read()
        if self._offset is None:
            self._offset = self._last + 1 - frame.sequence
        self._last = frame.sequence + self._offset
        return replace(frame, sequence=self._last) if self._offset else frame

    def prepare(self, steps: PictureSteps | None) -> None:
        """Prepare the pictures of the sensor so, None: leave them as they are; nobody may read meanwhile.

        Raises BundleError for a view of pictures of another size; then nothing has changed.
        """
        sensor = PreparedCamera(self._bare, steps) if steps else self._bare
        self._release()
        self._sensor, self._camera, self._offset = sensor, self._equip(sensor), None

    def switch(self, equip: Equip, controls: Mapping[str, float], colours: NDArray[np.uint8] | None) -> None:
        """Set and light the sensor like this, then put what `equip` makes of it in front; nobody may read meanwhile.

        Raises what that raises; then what was there before is there again.
        """
        self._release()
        self._offset = None
        try:
            set_and_settle(self._sensor, {**self._exposure, **controls})
            self._sensor.adopt({**self._exposure, **controls}, colours)
            self._camera = equip(self._sensor)
        except GellightError:
            self._camera = self._equip(self._sensor)
            raise
        self._equip = equip

    def _release(self) -> None:
        """Give back what the mode has set and lit."""
        if isinstance(self._camera, CameraWrapper) and self._camera is not self._sensor:
            self._camera.release()
