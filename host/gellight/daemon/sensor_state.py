"""How a sensor is set and lit: taken down before it is changed, so that it can be set the same again."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import CameraError, GellightError
from gellight.bundle.bundle import Bundle
from gellight.frames.camera import Camera


@dataclass(frozen=True, kw_only=True, eq=False)
class SensorState:
    """The controls of a camera and the light of its ring."""

    controls: Mapping[str, float]
    """by name"""
    colours: NDArray[np.uint8] | None
    """(12, 3) RGB of the LEDs; None: dark"""

    @classmethod
    def of(cls, camera: Camera, names: Iterable[str] | None = None) -> Self:
        """Return what is in force, of the controls `names` or of all; a sensor that is away has none and no ring.

        Raises as the camera does.
        """
        controls, ring = camera.controls, camera.ring
        chosen = [name for name in controls.names() if names is None or name in names] if controls else []
        values = {name: controls.read(name) for name in chosen} if controls else {}
        return cls(controls=values, colours=ring.still if ring else None)

    @classmethod
    def said_by(cls, bundle: Bundle) -> Self:
        """Return how the sensor was set when `bundle` was made; BundleError where a control is no number."""
        return cls(controls=bundle.controls, colours=bundle.colours)

    def over(self, other: "SensorState") -> Self:
        """Return this, and `other` where this says nothing."""
        colours = other.colours if self.colours is None else self.colours
        return replace(self, controls={**other.controls, **self.controls}, colours=colours)

    def apply(self, camera: Camera) -> "SensorState":
        """Set and light the sensor like this; return how it was set before.

        Raises as `Camera.adopt`; then it is set as before. Where that fails too, the error says so.
        """
        before = SensorState.of(camera, self.controls)
        try:
            camera.adopt(self.controls, self.colours)
        except GellightError as error:
            try:
                camera.adopt(before.controls, before.colours)
            except GellightError as second:
                raise CameraError(f"{error}; nor can camera and LEDs be set as before ({second})") from error
            raise
        return before
