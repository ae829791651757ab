"""What stands in front of the camera of a sensor, so that its frames are taken under the light that is planned."""

from math import floor

from gellight.base.errors import CameraError
from gellight.daemon.configuration import LightPlan
from gellight.frames.camera import Camera, timing_of
from gellight.photometric.light_model import LightModel
from gellight.sensor.lighting.lock import settle_s
from gellight.sensor.lighting.sequenced import LightMode, SequencedCamera, clock_error_s
from gellight.sensor.series_cameras import EXPOSURE, SeriesCamera
from gellight.sensor.window_camera import WindowCamera

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
    if not light.joined:
        return SequencedCamera(camera, light.groups, mode=light.light_mode)
    if light.light_mode is LightMode.HOLD:
        exposure = bright_exposure_us(camera, light.model) if light.model else None
        return SeriesCamera(camera, light.groups, exposure_us=exposure, frames=light.frames)
    exposure = _window_exposure_us(camera, light.model, light.light_mode) if light.model else None
    if exposure is not None and camera.ring is not None:
        camera.adopt({EXPOSURE: exposure}, camera.ring.still)
    sequenced = SequencedCamera(camera, light.groups, mode=light.light_mode)
    return WindowCamera(sequenced, light.groups, exposure_us=exposure)


def _window_exposure_us(camera: Camera, model: LightModel, light_mode: LightMode) -> float | None:
    """Return the brightest exposure under which every frame can still be of another light."""
    if camera.ring is None:
        raise CameraError(f"{camera.url} has no light ring that can be driven: use --mode network")
    timing = timing_of(camera)
    settle = settle_s(timing, clock_error_s(light_mode), leds=camera.ring.led_count)
    left_s = timing.period_s - timing.readout_s - settle
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
