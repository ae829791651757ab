"""Tactile frames in one file of arrays, HDF5 or Zarr, written by their libraries.

A picture or a map is a chunk, so that a program reads one frame without the others. Depth and slopes are rounded to
`STEP`, which lets them be packed; nothing else is lost. All figures are arrays of one number, or two, a frame.
"""

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import InputError
from gellight.frames.frames import TactileFrame

STEP = 2.0**-14
"""mm of depth, and slope: off by 0.03 um and 0.002 degrees at most"""
REMEDY = 'this needs packages: pip install "gellight[arrays]"'
Array = NDArray[Any]
Append = Callable[[str, Array], None]
"""adds the row of one frame to the array of a name, or many to one that is new"""


def write_arrays(frames: Iterable[TactileFrame], path: Path, **attributes: object) -> int:
    """Write frames to `path`, a .h5 file or a .zarr folder, and return their number.

    attributes: of the file. Raises InputError where it exists, where the library is missing, or without frames.
    """
    if path.exists():
        raise InputError(f"{path} exists: choose another folder, or remove it")
    figures: list[dict[str, Any]] = []
    kind = _hdf5 if path.suffix == ".h5" else _zarr
    with kind(path, {"depth_step_mm": STEP, **attributes}) as append:
        for frame in frames:
            append("image", frame.camera_frame.image)
            append("depth_mm", on_grid(frame.depth_mm))
            append("gradient_map", on_grid(frame.gradient_map))
            append("contact", frame.contact.mask)
            figures.append(_figures(frame))
        for name in figures[0] if figures else ():
            append(f"figures/{name}", np.array([one[name] for one in figures]))
    return len(figures)


def on_grid(values: NDArray[np.float32]) -> NDArray[np.float32]:
    """Round to multiples of `STEP`, which float32 holds exactly below 1024."""
    return np.round(values / np.float32(STEP)) * np.float32(STEP)


def _figures(frame: TactileFrame) -> dict[str, Any]:
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
    try:
        import h5py
    except ImportError:
        raise InputError(REMEDY) from None
    with h5py.File(path, "x") as file:
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

        yield append


@contextmanager
def _zarr(path: Path, attributes: dict[str, object]) -> Iterator[Append]:
    try:
        import zarr
        from zarr.codecs import BloscCodec
    except ImportError:
        raise InputError(REMEDY) from None
    group = zarr.create_group(path, attributes=attributes)

    def append(name: str, values: Array) -> None:
        if name.startswith("figures/"):
            group.create_array(name, data=values)
            return
        if name not in group:
            packed = BloscCodec(cname="zstd", clevel=3, shuffle="shuffle")
            group.create_array(name, shape=(0, *values.shape), chunks=(1, *values.shape), dtype=values.dtype,
                               compressors=packed)  # fmt: skip
        group[name].append(values[None])

    yield append
