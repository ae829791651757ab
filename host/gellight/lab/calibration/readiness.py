"""What a calibration needs, checked before its first step: where to write, room on the disk, a trainer."""

import os
import shutil
import tempfile
from pathlib import Path

from gellight.base.errors import BundleError, InputError
from gellight.bundle.bundle import load_bundle
from gellight.lab.calibration.choices import RoutineOptions
from gellight.lab.training.table import table_of_like

_BYTES_PER_PIXEL = 7
"""of every press: 3 for its picture, and 32 for each labelled pixel, which are an eighth of a picture at most"""


def check_target(options: RoutineOptions, folder: Path, image_shape: tuple[int, int]) -> None:
    """Refuse before any work what could not be written at its end; `folder` is where the state is kept.

    Raises InputError where a folder cannot be written or has too little room, BundleError for a bundle of another
    sensor; either for a bundle that is of no like unit.
    """
    if not options.sensor.strip():
        raise InputError("the sensor has an empty name: give it one")
    presses = options.presses + options.verifications
    for place in (folder, options.out, Path(tempfile.gettempdir()) / "calibration"):
        check_room(place, image_shape, presses)
    if options.like:
        table_of_like(options.like, image_shape)
    if options.out.exists():
        _check_replaceable(options, image_shape)


def nearest(path: Path) -> Path:
    """Return the folder in which something at `path` is made: the nearest one above it that exists."""
    return next(place for place in path.absolute().parents if place.exists())


def check_room(path: Path, image_shape: tuple[int, int], presses: int) -> int:
    """Return the free bytes where something at `path` is made; InputError where presses cannot be kept there."""
    place, needed_bytes = nearest(path), presses * image_shape[0] * image_shape[1] * _BYTES_PER_PIXEL
    if not (place.is_dir() and os.access(place, os.W_OK | os.X_OK)):
        raise InputError(f"nothing can be written in {place}: give another folder, or get the right to write there")
    free = shutil.disk_usage(place).free
    if free < needed_bytes:
        raise InputError(
            f"{free / 1e6:.0f} MB are free in {place}, a calibration may need {needed_bytes / 1e6:.0f} MB: make room, "
            "or give another folder"
        )
    return free


def _check_replaceable(options: RoutineOptions, image_shape: tuple[int, int]) -> None:
    """Refuse to replace a bundle unless that is allowed and it is one of this sensor and of pictures of this size."""
    if not options.overwrite:
        raise InputError(f"{options.out} exists: choose another name or allow overwriting")
    old = load_bundle(options.out)
    if old.manifest.sensor != options.sensor:
        raise BundleError(
            f"{options.out} is the bundle of sensor {old.manifest.sensor!r}, not of {options.sensor!r}: "
            "choose another name for the new one"
        )
    if old.image_shape != image_shape:
        raise BundleError(
            f"{options.out} is for pictures of {old.image_shape[1]} x {old.image_shape[0]} px, the camera delivers "
            f"{image_shape[1]} x {image_shape[0]} px: choose another name for the new one"
        )
