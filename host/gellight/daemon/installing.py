"""Puts a bundle into service: checked, kept, taken over by the running sensor, remembered by its board.

What is refused changes nothing. The order is: checks; the store keeps the bundle; the running daemon takes it over
between two frames, if it can; the store names it as the one in service, in one atomic step; the board writes its
identity to flash, so that the sensor finds its own bundle wherever it is plugged in.
"""

import time
from dataclasses import dataclass, replace
from typing import Protocol

from gellight.base.errors import BundleError
from gellight.bundle.bundle import Bundle, load_bundle
from gellight.bundle.limits import Limits
from gellight.bundle.store import BundleStore, StoredBundle
from gellight.frames.camera import Camera
from gellight.ring.enumerations import Status
from gellight.ring.light_ring import LightRing, RefusedError
from gellight.ring.protocol import Configuration

DARK_WITHIN_S = 5.0
"""a board darkens its LEDs in a millisecond; an emulated one on a busy machine takes longer"""
SIMULATED = "simulated"
"""Sensor of the bundle that comes with GelLight."""


class Running(Protocol):
    """A stream whose calibration can be replaced; the daemon is one."""

    def replace_bundle(self, bundle: Bundle) -> None:
        """Use the bundle from the next frame on; BundleError where it does not fit."""


@dataclass(frozen=True, kw_only=True)
class Installed:
    """A bundle in service."""

    bundle: StoredBundle
    remembered: bool
    """whether the board of the sensor knows it; False where the sensor has no board"""


def sensor_name(camera: Camera) -> str:
    """Return the serial number of the board of a sensor; the simulated sensor's name, or the URL, where it has none."""
    if camera.ring is not None:
        return camera.ring.hello.unique_id.hex().upper()
    return SIMULATED if camera.url.startswith("sim://") else camera.url


def install(
    bundle: Bundle,
    *,
    sensor: str,
    store: BundleStore,
    running: Running | None = None,
    camera: Camera | None = None,
    limits: Limits | None = None,
) -> Installed:
    """Put a bundle that passed its verification into service for `sensor`.

    The `camera` of the sensor is set and lit as the bundle was calibrated, and its board is told. Raises
    BundleError for a bundle of another sensor, one that was not verified or not well enough, or one that the
    running sensor cannot use; then the old bundle stays in service. Raises BoardError or CameraError where board or
    camera do not answer: the bundle is in service then, and they have to be told again.
    """
    check_sensor(bundle, sensor)
    (limits or Limits()).check(bundle)
    return _serve(store.add(bundle), store, running, camera)


def restore(
    identity: str,
    *,
    sensor: str,
    store: BundleStore,
    running: Running | None = None,
    camera: Camera | None = None,
) -> Installed:
    """Put a bundle of the store into service again: by its identity or its beginning, or the one before if empty."""
    chosen = store.find(identity) if identity else store.previous(sensor)
    check_sensor(chosen.load(), sensor)
    return _serve(chosen, store, running, camera)


def _serve(chosen: StoredBundle, store: BundleStore, running: Running | None, camera: Camera | None) -> Installed:
    bundle = chosen.load()
    if running is not None:
        running.replace_bundle(bundle)
    served = store.put_in_service(chosen.sensor, chosen.identity)
    ring = camera.ring if camera else None
    if ring is not None:
        remember(ring, bundle)
    if camera is not None:
        camera.adopt(bundle.controls, bundle.colours)
    return Installed(bundle=served, remembered=ring is not None)


def check_sensor(bundle: Bundle, sensor: str) -> None:
    """Raise BundleError for a bundle of another sensor."""
    if bundle.manifest.sensor != sensor:
        raise BundleError(
            f"{bundle.source} is the bundle of sensor {bundle.manifest.sensor!r}, this is {sensor!r}: nothing was "
            "replaced; calibrate this sensor, or give the bundle of this one"
        )


def remember(ring: LightRing, bundle: Bundle) -> None:
    """Write the identity of a bundle to the flash of the board, unless it is there.

    The board writes its flash only in the dark, so the gel is dark for some milliseconds, and then lit as calibrated.
    Raises BoardError.
    """
    configuration = ring.configuration()
    identity = bytes.fromhex(bundle.identity)
    if configuration.bundle == identity:
        return
    ring.blank()
    try:
        _configure(ring, replace(configuration, bundle=identity))
    finally:
        ring.light(bundle.colours)


def _configure(ring: LightRing, configuration: Configuration) -> None:
    """Save a configuration as soon as the LEDs have become dark: blanking is answered before it is done."""
    patience_s = time.monotonic() + DARK_WITHIN_S
    while True:
        try:
            ring.configure(configuration, save=True)
            return
        except RefusedError as error:
            if error.status != Status.BUSY or time.monotonic() > patience_s:
                raise
            time.sleep(0.005)


def bundle_of(camera: Camera, store: BundleStore) -> Bundle:
    """Return the bundle of the sensor behind a camera: the one its board names, else the one in service for it.

    The simulated sensor falls back to the bundle that comes with GelLight. Raises BundleError where there is none,
    or where the bundle that the board names belongs to another sensor.
    """
    sensor = sensor_name(camera)
    identity = camera.ring.configuration().bundle if camera.ring is not None else b""
    if any(identity) and set(identity) != {0xFF}:
        try:
            bundle = store.find(identity.hex()).load()
        except BundleError as error:
            raise BundleError(
                f"the board of sensor {sensor} names bundle {identity.hex()}, which cannot be had here ({error}): "
                "bring it with `gellight calibrate install`, or calibrate the sensor again"
            ) from error
        check_sensor(bundle, sensor)
        return bundle
    if camera.url.startswith("sim://") and sensor not in store.sensors():
        return load_bundle("synthetic")
    return store.current(sensor).load()
