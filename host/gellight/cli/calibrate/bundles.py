"""`gellight calibrate list`, `install` and `restore`: which bundle a sensor uses."""

from typing import Annotated

import typer

from gellight.base.settings import load_settings
from gellight.bundle.bundle import load_bundle
from gellight.bundle.store import BundleStore
from gellight.cli.options import AsJson, Sensor
from gellight.cli.showing import show
from gellight.daemon.bundle_choice import sensor_name
from gellight.daemon.installing import Installed, install, restore
from gellight.frames.camera import Camera
from gellight.opening import open_camera


def list_bundles(
    name: Annotated[
        str | None, typer.Option(help="only the bundles of the sensor with this serial number or name")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Show the bundles kept on this computer; an asterisk marks those in service."""
    store = BundleStore()
    entries = [entry for entry in store.bundles() if name in (None, entry.sensor, entry.name)]
    lines = []
    for entry in entries:
        made = entry.created.astimezone().strftime("%Y-%m-%d %H:%M") if entry.created else entry.problem
        called = f"  {entry.name}" if entry.name else ""
        lines.append(f"{'*' if entry.in_service else ' '} {entry.sensor:<20} {entry.identity}  {made}{called}")
    none = f"no bundles in {store.folder}: `gellight calibrate` makes them"
    show({"folder": str(store.folder), "bundles": entries}, as_json, "\n".join(lines or [none]))


def install_bundle(
    bundle: Annotated[str, typer.Argument(help="folder or .gelcal file")],
    sensor: Sensor = None,
    as_json: AsJson = False,
) -> None:
    """Put a bundle that passed its verification into service; the board of the sensor remembers it."""
    loaded = load_bundle(bundle)
    with _opened(sensor) as camera:
        installed = install(loaded, sensor=sensor_name(camera), store=BundleStore(), camera=camera)
    _report(installed, as_json)


def restore_bundle(
    identity: Annotated[str, typer.Argument(help="or its beginning; without: the one in service before")] = "",
    sensor: Sensor = None,
    as_json: AsJson = False,
) -> None:
    """Put an earlier bundle of the sensor into service again; its board remembers it."""
    with _opened(sensor) as camera:
        installed = restore(identity, sensor=sensor_name(camera), store=BundleStore(), camera=camera)
    _report(installed, as_json)


def _opened(sensor: str | None) -> Camera:
    settings = load_settings({"sensor.url": sensor})
    return open_camera(settings.sensor.url, geometry=settings.geometry.overrides())


def _report(installed: Installed, as_json: bool) -> None:
    entry = installed.bundle
    known = "its board remembers it" if installed.remembered else "it has no board that could remember it"
    text = (
        f"bundle {entry.identity} is in service for sensor {entry.sensor}; {known}\n"
        "a sensor that runs goes on with its old bundle until it is started again; --calibration auto names this one"
    )
    show({**entry.model_dump(mode="json"), "remembered": installed.remembered}, as_json, text)
