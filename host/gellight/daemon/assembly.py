"""Puts a running sensor together: camera, calibration, reconstruction and, where it can be, the self-check."""

from gellight.base.settings import Settings
from gellight.bundle.bundle import SYNTHETIC, Bundle, load_bundle
from gellight.bundle.store import BundleStore
from gellight.daemon.daemon import Daemon
from gellight.daemon.installing import bundle_of
from gellight.daemon.modes import frame_path, tactile_camera
from gellight.opening import open_camera
from gellight.reconstruction.pipeline import FramePath, Reconstructor
from gellight.watch.monitor import SensorWatch

AUTO = "auto"
"""Setting of the calibration that stands for whichever bundle belongs to the sensor."""


def open_session(settings: Settings, *, every: bool = False) -> Daemon:
    """Return the daemon (not yet started) of the sensor and the calibration that `settings` name.

    every: where the sensor is a file, its pictures wait for a reader that uses `Daemon.next_frame`.
    Raises CameraError, BoardError, InputError, ConfigError or BundleError; the camera is closed again, and its
    LEDs are dark, when something does not fit.
    """
    bundle = chosen_bundle(settings)
    camera = open_camera(settings.sensor.url, geometry=settings.geometry.overrides(), bundle=bundle)
    try:
        bundle.check_fits(camera.url, camera.image_shape)
        mode, changing = settings.reconstruction.mode, bool(settings.lighting.sequence)
        judge = None if mode == "network" and changing else camera.selfcheck(bundle.pixel_size_mm)
        camera = tactile_camera(camera, bundle, settings.reconstruction, settings.lighting)
        watched = settings.watch.enabled and mode == "network" and not changing
        return Daemon(
            camera,
            path_for(bundle, settings),
            selfcheck=judge,
            rebuild=lambda replacement: path_for(replacement, settings),
            watch=SensorWatch(bundle, rezero=settings.watch.rezero) if watched else None,
            every=every,
        )
    except BaseException:
        camera.close()
        raise


def chosen_bundle(settings: Settings) -> Bundle:
    """Return the bundle that `settings` name; "auto" asks the board of the sensor, which is opened for that.

    Where they name none it is that of the simulated sensor for `sim://`, and for a sensor that has none yet. Raises
    BundleError for a bundle that is damaged or missing, else as `open_camera`.
    """
    named, url = settings.sensor.calibration, settings.sensor.url
    if named is None and url.startswith("sim://"):
        named = SYNTHETIC
    if named is not None and named != AUTO:
        return load_bundle(named)
    with open_camera(url, geometry=settings.geometry.overrides()) as camera:
        return bundle_of(camera, BundleStore(), default=SYNTHETIC if named is None else None)


def path_for(bundle: Bundle, settings: Settings) -> FramePath:
    """Return the frame path of `bundle` in the mode that `settings` say; BundleError where it cannot be."""
    return frame_path(bundle, settings.reconstruction, reconstructor_for(bundle, settings), settings.lighting)


def reconstructor_for(bundle: Bundle, settings: Settings) -> Reconstructor:
    """Return the frame path of GelNet with `bundle`, set as `settings` say."""
    chosen = settings.reconstruction
    return Reconstructor(bundle, threads=chosen.threads, smoothing_px=chosen.smoothing_px, masked=chosen.masked)
