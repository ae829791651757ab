"""The constant of forces along the gel, from pictures of a gel with marker dots that was pulled by known forces.

The layer makes of dots and depth a force f; the measured one is F = s f. s is fitted to all readings, x and y alike,
and what the fit leaves is the error share of a force along the gel.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import InputError
from gellight.bundle.bundle import Bundle
from gellight.frame_path.pipeline import Reconstructor
from gellight.frames.image_files import ImageCamera
from gellight.frames.picture import prepared, steps_of
from gellight.lab.calibration.force.record import ForceReadings
from gellight.reconstruction.force_file import ForceRecord, force_file

Array = NDArray[np.float64]
FEWEST = 3
"""readings that pull"""
PULLS = 0.1
"""of the largest force along the gel: less is what a load cell shows of a press alone"""
LEAST_SHARE = 0.05
"""of the error: a few readings say nothing of other objects"""
MOST_SHARE = 0.3
"""a worse fit than that is no calibration"""


@dataclass(frozen=True, kw_only=True)
class SideFit:
    """The constant, and how well it explains the readings."""

    side_scale: float
    side_error_share: float


def check_sides(readings: ForceReadings, bundle: Bundle) -> None:
    """Refuse forces along a gel without dots, in whose pictures they would be felt as contacts; raises InputError."""
    steps = steps_of(bundle) if readings.side_n is not None else None
    if readings.side_n is not None and (steps is None or steps.follower() is None):
        raise InputError(
            f"{readings.path} has forces along the gel, and the bundle knows no marker dots: calibrate this gel with "
            "--dots, or leave these columns out"
        )


def with_sides(record: ForceRecord, readings: ForceReadings, bundle: Bundle) -> ForceRecord:
    """Return the record with the constant of forces along the gel, where the readings have some.

    The bundle passed `check_sides`. Raises InputError where one constant does not explain the forces.
    """
    if readings.side_n is None:
        return record
    felt_n = _felt_n(readings, bundle.with_files(force_file(record)))
    fit = fit_side(readings.side_n, felt_n, str(readings.path))
    return record.model_copy(update={"side_scale": fit.side_scale, "side_error_share": fit.side_error_share})


def fit_side(side_n: Array, felt_n: Array, source: str) -> SideFit:
    """Fit the constant to (n, 2) measured forces and those that the layer finds; InputError, naming `source`."""
    pull_n = np.hypot(*side_n.T)
    pulling = pull_n > PULLS * pull_n.max()
    if pulling.sum() < FEWEST:
        raise InputError(f"{source}: {int(pulling.sum())} readings pull along the gel: give at least {FEWEST}")
    measured, found = side_n[pulling], felt_n[pulling]
    scale = float((measured * found).sum() / max(float((found**2).sum()), 1e-30))
    left = np.hypot(*(measured - scale * found).T) / np.hypot(*measured.T)
    share = float(np.sqrt(np.mean(left**2)))
    if scale <= 0 or share > MOST_SHARE:
        raise InputError(
            f"{source}: one constant leaves {share:.0%} of the forces along the gel: x points right and y down in the "
            "picture, and a force is what pulls the gel; see that forces and pictures belong together"
        )
    return SideFit(side_scale=scale, side_error_share=float(np.hypot(share, LEAST_SHARE)))


def _felt_n(readings: ForceReadings, bundle: Bundle) -> Array:
    """(n, 2) the force along the gel that is felt in each picture."""
    reconstructor, felt = Reconstructor(bundle), []
    with prepared(ImageCamera(readings.images), bundle) as camera:
        for image in readings.images:
            shear = reconstructor.reconstruct(camera.read()).shear
            assert shear, "the bundle has dots and a constant"
            if shear.force_n is None:
                raise InputError(f"{readings.path}: no force along the gel is felt in {image}: {shear.unknown}")
            felt.append(shear.force_n)
    return np.array(felt)
