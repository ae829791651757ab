"""Puts a running sensor together: camera, calibration, reconstruction and, where it can be, the self-check."""

from collections.abc import Iterator

from gellight.calibration import load_calibration
from gellight.camera import open_camera
from gellight.daemon import Daemon
from gellight.errors import CalibrationError, InputError
from gellight.pipeline import Reconstructor
from gellight.selfcheck import SelfCheckResult


def open_session(sensor: str, calibration: str, *, threads: int = 1) -> Daemon:
    """Return the daemon (not yet started) of the camera at URL `sensor` under the bundle `calibration`.

    Raises CameraError, InputError or CalibrationError; the camera is closed again when something does not fit.
    """
    bundle = load_calibration(calibration)
    camera = open_camera(sensor)
    try:
        height, width = bundle.image_shape
        if camera.image_shape != bundle.image_shape:
            raise CalibrationError(
                f"{sensor} delivers {camera.image_shape[1]}x{camera.image_shape[0]} pixels, the calibration "
                f"{calibration} is for {width}x{height}: choose the bundle of this sensor"
            )
        judge = camera.selfcheck(bundle.pixel_size_mm)
        return Daemon(camera, Reconstructor(bundle, threads=threads), selfcheck=judge)
    except BaseException:
        camera.close()
        raise


CHECKED_PRESSES = (
    ("BALL", 1.0, 0.0, 0.0),
    ("BALL", 1.0, -9.0, 4.0),
    ("BALL", 1.0, 8.0, -6.0),
    ("BALL", 0.5, 5.0, 5.0),
    *((name, 0.8, 0.0, 0.0) for name in ("TSTEP", "SCROWN", "BALLVEX", "BALLCAVE", "WAVE")),
    *((name, 0.8, 0.0, 0.0) for name in ("SINWAVE", "BSWAVE", "PCONVEX", "CCONVEX", "QUCAVE")),
)
"""object, depth, x, y in mm"""


def check_presses(sensor: str, calibration: str) -> Iterator[tuple[str, SelfCheckResult]]:
    """Press what `CHECKED_PRESSES` lists into a simulated sensor; yield each press and how well it was measured.

    Raises InputError for a sensor into which nothing can be pressed.
    """
    bundle = load_calibration(calibration)
    reconstructor = Reconstructor(bundle)
    with open_camera(sensor) as camera:
        judge, stage = camera.selfcheck(bundle.pixel_size_mm), camera.stage
        if judge is None or stage is None:
            raise InputError(f"{sensor} cannot be checked: only a simulated sensor (sim://) knows what is pressed")
        for name, depth, x, y in CHECKED_PRESSES:
            stage.press(name, depth, x, y)
            result = judge.compare(reconstructor.reconstruct(camera.read()))
            yield f"{name} {depth:g} mm at ({x:g}, {y:g})", result
