"""A recording as tactile frames, computed from its pictures, and as files that other programs read."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from importlib.metadata import entry_points
from itertools import islice
from pathlib import Path
from typing import Any

from gellight.base.errors import InputError
from gellight.base.settings import Settings
from gellight.base.writing import whole, write_file
from gellight.bundle.bundle import Bundle, load_bundle
from gellight.cli.showing import show
from gellight.daemon.active_pipeline import path_for
from gellight.daemon.configuration import mode_config
from gellight.frame_path.pipeline import FramePath
from gellight.frames.camera import EndOfStream
from gellight.frames.frames import CaptureStamp, Provenance, TactileFrame
from gellight.frames.picture import prepared
from gellight.frames.point_cloud import ply
from gellight.lab.report.pictures import VideoFile, encode_png, four_panels
from gellight.reconstruction.following import object_follower
from gellight.recording.array_files import maps_file, write_arrays
from gellight.recording.kinds import ONE_FILE, Kind
from gellight.recording.recording_file import Recording
from gellight.recording.replay_camera import ReplayCamera, ReplayUrl
from gellight.watch.findings import gel_thickness_mm


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


VIDEO = "video.mp4"
FPS_FRAMES = 30
"""from this number of frames the frame rate of a video is measured"""


def export(
    file: Path,
    out: Path,
    kind: Kind,
    calibration: str | None,
    *,
    every: int,
    scale_um: float,
    track: bool,
    as_json: bool,
) -> None:
    """Write every n-th frame of a recording into the folder `out`, and show how many; scale_um: of the colours.

    Raises InputError where `track` asks for poses and nothing that tracks is installed; then nothing is written.
    """
    follow = object_follower() if track else None
    recording = Recording(file)
    bundle = load_bundle(calibration) if calibration else None
    felt, used = tactile_frames(recording, bundle), bundle or recording.bundle
    frames = islice(map(follow, felt) if follow else felt, 0, None, every)
    known: dict[str, Any] = {"pixel_size_mm": used.pixel_size_mm, "calibration": used.identity, "source": file.name}
    with _emptied(out):
        match kind:
            case Kind.VIDEO:
                count = _video(frames, out, scale_um, fps_of(recording) / every)
            case Kind.HDF5:
                count = write_arrays(frames, out / ONE_FILE[kind], **known)
            case Kind.LEROBOT:
                write = _writer_beside(kind)
                count = write(
                    frames, out / ONE_FILE[kind], fps=fps_of(recording) / every, task=file.stem, tracked=track
                )
            case _:
                count = sum(_written(frame, out, kind, scale_um, used) for frame in frames)
    if not recording.whole:
        print(f"gellight: the end of {file} is missing: its recording was cut short", file=sys.stderr)
    show({"frames": count, "whole": recording.whole}, as_json, f"{count} frames in {out}")


def _writer_beside(kind: Kind) -> Callable[..., int]:
    """Return what writes a kind that a distribution beside this one knows; InputError where it is not installed."""
    for found in entry_points(group="gellight.exports", name=kind):
        writer: Callable[..., int] = found.load()
        return writer
    raise InputError(
        f"--as {kind} needs LeRobot: in its environment, pip install . ./host/lerobot_camera_gellight from a clone of "
        "GelLight"
    )


@contextmanager
def _emptied(out: Path) -> Iterator[None]:
    """Make a folder, and take it away again where nothing was written; InputError where it cannot be written."""
    there = out.exists()
    try:
        out.mkdir(parents=True, exist_ok=True)
        yield
    except OSError as error:
        why = error.strerror or error
        raise InputError(f"{out} cannot be written ({why}): choose another folder, or free space") from error
    finally:
        if not there:
            with suppress(OSError):  # it holds something
                out.rmdir()


def fps_of(recording: Recording) -> float:
    """Return the frame rate at the beginning of a recording."""
    times_s = [record.info.time_s for record in islice(recording.frames(), FPS_FRAMES)]
    duration_s = times_s[-1] - times_s[0]
    return (len(times_s) - 1) / duration_s if duration_s > 0 else float(FPS_FRAMES)


def _written(frame: TactileFrame, out: Path, kind: Kind, depth_scale_um: float, bundle: Bundle) -> int:
    """Write the file of one frame; return 1."""
    match kind:
        case Kind.NPZ:
            content = maps_file(frame, frame.provenance.findings if frame.provenance else ())
        case Kind.PNG:
            content = encode_png(four_panels(frame, scale_um=depth_scale_um))
        case _:
            seen = bundle.pixel_size_mm, frame.camera_frame.image, bundle.manifest.camera_height_mm
            content = ply(frame.depth_mm, *seen)
    write_file(out / f"{frame.camera_frame.sequence:06}.{kind}", content)
    return 1


def _video(frames: Iterator[TactileFrame], out: Path, depth_scale_um: float, fps: float) -> int:
    """Write the video; return the number of its frames."""
    count = 0
    with whole(out / VIDEO) as partial, VideoFile(partial, fps) as video:
        for frame in frames:
            video.add(four_panels(frame, scale_um=depth_scale_um))
            count += 1
    return count
