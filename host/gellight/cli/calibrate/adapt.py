"""`gellight calibrate adapt`: a bundle for light that has changed, from the untouched gel alone."""

from typing import Annotated

import typer

from gellight.base.settings import Settings, load_settings
from gellight.bundle.bundle import Bundle
from gellight.cli.options import AsJson, NewBundle, Sensor, with_options
from gellight.cli.showing import progress, show
from gellight.daemon.assembly import chosen_bundle
from gellight.frames.camera import Camera
from gellight.frames.picture import prepared
from gellight.lab.training.adapting import adapt, untouched_now
from gellight.opening import open_camera


@with_options
def command(
    new: NewBundle,
    sensor: Sensor = None,
    calibration: Annotated[
        str | None, typer.Option(help="bundle that is adapted.", show_default="that of the sensor")
    ] = None,
    reference: Annotated[
        str | None,
        typer.Option(help="pictures of the untouched gel now: a file or a folder.", show_default="the sensor's"),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Adapt a bundle to light that has changed, without a press.

    For LEDs that have aged or were replaced, and a light that was made darker. Lift everything off the gel, and let the
    LEDs get warm. It is refused where light alone does not explain how the untouched gel has changed.
    """
    settings = load_settings({"sensor.url": sensor, "sensor.calibration": calibration})
    bundle = chosen_bundle(settings)
    with _opened(settings, bundle, reference) as camera:
        untouched = untouched_now(camera, bundle)
    with progress("training") as report:
        written, change = adapt(bundle, untouched, new.out, overwrite=new.overwrite, progress=report)
    show({"calibration": str(new.out), "identity": written.identity, **change.as_json()}, as_json)


def _opened(settings: Settings, bundle: Bundle, reference: str | None) -> Camera:
    """Return what the pictures come from, prepared as the bundle says; a sensor is set and lit so, too."""
    if reference is not None:
        return prepared(open_camera(reference), bundle)
    return open_camera(settings.sensor.url, geometry=settings.geometry.overrides(), bundle=bundle)
