"""What runs now: one configuration, and what was built for it."""

import time
from dataclasses import dataclass, replace
from math import isnan

from gellight.base.settings import ReconstructionSettings
from gellight.bundle.bundle import Bundle
from gellight.daemon.configuration import ModeConfig, PathKind, photometric_groups
from gellight.frame_path.pipeline import FramePath, Reconstructor
from gellight.frame_path.sequence_path import PicturePath, SequencePath
from gellight.frames.camera import Camera
from gellight.frames.frames import CameraFrame, Provenance, TactileFrame
from gellight.frames.status import ForceStatus, TouchStatus
from gellight.photometric.lights_file import read_lights
from gellight.reconstruction.force_file import ForceRecord
from gellight.series.reconstructor import PhotometricReconstructor
from gellight.series.single_light_path import SingleLightPath
from gellight.series.window import WindowReconstructor
from gellight.watch.findings import gel_thickness_mm, impossible_depth
from gellight.watch.monitor import SensorWatch

VERIFIED = ("presses", "depth_mm", "true_depth_mm", "normal_deg")
"""what the status says of the verification of the bundle: see `calibration.records.Verification`"""


def build_pipeline(config: ModeConfig, camera: Camera) -> "ActivePipeline":
    """Build what `config` says for the frames of `camera`, whose pictures are prepared as it says.

    Raises BundleError for a network that cannot be run, or where the bundle does not go with the mode.
    """
    bundle = config.bundle
    thickness_mm = gel_thickness_mm(bundle, config.settings.geometry.gel_thickness_mm)
    rezero = config.settings.watch.rezero
    return ActivePipeline(
        config=config,
        path=path_for(config, bundle),
        watch=SensorWatch(bundle, rezero=rezero, thickness_mm=thickness_mm) if config.watched else None,
        thickness_mm=thickness_mm,
    )


def path_for(config: ModeConfig, bundle: Bundle) -> FramePath:
    """Return the frame path that `config` says, for its bundle or for that with another zero; raises BundleError."""
    options, light = config.settings.reconstruction, config.light
    if config.path is PathKind.PICTURE:
        return PicturePath(bundle)
    if config.path is PathKind.OWN_LIGHTS:
        return SingleLightPath(bundle, options.mode, smoothing_px=options.smoothing_px)
    if config.path in (PathKind.SERIES, PathKind.SLIDING_WINDOW):
        stereo = PhotometricReconstructor if config.path is PathKind.SERIES else WindowReconstructor
        groups = photometric_groups(options, config.settings.lighting)
        return stereo(bundle, light.model or read_lights(bundle), groups, smoothing_px=options.smoothing_px)
    return SequencePath(reconstructor_for(bundle, options), light.groups)


def reconstructor_for(bundle: Bundle, options: ReconstructionSettings) -> Reconstructor:
    """Return the frame path of GelNet with `bundle`; BundleError for a network that cannot be run."""
    return Reconstructor(bundle, smoothing_px=options.smoothing_px, cast_shadows=options.cast_shadows)


@dataclass(frozen=True, kw_only=True)
class ActivePipeline:
    """What every frame goes through."""

    config: ModeConfig
    path: FramePath
    """its bundle has the zero in use"""
    watch: SensorWatch | None = None
    thickness_mm: float | None = None
    """of the gel; None where nobody knows"""

    @property
    def bundle(self) -> Bundle:
        """As it was installed."""
        return self.config.bundle

    @property
    def verified(self) -> dict[str, object] | None:
        """The mean errors of the bundle on fresh presses; None where none were made, or it says nothing of them."""
        figures = self.bundle.metrics.get("verification")
        return {name: value for name, value in figures.items() if name in VERIFIED} if figures else None

    @property
    def force(self) -> dict[str, float] | None:
        """What is known of the force of the bundle; None where it has no constant for it."""
        record = ForceRecord.in_bundle(self.bundle)
        if record is None:
            return None
        return {name: getattr(record, name) for name in ("youngs_modulus_mpa", "error_share", "heaviest_n")}

    def reconstruct(self, frame: CameraFrame) -> TactileFrame:
        """Reconstruct a frame, and say with what that was done."""
        taken_s, stamp = time.monotonic(), frame.stamp
        assert stamp is not None, "the capture thread stamps every frame"
        felt = self.path.reconstruct(frame)
        zeroed, now_s = self.path.bundle, time.monotonic()
        provenance = Provenance(
            calibration=self.bundle.identity,
            zero=zeroed.identity,
            pixel_size_mm=zeroed.pixel_size_mm,
            unix_s=stamp.unix_s,
            ages_s={"taken": taken_s - frame.time_s, "reconstructed": now_s - frame.time_s},
            findings=self._kinds_against(felt),
            gel_thickness_mm=self.thickness_mm,
            camera_height_mm=zeroed.manifest.camera_height_mm,
        )
        return replace(felt, provenance=provenance)

    def _kinds_against(self, frame: TactileFrame) -> tuple[str, ...]:
        """Return the kinds of what is known against a frame, and of what the watch has found."""
        of_frame = impossible_depth(frame, self.thickness_mm)
        watched = self.watch.findings() if self.watch else []
        return tuple(dict.fromkeys(finding.kind for finding in (*of_frame, *watched)))


def contact_summary(frame: TactileFrame) -> TouchStatus | None:
    """Return what a frame feels, ready for JSON; None without a calibration."""
    if isnan(frame.contact.indentation_mm):  # without a calibration nothing is felt
        return None
    force = frame.force
    weighed: ForceStatus | None = None
    if force:
        weighed = {**force.as_json(), "largest_pressure_mpa": float(force.pressure_mpa.max())}
    return {"indentation_mm": frame.contact.indentation_mm, "area_mm2": frame.contact.area_mm2, "force": weighed}
