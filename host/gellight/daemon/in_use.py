"""The bundle that a sensor runs with, and what is said of it and of its frames."""

import time
from dataclasses import dataclass, replace
from math import isnan

from gellight.bundle.bundle import Bundle
from gellight.frames.frames import CameraFrame, FrameJudge, Provenance, TactileFrame
from gellight.reconstruction.force_file import read_force
from gellight.reconstruction.pipeline import FramePath
from gellight.watch.monitor import SensorWatch

VERIFIED = ("presses", "depth_mm", "true_depth_mm", "normal_deg")
"""what the status says of the verification of the bundle: see `calibration.records.Verification`"""


@dataclass(frozen=True, kw_only=True)
class InUse:
    """What belongs to the running bundle."""

    bundle: Bundle
    """as it was installed: a zero that followed the light is not in it"""
    reconstructor: FramePath
    watch: SensorWatch | None
    selfcheck: FrameJudge | None

    @property
    def verified(self) -> dict[str, object] | None:
        """The mean errors of the bundle on fresh presses; None where none were made, or it says nothing of them."""
        figures = self.bundle.metrics.get("verification")
        return {name: value for name, value in figures.items() if name in VERIFIED} if figures else None

    @property
    def force(self) -> dict[str, float] | None:
        """What is known of the force of the bundle; None where it has no constant for it."""
        record = read_force(self.bundle)
        if record is None:
            return None
        return {name: getattr(record, name) for name in ("youngs_modulus_mpa", "error_share", "heaviest_n")}

    def reconstruct(self, frame: CameraFrame) -> TactileFrame:
        """Reconstruct a frame, and say with what that was done."""
        taken_s = time.monotonic()
        felt = self.reconstructor.reconstruct(frame)
        zeroed, now_s = self.reconstructor.bundle, time.monotonic()
        provenance = Provenance(
            calibration=self.bundle.identity,
            zero=zeroed.identity,
            pixel_size_mm=zeroed.pixel_size_mm,
            unix_s=time.time() - (now_s - frame.time_s),
            ages_s={"taken": taken_s - frame.time_s, "reconstructed": now_s - frame.time_s},
            findings=tuple(finding.kind for finding in self.watch.findings()) if self.watch else (),
        )
        return replace(felt, provenance=provenance)


def touch_of(frame: TactileFrame) -> dict[str, object] | None:
    """Return what a frame feels, ready for JSON; None without a calibration.

    Keys: indentation_mm, area_mm2 and force: None where the bundle has no constant for it, or normal_n, error_n,
    flags and largest_pressure_mpa.
    """
    if isnan(frame.contact.indentation_mm):  # without a calibration nothing is felt
        return None
    force = frame.force
    weighed = {**force.as_json(), "largest_pressure_mpa": float(force.pressure_mpa.max())} if force else None
    return {"indentation_mm": frame.contact.indentation_mm, "area_mm2": frame.contact.area_mm2, "force": weighed}
