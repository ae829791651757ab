"""Measure the constant of the force and add it to a bundle."""

from collections.abc import Sequence
from dataclasses import asdict, replace
from datetime import UTC, datetime
from pathlib import Path

from gellight.base.errors import InputError, printable
from gellight.bundle.bundle import Bundle, extend_bundle
from gellight.lab.calibration.force.fit import chosen_layer, fit_force, left_out_share
from gellight.lab.calibration.force.indented import Felt, felt_in_images, felt_in_recording
from gellight.lab.calibration.force.record import ForceReadings
from gellight.lab.calibration.force.sideways import check_sides, with_sides
from gellight.reconstruction.force import Layer
from gellight.reconstruction.force_file import ForceRecord, force_file
from gellight.recording.recording_file import Recording

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
    check_sides(readings, bundle)
    several = len(set(readings.objects)) > 1
    layers = [replace(layer, thickness_mm=share * layer.thickness_mm) for share in (THICKNESSES if several else (1.0,))]
    felt = _felt(readings, bundle, recording, layers)
    chosen = chosen_layer(felt.force_n, felt.integral_mm2, felt.objects) if several else 0
    others = left_out_share(felt.force_n, felt.integral_mm2, felt.objects) if several else 0.0
    fit = fit_force(felt.force_n, felt.integral_mm2[:, chosen], str(forces), least_share=others)
    record = ForceRecord(
        camera_height_mm=camera_height_mm,
        gel_thickness_mm=layers[chosen].thickness_mm,
        other_objects_share=others if several else None,
        poisson_ratio=layer.poisson_ratio,
        **asdict(fit),
        lag_s=round(felt.lag_s, 3),
        source=printable(forces.name),
        created=datetime.now(UTC).replace(microsecond=0),
    )
    return with_sides(record, readings, bundle)


def _felt(readings: ForceReadings, bundle: Bundle, recording: Path | None, layers: Sequence[Layer]) -> Felt:
    if readings.images and recording is not None:
        raise InputError(f"{readings.path} names its pictures: leave --recording out")
    if readings.images:
        return felt_in_images(readings, bundle, layers)
    if recording is None:
        raise InputError(f"{readings.path} has times: give the recording of the same time with --recording")
    return felt_in_recording(readings, Recording(recording), bundle, layers)


def add_force(bundle: Bundle, record: ForceRecord, out: Path, *, overwrite: bool = False) -> Bundle:
    """Write the bundle with the constant as a new one and return it; BundleError where that cannot be."""
    return extend_bundle(bundle, out, force_file(record), overwrite=overwrite)
