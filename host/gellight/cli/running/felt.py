"""The tactile frames of a recording, computed from its pictures."""

from collections.abc import Iterator
from dataclasses import replace

from gellight.bundle.bundle import Bundle
from gellight.frame_path.pipeline import Reconstructor
from gellight.frames.frames import CameraFrame, CaptureStamp, Provenance, TactileFrame
from gellight.recording.recording_file import Recording


def felt_frames(recording: Recording, bundle: Bundle | None) -> Iterator[TactileFrame]:
    """Yield the tactile frames of a recording, by `bundle` or by the one that was in use at each frame."""
    reconstructor: Reconstructor | None = None
    for record in recording.frames():
        info, source = record.info, str(recording.path)
        wanted = bundle or recording.bundles[info.zero]
        if reconstructor is None or reconstructor.bundle is not wanted:
            reconstructor = Reconstructor(wanted)
        stamp = CaptureStamp(zeroed=wanted, unix_s=info.unix_s)
        image = record.image(source)
        taken = CameraFrame(image=image, time_s=info.time_s, sequence=info.sequence, source=source, stamp=stamp)
        provenance = Provenance(
            calibration=(bundle or recording.bundle).identity,
            zero=wanted.identity,
            pixel_size_mm=wanted.pixel_size_mm,
            unix_s=info.unix_s,
            ages_s={},
        )
        yield replace(reconstructor.reconstruct(taken), provenance=provenance)
