"""The files of a scan: one a press, with what its overlaps told; each is written whole or not at all."""

import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import fields
from pathlib import Path
from typing import Any, TextIO

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import InputError
from gellight.base.locking import lock
from gellight.base.writing import make_folder, write_file
from gellight.bundle.contents import UNZIPPING, arrays_of, npz, read_file
from gellight_scan.contact_view import ContactView
from gellight_scan.pairs import Joint
from gellight_scan.pose_graph import Solved

LOCK = "scan.lock"
KINDS = {"press": "a flat part", "touch": "a body"}
"""what files are called, and what they are of"""
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
        with _opened(folder / LOCK) as handle:
            if not lock(handle):
                raise InputError(f"another program scans into {folder}: end it, or give another folder")
            yield
    finally:
        if fresh and [path.name for path in folder.iterdir()] == [LOCK]:
            (folder / LOCK).unlink()
            folder.rmdir()


def _opened(path: Path) -> TextIO:
    try:
        return path.open("w")
    except OSError as error:
        raise InputError(f"{path} cannot be written ({error.strerror}): give another folder") from error


def path_of(folder: Path, number: int, kind: str) -> Path:
    """Return where a press is kept."""
    return folder / f"{kind}-{number:03}.npz"


def write_press(path: Path, view: ContactView, joints: Sequence[Joint]) -> None:
    """Write a press and its joints with presses before it; raises OSError."""
    arrays: dict[str, NDArray[Any]] = {
        "depth_mm": view.depth_mm,
        "pixel_size_mm": np.array(view.pixel_size_mm),
        "calibration": np.array(view.calibration),
        "gel_thickness_mm": np.array(view.thickness_mm or 0.0),
    }
    arrays |= {f"joint_{name}": np.array([getattr(joint, name) for joint in joints]) for name in _JOINT}
    write_file(path, npz(arrays))


def read_presses(folder: Path, kind: str) -> tuple[dict[int, ContactView], list[Joint]]:
    """Return the presses of a folder by number, and all joints between them.

    Raises InputError for a damaged file, and for a folder with presses of another kind.
    """
    for other, of in KINDS.items():
        if other != kind and any(folder.glob(f"{other}-*.npz")):
            raise InputError(f"{folder} holds the scan of {of}, this is one of {KINDS[kind]}: give another folder")
    views: dict[int, ContactView] = {}
    joints: list[Joint] = []
    for path in sorted(folder.glob(f"{kind}-*.npz")):
        if named := re.fullmatch(rf"{kind}-(\d{{3,6}})\.npz", path.name):
            views[int(named[1])], told = _read(path)
            joints += told
    return views, [joint for joint in joints if joint.one in views and joint.other in views]


def _read(path: Path) -> tuple[ContactView, list[Joint]]:
    try:
        arrays = arrays_of(read_file(path))
        depth, pixel, calibration = (arrays[name] for name in ("depth_mm", "pixel_size_mm", "calibration"))
        if depth.ndim != 2 or min(depth.shape) < 16 or not np.isfinite(depth).all():
            raise ValueError(f"a depth of shape {depth.shape}")
        if pixel.shape != (2,) or not (np.isfinite(pixel).all() and (pixel > 0).all()):
            raise ValueError(f"pixels of {pixel} mm")
        thickness = arrays.get("gel_thickness_mm", np.zeros(()))  # presses of before do not tell
        if thickness.shape != () or not 0 <= thickness < np.inf:
            raise ValueError(f"a gel of {thickness} mm")
        joints = [_joint(row) for row in zip(*(arrays[f"joint_{name}"] for name in _JOINT), strict=True)]
        size = float(pixel[0]), float(pixel[1])
        return ContactView(depth.astype(np.float32), size, str(calibration), float(thickness) or None), joints
    except (*UNZIPPING, KeyError, TypeError) as problem:
        raise InputError(f"{path} is no press of a scan ({problem}): remove it, and press there again") from problem


def _joint(row: tuple[Any, ...]) -> Joint:
    one, other, pose, centre, covariance, common, correlation = row
    if pose.shape != (4, 4) or centre.shape != (3,) or covariance.shape != (6, 6):
        raise ValueError(f"a joint with a pose of shape {pose.shape}")
    numbers = np.concatenate([pose.ravel(), centre, covariance.ravel(), [common, correlation]])
    if not np.isfinite(numbers).all() or np.linalg.eigvalsh(covariance).min() <= 0:
        raise ValueError("a joint whose pose or covariance is none")
    return Joint(int(one), int(other), pose, centre, covariance, float(common), float(correlation))


class KeptPresses:
    """The presses of one sensor in a folder, what pairs of them told, and where they lie."""

    kind: str

    def __init__(self, folder: Path) -> None:
        """Read what is there; InputError where it cannot be read or made."""
        self.folder = folder
        make_scan_folder(folder)
        self.views, self.joints = read_presses(folder, self.kind)
        self.solved = Solved({}, ())
        for number, view in self.views.items():
            self.refuse_other(view, path_of(folder, number, self.kind).name)

    @property
    def next_number(self) -> int:
        """Of the press that comes next."""
        return max(self.views, default=-1) + 1

    @property
    def first(self) -> int:
        """The press in whose axes the map is: that with the lowest number."""
        return min(self.views)

    @property
    def placed(self) -> list[int]:
        """The presses whose place is known."""
        return sorted(self.solved.poses)

    def has(self, view: ContactView) -> bool:
        """Say whether a press is there already, as where a recording is taken again."""
        return any(np.array_equal(view.depth_mm, one.depth_mm) for one in self.views.values())

    def keep(self, number: int, view: ContactView, joints: Sequence[Joint]) -> None:
        """Write a press and its joints with those before it; InputError where it cannot be written."""
        self.write(lambda: write_press(path_of(self.folder, number, self.kind), view, joints))
        self.views[number] = view
        self.joints += joints

    def write(self, write: Callable[[], None]) -> None:
        """Write a file; InputError where it cannot be."""
        try:
            write()
        except OSError as error:
            raise InputError(f"{self.folder} cannot be written ({error.strerror}): make room, and go on") from error

    def refuse_other(self, view: ContactView, source: str) -> None:
        """Refuse what another sensor felt, or this one with other pixels."""
        first = self.views[self.first] if self.views else view
        if view.depth_mm.shape != first.depth_mm.shape or not np.allclose(view.pixel_size_mm, first.pixel_size_mm):
            raise InputError(
                f"{source} has {_pixels(view)}, the scan in {self.folder} {_pixels(first)}: give it another folder"
            )
        if view.calibration != first.calibration:
            raise InputError(
                f"{source} is of another sensor or calibration ({view.calibration[:12]}) than the scan in "
                f"{self.folder} ({first.calibration[:12]}): give it another folder"
            )


def _pixels(view: ContactView) -> str:
    height, width = view.depth_mm.shape
    return f"{width} x {height} pixels of {view.pixel_size_mm[0]:g} mm"
