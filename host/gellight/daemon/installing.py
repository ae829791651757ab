"""Puts a bundle into service: checked, kept, taken over by the running sensor, remembered by its board.

All of it happens, or nothing. The order is: the bundle is checked; the store keeps it on the disk, not yet in service;
the running daemon takes it over between two frames; the board writes its identity to flash, so that the sensor finds
its own bundle wherever it is plugged in; the store names it as the one in service. What fails takes back what was done
before it, the last first.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

from gellight.base.errors import BundleError
from gellight.bundle.bundle import Bundle
from gellight.bundle.limits import Limits
from gellight.bundle.store import BundleStore, ListedBundle, StoredBundle
from gellight.daemon.bundle_choice import check_sensor
from gellight.daemon.session import SensorSession
from gellight.daemon.switched_camera import SensorState
from gellight.frames.camera import Camera
from gellight.frames.picture import PictureSteps
from gellight.ring.board_link import RefusedError
from gellight.ring.enumerations import Status
from gellight.ring.light_ring import LightRing
from gellight.ring.protocol import Configuration
from gellight.sensor.set_and_light import SETTLING_FRAMES
from gellight.watch.other_unit import UnitCheck

DARK_WITHIN_S = 5.0
"""a board darkens its LEDs in a millisecond; an emulated one on a busy machine takes longer"""


@dataclass(frozen=True, kw_only=True)
class Installed:
    """A bundle in service."""

    bundle: ListedBundle
    remembered: bool
    """whether the board of the sensor remembers it; False where the sensor has no board"""


def install(
    bundle: Bundle,
    *,
    sensor: str,
    store: BundleStore,
    running: SensorSession | None = None,
    camera: Camera | None = None,
    limits: Limits | None = None,
) -> Installed:
    """Put a bundle into service for the sensor whose serial number or name is `sensor`.

    running: the stream that takes the bundle over; without one, `camera` is set and lit as the bundle says. camera: of
    the sensor, whose board remembers the bundle. Raises BundleError for a bundle of another sensor (by name or, where
    it does not run, by its picture), one that was not verified or not well enough, or one that the running sensor
    cannot use, and where the disk refuses it; BoardError or
    CameraError where board or camera do not answer. After any error the running bundle, the one in service, the setting
    of the camera and the memory of the board are as before; where that could not be done, the error says what is where.
    """
    check_sensor(bundle, sensor)
    (limits or Limits()).check(bundle)
    return _serve(store.add(bundle), bundle, store, running, camera)


def restore(
    identity: str,
    *,
    sensor: str,
    store: BundleStore,
    running: SensorSession | None = None,
    camera: Camera | None = None,
) -> Installed:
    """Put a bundle of the store into service again: by its identity or its beginning, or the one before if empty.

    Raises as `install`.
    """
    chosen = store.find(identity) if identity else store.previous(sensor)
    bundle = chosen.load()
    check_sensor(bundle, sensor)
    return _serve(chosen, bundle, store, running, camera)


def _serve(
    chosen: StoredBundle, bundle: Bundle, store: BundleStore, running: SensorSession | None, camera: Camera | None
) -> Installed:
    ring = camera.ring if camera else None
    history = store.history(chosen.sensor)
    made: list[tuple[str, Callable[[], object]]] = []
    """what was changed, and what takes it back"""
    try:
        if running is not None:
            made.append((f"the sensor streams with bundle {bundle.identity}", running.replace_bundle(bundle)))
        elif camera is not None:
            before = SensorState.said_by(bundle).apply(camera)
            made.append((f"camera and LEDs are set as bundle {bundle.identity} says", partial(before.apply, camera)))
            refuse_other_unit(bundle, camera)
        if ring is not None:
            known = ring.configuration().bundle
            made.append((f"the board may remember bundle {bundle.identity}", partial(remember, ring, known)))
            remember(ring, bytes.fromhex(bundle.identity))
        kept = f"bundle {bundle.identity} may be in service in {store.folder}"
        made.append((kept, partial(store.write_history, chosen.sensor, history)))
        store.put_in_service(chosen)
    except BaseException as error:
        _roll_back(made, error, history)
        raise
    return Installed(bundle=ListedBundle.of(chosen, bundle, in_service=True), remembered=ring is not None)


def _roll_back(made: list[tuple[str, Callable[[], object]]], cause: BaseException, history: Sequence[str]) -> None:
    """Take back what was changed, the last first; BundleError, saying what is where, if something remains."""
    remaining = []
    for words, take_back in reversed(made):
        try:
            take_back()
        except Exception as error:
            remaining.append(f"{words} ({error})")
    if remaining:
        remedy = f"run `gellight calibrate restore {history[-1]}`" if history else "start with the old bundle"
        raise BundleError(
            f"{cause}; not all could be taken back: {'; '.join(remaining)}. Stop the sensor and {remedy}"
        ) from cause


def refuse_other_unit(bundle: Bundle, camera: Camera) -> None:
    """Raise BundleError where a camera, which is set and lit as the bundle says, shows another unit.

    Pictures of another size than the bundle's cannot be compared, nor those of files, which are used up by reading.
    """
    if camera.waits:
        return
    for _ in range(SETTLING_FRAMES):
        camera.read()
    image, steps = camera.read().image, PictureSteps.in_bundle(bundle)
    if image.shape[:2] == (steps.taken_shape if steps else bundle.image_shape):
        UnitCheck(bundle).refuse(steps.apply(image, camera.url) if steps else image)


def remember(ring: LightRing, identity: bytes) -> None:
    """Write the identity of a bundle to the flash of the board, unless it is there.

    The board writes its flash only in the dark, so the gel is dark for some milliseconds, and then lit as before.
    Raises BoardError.
    """
    configuration, still = ring.configuration(), ring.still
    if configuration.bundle == identity:
        return
    ring.blank()
    try:
        _configure(ring, replace(configuration, bundle=identity))
    finally:
        ring.light(still)


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
