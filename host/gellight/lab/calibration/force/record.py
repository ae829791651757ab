"""The record of forces beside pictures or a recording: a CSV file.

image,force_n      one reading for each picture, whose name is beside the file: known weights
unix_s,force_n     a load cell's readings on the clock of `time.time`, beside a recording of the same time

A column `object` names what pressed: then the error on objects that were not weighed is told.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Self

import numpy as np
from numpy.typing import NDArray

from gellight.base.csv_file import number_in, read_csv
from gellight.base.errors import InputError

FORCE, IMAGE, TIME, OBJECT = "force_n", "image", "unix_s", "object"
ENDED = {"side_x_n", "side_y_n"}
NEGATIVE_SHARE = 0.05
"""of the largest force: a load cell that was not set to zero may read this share below it"""
Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, eq=False)
class ForceReadings:
    """The content of the file; one of `images` and `unix_s` is empty."""

    path: Path
    force_n: Array
    """(n,)"""
    images: tuple[Path, ...]
    unix_s: Array
    """(n,), rising"""
    objects: tuple[str, ...] = ()
    """what pressed in each reading; empty where the file does not say"""

    @classmethod
    def read(cls, path: Path) -> Self:
        """Read and check a file; InputError, naming line and value, for what cannot be a record of presses."""
        columns, rows = read_csv(path, "forces")
        if not rows:
            raise InputError(f"{path} has no forces: add a line for each reading")
        at = IMAGE if IMAGE in columns else TIME
        missing = {FORCE, at} - set(columns)
        if missing or {IMAGE, TIME} <= set(columns):
            raise InputError(f"{path}: its first line must be {IMAGE},{FORCE} or {TIME},{FORCE}")
        if ended := sorted(ENDED & set(columns)):
            raise InputError(f"{path}: forces along the gel follow from those into it: leave {', '.join(ended)} out")
        force_n = np.array([number_in(row, FORCE, f"{path}, line {line}") for line, row in rows])
        _check_forces(force_n, path)
        objects = tuple((row[OBJECT] or "").strip() for _, row in rows) if OBJECT in columns else ()
        if at == IMAGE:
            images = tuple(_image(row[IMAGE], path, line) for line, row in rows)
            return cls(path=path, force_n=force_n, images=images, unix_s=np.zeros(0), objects=objects)
        unix_s = np.array([number_in(row, TIME, f"{path}, line {line}") for line, row in rows])
        if (falling := np.flatnonzero(np.diff(unix_s) <= 0)).size:
            raise InputError(
                f"{path}, line {rows[falling[0] + 1][0]}: {TIME} does not rise: give a line for each reading, in order"
            )
        return cls(path=path, force_n=force_n, images=(), unix_s=unix_s, objects=objects)


def _image(text: str | None, path: Path, line: int) -> Path:
    name = (text or "").strip()
    if not name:
        raise InputError(f"{path}, line {line}: column {IMAGE} is empty: give the name of the picture beside the file")
    return path.parent / name


def _check_forces(force_n: Array, path: Path) -> None:
    """Refuse forces that pull: a gel that is pressed pushes back."""
    least, most = float(force_n.min()), float(force_n.max())
    if most <= 0:
        raise InputError(f"{path}: the largest force is {most:g} N: give forces above 0, the gel being pressed")
    if least < -NEGATIVE_SHARE * most:
        raise InputError(
            f"{path}: a force is {least:g} N: set the load cell to zero before the gel is touched, or turn the sign of "
            "the record"
        )
