"""`gellight export`: a recording as files that other programs read."""

import sys
from collections.abc import Iterator
from dataclasses import replace
from enum import StrEnum
from itertools import islice
from pathlib import Path
from typing import Annotated, Any

import typer

from gellight.base.errors import InputError
from gellight.base.writing import whole, write_file
from gellight.bundle.bundle import Bundle, load_bundle
from gellight.cli.options import AsJson
from gellight.cli.reconstruct import maps_file
from gellight.cli.showing import show
from gellight.frame_path.pipeline import Reconstructor
from gellight.frames.frames import CameraFrame, CaptureStamp, Provenance, TactileFrame
from gellight.frames.point_cloud import ply
from gellight.lab.report.pictures import encode_png, four_panels
from gellight.lab.report.video import VideoFile
from gellight.recording.array_files import write_arrays
from gellight.recording.lerobot_files import write_lerobot
from gellight.recording.recording_file import Recording
from gellight.recording.shard_files import write_shards
from gellight.tracking.following import ObjectFollower

VIDEO = "video.mp4"
FPS_FRAMES = 30
"""from this number of frames the frame rate of a video is measured"""


class Kind(StrEnum):
    """What a recording is turned into."""

    NPZ = "npz"
    PNG = "png"
    PLY = "ply"
    VIDEO = "video"
    HDF5 = "hdf5"
    ZARR = "zarr"
    LEROBOT = "lerobot"
    WEBDATASET = "webdataset"


ONE_FILE = {
    Kind.HDF5: "frames.h5", Kind.ZARR: "frames.zarr", Kind.LEROBOT: "lerobot", Kind.WEBDATASET: "webdataset",
}  # fmt: skip


def command(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A recording of `gellight record`.")],
    out: Annotated[Path, typer.Option(help="Folder for the files; created if need be.")],
    kind: Annotated[Kind, typer.Option("--as", help="A file a frame, a video, arrays or a data set.")] = Kind.NPZ,
    calibration: Annotated[str | None, typer.Option(help="Bundle.", show_default="the recording's own")] = None,
    every: Annotated[int, typer.Option(min=1, help="Take every n-th frame.")] = 1,
    depth_scale_um: Annotated[float, typer.Option(min=1, help="Depth of the brightest colour, micrometres.")] = 1000,
    track: Annotated[
        bool, typer.Option("--track", help="Follow the object: hdf5, zarr, lerobot and webdataset get its pose.")
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Turn a recording into arrays, pictures, surfaces or a video.

    Depth is computed from the recorded pictures. A file is named after the sequence number of its frame; .npz files
    have what those of `gellight reconstruct` have, .ply files are surfaces in mm.
    """
    recording = Recording(file)
    if track and kind not in ONE_FILE:
        raise InputError(f"--track: --as {kind} has no place for a pose: take one of {', '.join(ONE_FILE)}")
    felt = felt_frames(recording, load_bundle(calibration) if calibration else None)
    frames = islice(map(ObjectFollower(on=track).follow, felt), 0, None, every)
    used = recording.bundle
    known: dict[str, Any] = {"pixel_size_mm": used.pixel_size_mm, "calibration": used.identity, "source": file.name}
    try:
        out.mkdir(parents=True, exist_ok=True)
        match kind:
            case Kind.VIDEO:
                count = _video(frames, out, depth_scale_um, fps_of(recording) / every)
            case Kind.WEBDATASET:
                count = write_shards(frames, out / ONE_FILE[kind], task=file.stem, png=encode_png, **known)
            case Kind.HDF5 | Kind.ZARR:
                count = write_arrays(frames, out / ONE_FILE[kind], **known)
            case Kind.LEROBOT:
                count = write_lerobot(frames, out / ONE_FILE[kind], fps=fps_of(recording) / every, task=file.stem,
                                      png=encode_png, tracked=track)  # fmt: skip
            case _:
                count = sum(_written(frame, out, kind, depth_scale_um, recording.bundle) for frame in frames)
    except OSError as error:
        why = error.strerror or error
        raise InputError(f"{out} cannot be written ({why}): choose another folder, or free space") from error
    if not recording.whole:
        print(f"gellight: the end of {file} is missing: its recording was cut short", file=sys.stderr)
    show({"frames": count, "whole": recording.whole}, as_json, f"{count} frames in {out}")


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
            content = ply(frame.depth_mm, bundle.pixel_size_mm, frame.camera_frame.image)
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
