"""The files of a scan: one a press, with what its overlaps told; each is written whole or not at all."""

import io
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import InputError
from gellight.base.locking import lock
from gellight.base.writing import make_folder, write_file
from gellight.bundle.contents import UNZIPPING, arrays_of, read_file
from gellight.lab.scanning.contact_view import ContactView
from gellight.lab.scanning.pairs import Joint

LOCK = "scan.lock"
NAME = re.compile(r"press-(\d{3,6})\.npz")
_JOINT = [field.name for field in fields(Joint)]


def make_scan_folder(folder: Path) -> None:
    """Make a folder where it is missing; InputError where it cannot be made."""
    try:
        make_folder(folder)
    except OSError as error:
        raise InputError(f"{folder} cannot be made ({error.strerror}): choose another folder") from error


@contextmanager
def alone(folder: Path) -> Iterator[None]:
    """Keep other programs out of a folder; one that was made for this and got nothing is removed at the end.

    Raises InputError where another program scans into it, and where it cannot be made.
    """
    fresh = not folder.exists()
    make_scan_folder(folder)
    try:
        with (folder / LOCK).open("w") as handle:
            if not lock(handle):
                raise InputError(f"another program scans into {folder}: end it, or give another folder")
            yield
    finally:
        if fresh and [path.name for path in folder.iterdir()] == [LOCK]:
            (folder / LOCK).unlink()
            folder.rmdir()


def path_of(folder: Path, number: int) -> Path:
    """Return where a press is kept."""
    return folder / f"press-{number:03}.npz"


def write_press(path: Path, view: ContactView, joints: Sequence[Joint]) -> None:
    """Write a press and its joints with presses before it; raises OSError."""
    arrays: dict[str, NDArray[Any]] = {
        "depth_mm": view.depth_mm,
        "pixel_size_mm": np.array(view.pixel_size_mm),
        "calibration": np.array(view.calibration),
    }
    arrays |= {f"joint_{name}": np.array([getattr(joint, name) for joint in joints]) for name in _JOINT}
    content = io.BytesIO()
    np.savez_compressed(content, **arrays)  # type: ignore[arg-type]
    write_file(path, content.getvalue())


def read_presses(folder: Path) -> tuple[dict[int, ContactView], list[Joint]]:
    """Return the presses of a folder by number, and all joints between them; InputError for a damaged file."""
    views: dict[int, ContactView] = {}
    joints: list[Joint] = []
    for path in sorted(folder.glob("press-*.npz")):
        if named := NAME.fullmatch(path.name):
            views[int(named[1])], told = _read(path)
            joints += told
    return views, [joint for joint in joints if joint.one in views and joint.other in views]


def _read(path: Path) -> tuple[ContactView, list[Joint]]:
    try:
        arrays = arrays_of(read_file(path))
        depth, pixel, calibration = (arrays[name] for name in ("depth_mm", "pixel_size_mm", "calibration"))
        if depth.ndim != 2 or min(depth.shape) < 16 or pixel.shape != (2,) or not np.isfinite(depth).all():
            raise ValueError(f"a depth of shape {depth.shape}")
        joints = [_joint(row) for row in zip(*(arrays[f"joint_{name}"] for name in _JOINT), strict=True)]
        return ContactView(depth.astype(np.float32), (float(pixel[0]), float(pixel[1])), str(calibration)), joints
    except (*UNZIPPING, KeyError, TypeError) as problem:
        raise InputError(f"{path} is no press of a scan ({problem}): remove it, and press there again") from problem


def _joint(row: tuple[Any, ...]) -> Joint:
    one, other, pose, centre, covariance, common, correlation = row
    if pose.shape != (4, 4) or centre.shape != (3,) or covariance.shape != (6, 6):
        raise ValueError(f"a joint with a pose of shape {pose.shape}")
    return Joint(int(one), int(other), pose, centre, covariance, float(common), float(correlation))
