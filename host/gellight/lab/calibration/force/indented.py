"""What the sensor felt while forces were recorded: in each picture the integral of the pressure for a modulus of 1.

It is found for several layers, so that the forces can tell which one the gel is like.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import InputError
from gellight.bundle.bundle import Bundle
from gellight.frame_path.pipeline import Reconstructor
from gellight.frame_path.sequence_path import SequencePath
from gellight.frames.frames import CameraFrame
from gellight.frames.image_files import ImageCamera
from gellight.frames.picture import prepared
from gellight.lab.calibration.force.record import Array, ForceReadings
from gellight.reconstruction.force import Layer, indenting
from gellight.recording.recording_file import Recording

MOST_FRAMES = 600
"""of a recording are looked at, evenly spread"""
MOST_LAG_S = 0.2  # chosen: how far the clocks of camera and load cell may differ
LAG_STEP_S = 0.01  # chosen: a third of a frame at 30 frames/s


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
    path = SequencePath(Reconstructor(bundle))
    with prepared(ImageCamera(readings.images), bundle) as camera:
        integrals = [_integrals_mm2(path, camera.read(), layers) for _ in readings.images]
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


def _integrals_mm2(path: SequencePath, frame: CameraFrame, layers: Sequence[Layer]) -> list[float]:
    """Of the pressure, one for each layer; NaN where it is not known, as where the load goes on beyond the view."""
    depth_mm, manifest = path.reconstruct(frame).depth_mm, path.bundle.manifest
    if np.isnan(depth_mm).any():  # under another light of a sequence nothing is felt
        return [np.nan] * len(layers)
    found = [indenting(depth_mm, manifest.pixel_size_mm, layer, manifest.camera_height_mm) for layer in layers]
    return [np.nan if one.at_border else one.integral_mm2 for one in found]


def _of_frames(
    recording: Recording, bundle: Bundle, layers: Sequence[Layer], readings: ForceReadings
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(n,) Unix time and (n, layers) integrals of the frames that were taken while the load cell read."""
    paths: dict[str, SequencePath] = {}
    times, integrals = [], []
    for unix_s, zero, frame in _frames(recording, readings):
        if zero not in paths:
            paths[zero] = SequencePath(Reconstructor(_with_zero(bundle, recording.bundles[zero])))
        times.append(unix_s)
        integrals.append(_integrals_mm2(paths[zero], frame, layers))
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
