"""Presses that are compared with the reference simulator: `gellight selfcheck`."""

from collections.abc import Iterator

from gellight.base.errors import InputError
from gellight.base.settings import Settings
from gellight.daemon.active_pipeline import reconstructor_for
from gellight.daemon.assembly import chosen_bundle
from gellight.frames.frames import SelfCheckResult
from gellight.opening import open_camera

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
    bundle = chosen_bundle(settings)
    reconstructor = reconstructor_for(bundle, settings.reconstruction)
    with open_camera(settings.sensor.url, geometry=settings.geometry.overrides()) as camera:
        judge, stage = camera.selfcheck(bundle.pixel_size_mm), camera.stage
        if judge is None or stage is None:
            raise InputError(f"{camera.url} cannot be checked: only a simulated sensor (sim://) knows what is pressed")
        for name, depth, x, y in CHECKED_PRESSES:
            stage.press(name, depth, x, y)
            result = judge.compare(reconstructor.reconstruct(camera.read()))
            yield f"{name} {depth:g} mm at ({x:g}, {y:g})", result
