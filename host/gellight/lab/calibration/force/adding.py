"""Measure the constant of the force and add it to a bundle."""

from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path

from gellight.base.errors import InputError
from gellight.bundle.bundle import Bundle, extend_bundle
from gellight.lab.calibration.force.fit import fit_force
from gellight.lab.calibration.force.indented import Felt, felt_in_images, felt_in_recording
from gellight.lab.calibration.force.record import ForceReadings
from gellight.reconstruction.force import Layer
from gellight.reconstruction.force_file import ForceRecord, force_file
from gellight.recording.recording_file import Recording


def measure_force(bundle: Bundle, forces: Path, recording: Path | None, layer: Layer) -> ForceRecord:
    """Fit the constant of the force of a sensor; InputError, with the reason, where that cannot be.

    forces: see `record.ForceReadings`. recording: beside a record with times.
    """
    readings = ForceReadings.read(forces)
    felt = _felt(readings, bundle, recording, layer)
    fit = fit_force(felt.force_n, felt.integral_mm2, str(forces))
    return ForceRecord(
        gel_thickness_mm=layer.thickness_mm,
        poisson_ratio=layer.poisson_ratio,
        **asdict(fit),
        lag_s=round(felt.lag_s, 3),
        source=forces.name,
        created=datetime.now(UTC).replace(microsecond=0),
    )


def _felt(readings: ForceReadings, bundle: Bundle, recording: Path | None, layer: Layer) -> Felt:
    if readings.images and recording is not None:
        raise InputError(f"{readings.path} names its pictures: leave --recording out")
    if readings.images:
        return felt_in_images(readings, bundle, layer)
    if recording is None:
        raise InputError(f"{readings.path} has times: give the recording of the same time with --recording")
    return felt_in_recording(readings, Recording(recording), bundle, layer)


def add_force(bundle: Bundle, record: ForceRecord, out: Path, *, overwrite: bool = False) -> Bundle:
    """Write the bundle with the constant as a new one and return it; BundleError where that cannot be."""
    return extend_bundle(bundle, out, force_file(record), overwrite=overwrite)
