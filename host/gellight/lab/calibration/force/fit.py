"""The modulus of the gel from forces and what the sensor felt under them.

The layer of `reconstruction.force` makes of a depth map the integral q of its pressure for a modulus of 1, so a force
is F = E q. E is fitted to all readings, each weighed by the share of error that a force has. What the fit leaves is the
error: readings above a fifth of the heaviest give its share, the lighter ones and those without contact its floor. The
share is never below `SHAPE_SHARE`: one object says nothing of how well another one is weighed. Where several objects
were weighed, each is left out in turn, and its forces are told by the others.
"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from gellight.base.errors import InputError, printable
from gellight.bundle.bundle import Bundle
from gellight.lab.calibration.force.indented import Felt, felt_in_images, felt_in_recording
from gellight.lab.calibration.force.record import ForceReadings
from gellight.reconstruction.force import Layer
from gellight.reconstruction.force_file import ForceRecord
from gellight.recording.recording_file import Recording

Array = NDArray[np.float64]

SHAPE_SHARE = 0.05
"""error of the force on other objects than the one that was weighed, on the finite-element gel (docs/force.md)"""
FEWEST = 3
"""readings in contact"""
LEAST_RANK = 0.8
"""correlation of the ranks of forces and answers, where the forces differ by `SPREAD`: they must rise together"""
SPREAD = 1.5  # chosen: largest over smallest force; below, ranks tell nothing
BETTER_BY = 0.9
"""another thickness than the one that is given must leave less than this share of the error"""
MOST_SHARE = 0.3
"""a worse fit than that is no calibration"""
LIGHT_SHARE = 0.2
"""of the heaviest reading: lighter ones tell the floor of the error"""
UNFELT_SHARE = 0.2
"""of the heaviest reading: so large a force must be felt"""


@dataclass(frozen=True, kw_only=True)
class ForceFit:
    """The constant and how well it explains the readings."""

    youngs_modulus_mpa: float
    error_share: float
    error_floor_n: float
    readings: int
    """in contact"""
    lightest_n: float
    heaviest_n: float


def fit_force(force_n: Array, integral_mm2: Array, source: str, *, least_share: float = 0.0) -> ForceFit:
    """Fit the modulus to (n,) forces and the (n,) integrals of the pressure for a modulus of 1.

    least_share: of the error, which is known to be so large on other objects. Raises InputError, naming `source` and
    the reason, for readings that cannot be explained by one modulus.
    """
    felt = (integral_mm2 > 0) & (force_n > 0)
    heaviest = float(force_n.max())
    _check_contact(force_n, integral_mm2, felt, heaviest, source)
    modulus = _modulus(force_n[felt], integral_mm2[felt], heaviest)
    left = force_n - modulus * integral_mm2
    heavy = force_n >= LIGHT_SHARE * heaviest
    share = float(np.sqrt(np.mean((left[heavy] / force_n[heavy]) ** 2)))
    if share > MOST_SHARE:
        raise InputError(
            f"{source}: one modulus leaves {share:.0%} of the forces: press objects that are smaller than the view, "
            "upright and slowly, and see that forces and pictures belong together"
        )
    light = left[~heavy]
    return ForceFit(
        youngs_modulus_mpa=modulus,
        error_share=max(float(np.hypot(share, SHAPE_SHARE)), least_share),
        error_floor_n=float(np.sqrt(np.mean(light**2))) if light.size else LIGHT_SHARE * share * heaviest,
        readings=int(felt.sum()),
        lightest_n=float(force_n[felt].min()),
        heaviest_n=heaviest,
    )


def chosen_layer(force_n: Array, integral_mm2: Array, objects: Sequence[str]) -> int:
    """Return which of the layers, (n, layers) integrals, tells objects best that were left out; 0 is the one given."""
    scores = [_rms(_told_by_others(force_n, column, objects)) for column in integral_mm2.T]
    best = int(np.argmin(scores))
    return best if scores[best] < BETTER_BY * scores[0] else 0


def left_out_share(force_n: Array, integral_mm2: Array, objects: Sequence[str]) -> float:
    """Return the error on an object by modulus and layer of the others, as a share of the force, rms over objects."""
    names, left = np.array(objects), []
    for name in sorted(set(objects)):
        own = names == name
        others = names[~own].tolist()
        layer = chosen_layer(force_n[~own], integral_mm2[~own], others) if len(set(others)) > 1 else 0
        told = _told_by_others(force_n, integral_mm2[:, layer], objects)
        left.append(told[own & (force_n >= LIGHT_SHARE * force_n.max())])
    return float(np.sqrt(np.mean([_rms(part) ** 2 for part in left if part.size])))


def _told_by_others(force_n: Array, integral_mm2: Array, objects: Sequence[str]) -> Array:
    """Return the error of each reading by the modulus of the other objects, as a share of its force."""
    names, heaviest = np.array(objects), float(force_n.max())
    error = np.zeros(len(force_n))
    for name in set(objects):
        own = names == name
        modulus = _modulus(force_n[~own], integral_mm2[~own], heaviest)
        error[own] = modulus * integral_mm2[own] / np.maximum(force_n[own], LIGHT_SHARE * heaviest) - 1
    return np.where(force_n >= LIGHT_SHARE * heaviest, error, 0.0)


def _modulus(force_n: Array, integral_mm2: Array, heaviest: float) -> float:
    weights = 1 / np.maximum(force_n, LIGHT_SHARE * heaviest) ** 2
    square = float((weights * integral_mm2**2).sum())
    return float((weights * force_n * integral_mm2).sum()) / square if square else 0.0


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _check_contact(force_n: Array, integral_mm2: Array, felt: NDArray[np.bool_], heaviest: float, source: str) -> None:
    """Refuse readings without enough contact, and those whose forces and depths do not rise together."""
    unfelt = (force_n >= UNFELT_SHARE * heaviest) & (integral_mm2 == 0)
    if unfelt.any():
        raise InputError(
            f"{source}: nothing is felt in {int(unfelt.sum())} of {len(force_n)} readings, the largest of "
            f"{float(force_n[unfelt].max()):g} N: give pictures of the pressed gel, and the bundle of this sensor"
        )
    if felt.sum() < FEWEST:
        raise InputError(f"{source}: {int(felt.sum())} readings in contact: give at least {FEWEST}")
    if force_n[felt].max() < SPREAD * force_n[felt].min():
        return
    rank = float(stats.spearmanr(force_n[felt], integral_mm2[felt]).statistic)
    if not rank >= LEAST_RANK:
        raise InputError(
            f"{source}: force and depth do not rise together (rank correlation {rank:.2f}, at least {LEAST_RANK} is "
            "needed): see that forces and pictures belong together and that their clocks agree"
        )


THICKNESSES = (1.0, 0.7, 0.85, 1.2, 1.4)
"""of the layer as it is given: tried where several objects were weighed, for they tell them apart"""


def measure_force(
    bundle: Bundle, forces: Path, recording: Path | None, layer: Layer, camera_height_mm: float | None = None
) -> ForceRecord:
    """Fit the constants of the forces of a sensor; InputError, with the reason, where that cannot be.

    forces: see `record.ForceReadings`. recording: beside a record with times. camera_height_mm: above the gel, where
    it is known.
    """
    readings = ForceReadings.read(forces)
    several = len(set(readings.objects)) > 1
    layers = [replace(layer, thickness_mm=share * layer.thickness_mm) for share in (THICKNESSES if several else (1.0,))]
    felt = _felt(readings, bundle, recording, layers)
    chosen = chosen_layer(felt.force_n, felt.integral_mm2, felt.objects) if several else 0
    others = left_out_share(felt.force_n, felt.integral_mm2, felt.objects) if several else 0.0
    fit = fit_force(felt.force_n, felt.integral_mm2[:, chosen], str(forces), least_share=others)
    return ForceRecord(
        camera_height_mm=camera_height_mm,
        gel_thickness_mm=layers[chosen].thickness_mm,
        other_objects_share=others if several else None,
        poisson_ratio=layer.poisson_ratio,
        **asdict(fit),
        lag_s=round(felt.lag_s, 3),
        source=printable(forces.name),
        created=datetime.now(UTC).replace(microsecond=0),
    )


def _felt(readings: ForceReadings, bundle: Bundle, recording: Path | None, layers: Sequence[Layer]) -> Felt:
    if readings.images and recording is not None:
        raise InputError(f"{readings.path} names its pictures: leave --recording out")
    if readings.images:
        return felt_in_images(readings, bundle, layers)
    if recording is None:
        raise InputError(f"{readings.path} has times: give the recording of the same time with --recording")
    return felt_in_recording(readings, Recording(recording), bundle, layers)
