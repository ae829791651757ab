"""What the sensor felt while forces were recorded: in each picture the integral of the pressure for a modulus of 1.

It is found for several layers, so that the forces can tell which one the gel is like.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Self

import numpy as np
from numpy.typing import NDArray

from gellight.base.csv_file import number_in, read_csv
from gellight.base.errors import InputError
from gellight.bundle.bundle import Bundle
from gellight.frame_path.pipeline import Reconstructor
from gellight.frame_path.sequence_path import SequencePath
from gellight.frames.frames import CameraFrame
from gellight.frames.image_files import ImageCamera
from gellight.frames.picture import prepared
from gellight.reconstruction.force import Layer, indenting
from gellight.recording.recording_file import Recording

FORCE, IMAGE, TIME, OBJECT = "force_n", "image", "unix_s", "object"
SIDES = "side_x_n", "side_y_n"
NEGATIVE_SHARE = 0.05
"""of the largest force: a load cell that was not set to zero may read this share below it"""
Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, eq=False)
class ForceReadings:
    """The content of the file; one of `images` and `unix_s` is empty."""

    path: Path
    force_n: Array
    """(n,)"""
    images: tuple[Path, ...]
    unix_s: Array
    """(n,), rising"""
    side_n: Array | None = None
    """(n, 2) along the gel; None where the file has none"""
    objects: tuple[str, ...] = ()
    """what pressed in each reading; empty where the file does not say"""

    @classmethod
    def read(cls, path: Path) -> Self:
        """Read and check a file; InputError, naming line and value, for what cannot be a record of presses."""
        columns, rows = read_csv(path, "forces")
        if not rows:
            raise InputError(f"{path} has no forces: add a line for each reading")
        at = IMAGE if IMAGE in columns else TIME
        missing = {FORCE, at} - set(columns)
        if missing or {IMAGE, TIME} <= set(columns):
            raise InputError(f"{path}: its first line must be {IMAGE},{FORCE} or {TIME},{FORCE}")
        force_n = np.array([number_in(row, FORCE, f"{path}, line {line}") for line, row in rows])
        _check_forces(force_n, path)
        objects = tuple((row[OBJECT] or "").strip() for _, row in rows) if OBJECT in columns else ()
        sides = [one for one in SIDES if one in columns]
        if sides and (len(sides) == 1 or at == TIME):
            raise InputError(f"{path}: give both {SIDES[0]} and {SIDES[1]}, beside pictures, or neither")
        side_n = np.array([[number_in(row, one, f"{path}, line {line}") for one in sides] for line, row in rows])
        if at == IMAGE:
            images = tuple(_image(row[IMAGE], path, line) for line, row in rows)
            return cls(path=path, force_n=force_n, images=images, unix_s=np.zeros(0), objects=objects,
                       side_n=side_n if sides else None)  # fmt: skip
        unix_s = np.array([number_in(row, TIME, f"{path}, line {line}") for line, row in rows])
        if (falling := np.flatnonzero(np.diff(unix_s) <= 0)).size:
            raise InputError(
                f"{path}, line {rows[falling[0] + 1][0]}: {TIME} does not rise: give a line for each reading, in order"
            )
        return cls(path=path, force_n=force_n, images=(), unix_s=unix_s, objects=objects)


def _image(text: str | None, path: Path, line: int) -> Path:
    name = (text or "").strip()
    if not name:
        raise InputError(f"{path}, line {line}: column {IMAGE} is empty: give the name of the picture beside the file")
    return path.parent / name


def _check_forces(force_n: Array, path: Path) -> None:
    """Refuse forces that pull: a gel that is pressed pushes back."""
    least, most = float(force_n.min()), float(force_n.max())
    if most <= 0:
        raise InputError(f"{path}: the largest force is {most:g} N: give forces above 0, the gel being pressed")
    if least < -NEGATIVE_SHARE * most:
        raise InputError(
            f"{path}: a force is {least:g} N: set the load cell to zero before the gel is touched, or turn the sign of "
            "the record"
        )


MOST_FRAMES = 600
"""of a recording are looked at, evenly spread"""
MOST_LAG_S = 0.2
LAG_STEP_S = 0.01


@dataclass(frozen=True, kw_only=True, eq=False)
class Felt:
    """Forces and what was felt under them."""

    force_n: Array
    integral_mm2: Array
    """(n, layers) the force for a modulus of 1 N / mm2"""
    objects: tuple[str, ...] = ()
    """what pressed, n names; empty where the record does not say"""
    lag_s: float = 0.0
    """by which the forces came later than the pictures"""


def felt_in_images(readings: ForceReadings, bundle: Bundle, layers: Sequence[Layer]) -> Felt:
    """Return what is felt in the picture of each reading; InputError for a press that the view cuts off."""
    feel = _Feeling(bundle, layers)
    with prepared(ImageCamera(readings.images), bundle) as camera:
        integrals = [feel.integral_mm2(camera.read()) for _ in readings.images]
    for image, integral in zip(readings.images, integrals, strict=True):
        if np.isnan(integral).any():
            raise InputError(f"{image}: the load goes on beyond the border of the view: press nearer to its middle")
    return Felt(force_n=readings.force_n, integral_mm2=np.array(integrals), objects=readings.objects)


def felt_in_recording(readings: ForceReadings, recording: Recording, bundle: Bundle, layers: Sequence[Layer]) -> Felt:
    """Return what is felt in the frames of a recording while the load cell read; the lag of its clock is found.

    Frames whose load goes on beyond the view are left out. Raises InputError where recording and readings are of other
    times.
    """
    unix_s, integrals = _of_frames(recording, bundle, layers, readings)
    integral = integrals[:, 0]
    lags = np.arange(-MOST_LAG_S, MOST_LAG_S + LAG_STEP_S / 2, LAG_STEP_S)
    left = []
    for lag in lags:
        force = np.interp(unix_s + lag, readings.unix_s, readings.force_n)
        modulus = float(force @ integral) / max(float(integral @ integral), 1e-30)
        left.append(float(((force - modulus * integral) ** 2).sum()))
    lag_s = float(lags[int(np.argmin(left))])
    nearest = np.searchsorted(readings.unix_s, unix_s + lag_s).clip(0, len(readings.unix_s) - 1)
    return Felt(
        force_n=np.interp(unix_s + lag_s, readings.unix_s, readings.force_n),
        integral_mm2=integrals,
        objects=tuple(readings.objects[number] for number in nearest) if readings.objects else (),
        lag_s=lag_s,
    )


class _Feeling:
    """The frame path of one bundle, asked for the integral of the pressure."""

    def __init__(self, bundle: Bundle, layers: Sequence[Layer]) -> None:
        self._reconstructor, self._layers = SequencePath(Reconstructor(bundle)), layers
        self._manifest = bundle.manifest

    def integral_mm2(self, frame: CameraFrame) -> list[float]:
        """One for each layer; NaN where it is not known, as where the load goes on beyond the view."""
        depth_mm = self._reconstructor.reconstruct(frame).depth_mm
        if np.isnan(depth_mm).any():  # under another light of a sequence nothing is felt
            return [np.nan] * len(self._layers)
        size, height = self._manifest.pixel_size_mm, self._manifest.camera_height_mm
        found = [indenting(depth_mm, size, layer, height) for layer in self._layers]
        return [np.nan if one.at_border else one.integral_mm2 for one in found]


def _of_frames(
    recording: Recording, bundle: Bundle, layers: Sequence[Layer], readings: ForceReadings
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(n,) Unix time and (n, layers) integrals of the frames that were taken while the load cell read."""
    feelings: dict[str, _Feeling] = {}
    times, integrals = [], []
    for unix_s, zero, frame in _frames(recording, readings):
        if zero not in feelings:
            feelings[zero] = _Feeling(_with_zero(bundle, recording.bundles[zero]), layers)
        times.append(unix_s)
        integrals.append(feelings[zero].integral_mm2(frame))
    kept = np.isfinite(integrals).all(axis=1) if integrals else np.zeros(0, np.bool_)
    if not kept.any():
        raise InputError(
            f"no frame of {recording.path} was taken while {readings.path} reads, from {readings.unix_s[0]:.3f} to "
            f"{readings.unix_s[-1]:.3f} s Unix time, and shows its load whole: give files of the same time"
        )
    return np.array(times)[kept], np.array(integrals, np.float64)[kept]


def _with_zero(bundle: Bundle, recorded: Bundle) -> Bundle:
    """Return the bundle with the zero that was in use, where the recording was made with this calibration."""
    if recorded.network != bundle.network or recorded.image_shape != bundle.image_shape:
        return bundle
    return bundle.with_reference(recorded.reference, frames=recorded.manifest.reference_frames)


def _frames(recording: Recording, readings: ForceReadings) -> Iterator[tuple[float, str, CameraFrame]]:
    """Yield Unix time, zero and picture of frames that were taken while the load cell read."""
    begin, end = readings.unix_s[0] + MOST_LAG_S, readings.unix_s[-1] - MOST_LAG_S
    inside = sum(begin <= record.info.unix_s <= end for record in recording.frames())
    every = max(1, -(-inside // MOST_FRAMES))
    number = 0
    for record in recording.frames():
        info = record.info
        if not begin <= info.unix_s <= end:
            continue
        number += 1
        if (number - 1) % every == 0:
            yield info.unix_s, info.zero, record.camera_frame(str(recording.path))
