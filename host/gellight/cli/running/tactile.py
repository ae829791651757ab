"""The tactile frames of a recording, computed from its pictures."""

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace

from gellight.base.settings import Settings
from gellight.bundle.bundle import Bundle
from gellight.daemon.active_pipeline import path_for
from gellight.daemon.configuration import mode_config
from gellight.frame_path.pipeline import FramePath
from gellight.frames.camera import EndOfStream
from gellight.frames.frames import CaptureStamp, Provenance, TactileFrame
from gellight.frames.picture import prepared
from gellight.recording.recording_file import Recording
from gellight.recording.replay_camera import ReplayCamera, ReplayUrl
from gellight.watch.possible import gel_thickness_mm


def tactile_frames(recording: Recording, bundle: Bundle | None) -> Iterator[TactileFrame]:
    """Yield the tactile frames of a recording, by `bundle` or by the one that was in use at each frame.

    They are those of a replay, with the times of the recording.
    """
    camera = ReplayCamera(recording, url=str(recording.path), chosen=ReplayUrl(speed=0, start=0))
    shown = prepared(camera, bundle or recording.bundle)
    path: FramePath | None = None
    with suppress(EndOfStream):
        while True:
            frame, info = shown.read(), camera.record.info
            wanted = bundle or recording.bundles[info.zero]
            if path is None or path.bundle is not wanted:
                path = path_for(mode_config(wanted, Settings()), wanted)
            stamp = CaptureStamp(zeroed=wanted, unix_s=info.unix_s)
            provenance = Provenance(
                calibration=(bundle or recording.bundle).identity,
                zero=wanted.identity,
                pixel_size_mm=wanted.pixel_size_mm,
                unix_s=info.unix_s,
                ages_s={},
                gel_thickness_mm=gel_thickness_mm(wanted),
                camera_height_mm=wanted.manifest.camera_height_mm,
            )
            yield replace(path.reconstruct(replace(frame, time_s=info.time_s, stamp=stamp)), provenance=provenance)
