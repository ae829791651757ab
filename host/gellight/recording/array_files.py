"""Tactile frames as arrays: many in one HDF5 file, written by its library, or one in an .npz file.

In HDF5 a picture or a map is a chunk, so that a program reads one frame without the others. Depth and slopes are
rounded to `STEP`, which lets them be packed; nothing else is lost. All figures are arrays of one number, or two, a
frame.
"""

import io
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import InputError, needed
from gellight.base.writing import whole
from gellight.frames.frames import TactileFrame

STEP = 2.0**-14
"""mm of depth, and slope: off by 0.03 um and 0.002 degrees at most"""
REMEDY = "this needs a package: pip install h5py"
Array = NDArray[Any]
Actions = Sequence[Sequence[float]] | NDArray[Any]
"""(frames, k)"""
Append = Callable[[str, Array], None]
"""adds the row of one frame to the array of a name, or many to one that is new"""


def write_arrays(
    frames: Iterable[TactileFrame], path: Path, *, actions: Actions | None = None, **attributes: object
) -> int:
    """Write frames to `path`, an HDF5 file, all or nothing, and return their number.

    actions: a row of numbers for each frame, what was done in it. attributes: of the file. Raises InputError where it
    exists, where the library is missing or actions do not fit, OSError where it cannot be written.
    """
    if path.exists():
        raise InputError(f"{path} exists: choose another folder, or remove it")
    figures: list[dict[str, Any]] = []
    done: list[Sequence[float]] = []
    with whole(path) as partial, _hdf5(partial, {"depth_step_mm": STEP, **attributes}) as append:
        for frame, action in with_actions(frames, actions):
            append("image", frame.camera_frame.image)
            append("depth_mm", on_grid(frame.depth_mm))
            append("gradient_map", on_grid(frame.gradient_map))
            append("contact", frame.contact.mask)
            figures.append(figures_of(frame))
            done += [] if action is None else [action]
        for name in figures[0] if figures else ():
            append(f"figures/{name}", np.array([one[name] for one in figures]))
        if done:
            append("figures/action", np.array(done, np.float32))
    return len(figures)


def with_actions(
    frames: Iterable[TactileFrame], actions: Actions | None
) -> Iterator[tuple[TactileFrame, Sequence[float] | None]]:
    """Yield each frame and what was done in it, None without actions; InputError where their numbers differ."""
    if actions is None:
        yield from ((frame, None) for frame in frames)
        return
    rows = np.asarray(actions, np.float64)
    if rows.ndim != 2 or not np.isfinite(rows).all():
        raise InputError(f"actions of shape {rows.shape}: give a row of finite numbers for each frame")
    number = -1
    for number, frame in enumerate(frames):
        if number == len(rows):
            raise InputError(f"there are {len(rows)} actions, and more frames: give one for each frame")
        yield frame, rows[number].tolist()
    if number + 1 < len(rows):
        raise InputError(f"there are {len(rows)} actions for {number + 1} frames: give one for each frame")


def on_grid(values: NDArray[np.float32]) -> NDArray[np.float32]:
    """Round to multiples of `STEP`, which float32 holds exactly below 1024."""
    return np.round(values / np.float32(STEP)) * np.float32(STEP)


def figures_of(frame: TactileFrame) -> dict[str, Any]:
    """Return the figures of a frame; NaN where nothing touches, no constant for the force is known, or no object."""
    taken, contact, force = frame.camera_frame, frame.contact, frame.force
    side = frame.shear
    return {
        "sequence": taken.sequence,
        "unix_s": taken.stamp.unix_s if taken.stamp else np.nan,
        "indentation_mm": contact.indentation_mm,
        "area_mm2": contact.area_mm2,
        "centroid_mm": contact.centroid_mm or (np.nan, np.nan),
        "force_n": force.normal_n if force else np.nan,
        "force_error_n": force.error_n if force else np.nan,
        "object": frame.pose.number if frame.pose else 0,
        "motion": frame.pose.motion if frame.pose else np.full((4, 4), np.nan),
        "motion_covariance": frame.pose.covariance if frame.pose else np.full((6, 6), np.nan),
        "side_force_n": (side and side.force_n) or (np.nan, np.nan),
        "side_force_error_n": (side and side.force_error_n) or (np.nan, np.nan),
        "torque_nmm": side.torque_nmm if side and side.torque_nmm is not None else np.nan,
    }


@contextmanager
def _hdf5(path: Path, attributes: dict[str, object]) -> Iterator[Append]:
    with needed(REMEDY):
        import h5py
    with _Patient(path) as stream, h5py.File(stream, "w") as file:
        file.attrs.update(attributes)

        def append(name: str, values: Array) -> None:
            if name.startswith("figures/"):
                file.create_dataset(name, data=values)
                return
            if name not in file:
                shape = values.shape
                file.create_dataset(name, (0, *shape), values.dtype, maxshape=(None, *shape), chunks=(1, *shape),
                                    compression="gzip", compression_opts=1, shuffle=True)  # fmt: skip
            file[name].resize(len(file[name]) + 1, axis=0)
            file[name][-1] = values
            stream.check()

        yield append


class _Patient(io.RawIOBase):
    """A file for HDF5, whose library ends the process where a write fails: it is told so afterwards."""

    def __init__(self, path: Path) -> None:
        """Begin a file; OSError where it cannot be made."""
        self._file = path.open("xb+", buffering=0)
        self._failed: OSError | None = None

    def write(self, content: Any) -> int:
        """Write, or remember why not."""
        try:
            left = memoryview(content).cast("B")
            while left:
                left = left[self._file.write(left) :]
        except OSError as error:
            self._failed = self._failed or error
        return memoryview(content).nbytes

    def readinto(self, place: Any) -> int:
        """Read; zeros where nothing could be written."""
        view = memoryview(place).cast("B")
        count = self._file.readinto(view) or 0
        view[count:] = bytes(len(view) - count)
        return len(view)

    def seek(self, offset: int, whence: int = 0) -> int:
        """Go to a byte."""
        return self._file.seek(offset, whence)

    def tell(self) -> int:
        """Return where the next byte is."""
        return self._file.tell()

    def truncate(self, size: int | None = None) -> int:
        """Set the length, or remember why not."""
        try:
            return self._file.truncate(size)
        except OSError as error:
            self._failed = self._failed or error
            return size or 0

    def check(self) -> None:
        """Raise what failed."""
        if self._failed:
            raise self._failed

    def __exit__(self, *problem: object) -> None:
        """Close; raise what failed."""
        self._file.close()
        self.close()
        self.check()


def maps_file(frame: TactileFrame, findings: Sequence[str] = ()) -> bytes:
    """Return the content of an .npz file with the maps of a frame and what is known against it."""
    content = io.BytesIO()
    maps: dict[str, NDArray[Any]] = {
        "gradient_map": frame.gradient_map,
        "normal_map": frame.normal_map,
        "depth_mm": frame.depth_mm,
        "contact": frame.contact.mask,
        "findings": np.array(findings, np.str_),
    }
    maps |= frame.maps_on_request()
    if bounds := frame.error_bounds:
        maps |= {"normal_error_deg": bounds.normal_deg, "shape_error_mm": bounds.shape_mm}
    if frame.force:
        maps |= {"force_n": np.array(frame.force.normal_n), "force_error_n": np.array(frame.force.error_n)}
    np.savez(content, **maps)  # type: ignore[arg-type]
    return content.getvalue()
