"""Puts a running sensor together: its camera, and the bundle that belongs to it."""

from gellight.base.settings import Settings
from gellight.bundle.bundle import Bundle
from gellight.daemon.bundle_choice import BundleChoice, placeholder
from gellight.daemon.session import SensorSession
from gellight.opening import open_camera


def open_session(settings: Settings, *, every: bool = False) -> SensorSession:
    """Return the session (not yet started) of the sensor and the calibration that `settings` name.

    every: where the sensor is a file, its pictures wait for a reader that uses `SensorSession.next_frame`.
    Raises CameraError, BoardError, InputError, ConfigError or BundleError; the camera is closed again, and its
    LEDs are dark, when something does not fit.
    """
    choice = BundleChoice(settings)
    camera = open_camera(settings.sensor.url, geometry=settings.geometry.overrides(), bundle=choice)
    try:
        return SensorSession(camera, choice.bundle or placeholder(camera.image_shape), settings, every=every)
    except BaseException:
        camera.close()
        raise


def chosen_bundle(settings: Settings) -> Bundle:
    """Return the bundle that `settings` name; a sensor that alone can tell it is opened, dark, and closed again.

    Raises as `open_session`.
    """
    choice = BundleChoice(settings)
    if choice.bundle is not None:
        return choice.bundle
    with open_camera(settings.sensor.url, geometry=settings.geometry.overrides()) as camera:
        return choice(camera) or placeholder(camera.image_shape)
