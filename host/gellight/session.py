"""Puts a running sensor together: camera, calibration, reconstruction and, where it can be, the self-check."""

from collections.abc import Iterator

from gellight.calibration import Calibration, load_calibration
from gellight.camera import open_camera
from gellight.config import Settings
from gellight.daemon import Daemon
from gellight.errors import CalibrationError, InputError
from gellight.photometric.modes import tactile_path
from gellight.pipeline import Reconstructor
from gellight.selfcheck import SelfCheckResult


def open_session(settings: Settings) -> Daemon:
    """Return the daemon (not yet started) of the sensor and the calibration that `settings` name.

    Raises CameraError, BoardError, InputError, ConfigError or CalibrationError; the camera is closed again, and its
    LEDs are dark, when something does not fit.
    """
    bundle = load_calibration(settings.sensor.calibration)
    camera = open_camera(settings.sensor.url, geometry=settings.geometry.overrides(), calibration=bundle)
    try:
        height, width = bundle.image_shape
        if camera.image_shape != bundle.image_shape:
            raise CalibrationError(
                f"{camera.url} delivers {camera.image_shape[1]}x{camera.image_shape[0]} pixels, the calibration "
                f"{bundle.source} is for {width}x{height}: choose the bundle of this sensor"
            )
        judge = camera.selfcheck(bundle.pixel_size_mm)
        camera, path = tactile_path(camera, bundle, settings.reconstruction, reconstructor_for(bundle, settings))
        return Daemon(camera, path, selfcheck=judge)
    except BaseException:
        camera.close()
        raise


def reconstructor_for(bundle: Calibration, settings: Settings) -> Reconstructor:
    """Return the frame path of `bundle`, set as `settings` say."""
    chosen = settings.reconstruction
    return Reconstructor(bundle, threads=chosen.threads, smoothing_px=chosen.smoothing_px, masked=chosen.masked)


CHECKED_PRESSES = (
    ("BALL", 1.0, 0.0, 0.0),
    ("BALL", 1.0, -9.0, 4.0),
    ("BALL", 1.0, 8.0, -6.0),
    ("BALL", 0.5, 5.0, 5.0),
    *((name, 0.8, 0.0, 0.0) for name in ("TSTEP", "SCROWN", "BALLVEX", "BALLCAVE", "WAVE")),
    *((name, 0.8, 0.0, 0.0) for name in ("SINWAVE", "BSWAVE", "PCONVEX", "CCONVEX", "QUCAVE")),
)
"""object, depth, x, y in mm"""


def check_presses(settings: Settings) -> Iterator[tuple[str, SelfCheckResult]]:
    """Press what `CHECKED_PRESSES` lists into a simulated sensor; yield each press and how well it was measured.

    Raises InputError for a sensor into which nothing can be pressed.
    """
    bundle = load_calibration(settings.sensor.calibration)
    reconstructor = reconstructor_for(bundle, settings)
    with open_camera(settings.sensor.url, geometry=settings.geometry.overrides()) as camera:
        judge, stage = camera.selfcheck(bundle.pixel_size_mm), camera.stage
        if judge is None or stage is None:
            raise InputError(f"{camera.url} cannot be checked: only a simulated sensor (sim://) knows what is pressed")
        for name, depth, x, y in CHECKED_PRESSES:
            stage.press(name, depth, x, y)
            result = judge.compare(reconstructor.reconstruct(camera.read()))
            yield f"{name} {depth:g} mm at ({x:g}, {y:g})", result
