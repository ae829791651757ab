"""The camera of a running sensor: what stands in front of it takes the planned light and is exchanged while it runs."""

from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from math import floor
from typing import Self

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import BundleError, CameraError, GellightError
from gellight.bundle.bundle import Bundle
from gellight.daemon.configuration import STILL, LightPlan, ModeConfig
from gellight.frames.camera import Camera, ReconnectingError, timing_of
from gellight.frames.camera_wrapper import CameraWrapper
from gellight.frames.frames import CameraFrame
from gellight.frames.picture import PreparedCamera, are_prepared
from gellight.photometric.light_model import LightModel
from gellight.sensor.lighting.lock import settle_s
from gellight.sensor.lighting.sequenced import LightMode, SequencedCamera, clock_error_s
from gellight.sensor.series_camera import EXPOSURE, SeriesCamera
from gellight.sensor.set_and_light import settle


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


BRIGHT_GREY = 225.0
"""of the brightest pixel of the untouched gel under one light group"""
LONGEST_US = 30_000.0
"""a camera of 30 frames a second cannot expose longer without becoming slower"""


def camera_for(camera: Camera, light: LightPlan) -> Camera:
    """Return the camera that takes its frames under the planned light: `camera` itself where that is still.

    Raises CameraError without a light ring that can be driven, else as camera and ring do.
    """
    if light.groups is None:
        return camera
    exposure = _exposure_us(camera, light.model, light.light_mode) if light.model else None
    if exposure is not None and camera.ring is not None:
        camera.adopt({EXPOSURE: exposure}, camera.ring.still)
        settle(camera)
    sequenced = SequencedCamera(camera, light.groups, mode=light.light_mode, frames=light.frames)
    return SeriesCamera(sequenced, light.groups, exposure_us=exposure) if light.joined else sequenced


def _exposure_us(camera: Camera, model: LightModel, light_mode: LightMode) -> float | None:
    """Return the brightest exposure under which, unless each light is held, every frame can still be of another."""
    if light_mode is LightMode.HOLD or camera.ring is None:
        return bright_exposure_us(camera, model)
    timing = timing_of(camera)
    dark_s = settle_s(timing, clock_error_s(light_mode), leds=camera.ring.led_count)
    left_s = timing.period_s - timing.readout_s - dark_s
    return bright_exposure_us(camera, model, longest_us=max(left_s, timing.exposure_s) * 1e6)


def bright_exposure_us(camera: Camera, model: LightModel, *, longest_us: float = LONGEST_US) -> float | None:
    """Return the exposure under which one LED of a colour is as bright as the camera can show it, at most `longest_us`.

    None where it cannot be set, or the model does not know at which exposure it was made.
    """
    controls = camera.controls
    if controls is None or EXPOSURE not in controls.names() or model.exposure_us is None:
        return None
    lowest, highest, step = controls.range(EXPOSURE)
    wanted = min(bright_exposure_of(model), highest, longest_us)
    stepped = lowest + floor((wanted - lowest) / step) * step if step else wanted
    return float(max(stepped, lowest))


def bright_exposure_of(model: LightModel) -> float:
    """Return the exposure, us, that makes the brightest pixel `BRIGHT_GREY`; ValueError where the model has none."""
    if model.exposure_us is None:
        raise ValueError("the light model does not know its exposure")
    return float(min(model.exposure_us * (BRIGHT_GREY / model.brightest_grey) ** model.gamma, LONGEST_US))


class SwitchedCamera(CameraWrapper):
    """Passes on what stands in front of a sensor's camera; the sequence numbers go on through every exchange."""

    def __init__(self, camera: Camera) -> None:
        """Take over `camera`, as it is set and lit."""
        super().__init__(camera)
        self._bare = self._prepared = camera
        self._light = STILL
        self._exposure = SensorState.of(camera, {EXPOSURE}).controls
        """what light plans change, as it was before; a bundle need not say it"""
        self._state = SensorState.of(camera)
        """how the sensor was set last, for one that is away and cannot say it"""
        self._offset: int | None = 0
        self._last = 0

    def read(self) -> CameraFrame:
        """Return the next frame of what stands in front."""
        frame = self._camera.read()
        if self._offset is None:
            self._offset = self._last + 1 - frame.sequence
        self._last = frame.sequence + self._offset
        return replace(frame, sequence=self._last) if self._offset else frame

    def prepared(self, config: ModeConfig) -> Camera:
        """Return the sensor's camera with its pictures prepared as `config` says; nothing is changed.

        Raises BundleError where they cannot be, or have another size than its bundle's.
        """
        steps, camera = config.pictures, self._bare
        made = are_prepared(camera, config.bundle)
        if camera.waits and not made and steps != getattr(self._prepared, "picture_steps", None) and self._last:
            raise BundleError(
                f"{config.bundle.source} takes another view of the gel, or fills other dots, and pictures of "
                f"{camera.url} are on their way: stop it, and start it with this bundle"
            )
        if steps and not made:
            camera = PreparedCamera(camera, steps)
        config.bundle.check_fits(camera.url, camera.image_shape)
        return camera

    def switch(self, prepared: Camera, light: LightPlan, state: SensorState | None) -> SensorState:
        """Set and light the sensor like `state` (None: as it is), and put in front what `light` needs.

        Nobody may read meanwhile. Returns how the sensor was set before. Raises what camera and ring raise; then all is
        as before, or the error says what is not.
        """
        if state is not None:
            state = replace(state, controls={**self._exposure, **state.controls})
        before, in_front = self._state_now(state), (self._prepared, self._light)
        self._release()
        try:
            self._put(prepared, state)
            if state is not None and self._bare.controls is not None and state.controls != before.controls:
                with suppress(ReconnectingError):  # it is set anew when it is back
                    settle(self._bare)
            self._camera, self._light = camera_for(prepared, light), light
        except Exception as error:  # also one of GelLight's own, or the camera in front would be half of each
            try:
                self._put(in_front[0], before if state else None)
                self._camera, self._light = camera_for(*in_front), in_front[1]
            except GellightError as second:
                raise CameraError(f"{error}; nor can camera and LEDs be set as before ({second})") from error
            raise
        self._state = state or self._state
        return before

    def _state_now(self, changed: SensorState | None) -> SensorState:
        """Return how the sensor is set now, of the controls that are to be changed."""
        if self._bare.ring is None and self._bare.controls is None:
            return self._state
        return SensorState.of(self._bare, changed.controls if changed else self._exposure)

    def _put(self, prepared: Camera, state: SensorState | None) -> None:
        """Read `prepared` from now on, set and lit like `state`."""
        self._camera, self._prepared, self._light, self._offset = prepared, prepared, STILL, None
        if state is not None:
            prepared.adopt(state.controls, state.colours)

    def _release(self) -> None:
        """Give back what the light plan has set and lit."""
        if isinstance(self._camera, CameraWrapper) and self._camera is not self._prepared:
            self._camera.release()
