"""The table of labelled pixels that GelNet learns from: read and checked."""

import zipfile
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gelnet.parameters import CHANNELS, PLACE, channel_names

SLOPES = ("gx", "gy")


class TableError(ValueError):
    """The table cannot be learnt from; the message says what is wrong, where, and what to do."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Table:
    """Labelled pixels of several images of one sensor."""

    rows: NDArray[np.float32]
    """(N, C + 4) change of each of C channels in grey levels (image minus reference), x, y in px, d(depth)/dx,
    d(depth)/dy; the channels are red, green and blue, or three or more single lights"""
    image: NDArray[np.int32]
    """(N,) which image each row comes from"""
    image_size: tuple[int, int]
    """(W, H) px"""
    untouched: NDArray[np.float32] | None = None
    """(H, W, 3) picture of the untouched gel, grey levels; None where it is not known or the channels are others"""
    like: "Table | None" = None
    """presses of a unit like this one, as they would be under this one's light: what the teacher begins with"""

    @property
    def pixels(self) -> NDArray[np.float32]:
        """(N, C + 2) what the network sees."""
        return np.ascontiguousarray(self.rows[:, : -len(SLOPES)])

    @property
    def gradient(self) -> NDArray[np.float32]:
        """(N, 2) what it is to answer."""
        return np.ascontiguousarray(self.rows[:, -len(SLOPES) :])

    @property
    def press_distance_px(self) -> float:
        """Mean distance between neighbouring presses if they cover the image evenly, px."""
        width, height = self.image_size
        return float(np.sqrt(width * height / len(np.unique(self.image))))

    def chosen(self, mask: NDArray[np.bool_] | NDArray[np.intp]) -> "Table":
        """Return the table of the chosen rows."""
        return replace(self, rows=self.rows[mask], image=self.image[mask])

    def joined(self, other: "Table") -> "Table":
        """Return the table with the rows of another one of the same sensor behind its own."""
        rows, image = np.concatenate([self.rows, other.rows]), np.concatenate([self.image, other.image])
        return replace(self, rows=rows, image=image)


def load_table(path: Path) -> Table:
    """Read and check an npz with rows (N, C + 4), image (N,) and image_size (2,) = W, H; raises TableError.

    It may have untouched (H, W, 3), the picture of the untouched gel, and with it like_rows and like_image, presses of
    a like unit.
    """
    try:
        with np.load(path, allow_pickle=False) as file:
            arrays = {name: file[name] for name in file.files}
    except (OSError, ValueError, EOFError, zipfile.BadZipFile) as error:
        raise TableError(f"table {path} cannot be read ({error}): give the .npz that the calibration wrote") from error
    missing = sorted({"rows", "image", "image_size"} - set(arrays))
    if missing:
        raise TableError(f"table {path} has no {', '.join(missing)}: it needs rows, image and image_size")
    table = checked(arrays["rows"], arrays["image"], arrays["image_size"], name=str(path))
    if (untouched := arrays.get("untouched")) is None:
        return table
    width, height = table.image_size
    if untouched.shape != (height, width, 3) or table.pixels.shape[1] != 5 or not np.isfinite(untouched).all():
        raise TableError(
            f"{path}: untouched has shape {untouched.shape} for an image of {width} x {height} px and rows of "
            f"{table.rows.shape[1]} columns: it is a picture of that size, finite, and goes with rows of three colours"
        )
    _check_slopes(table, str(path))
    if (rows := arrays.get("like_rows")) is None:
        return replace(table, untouched=untouched.astype(np.float32))
    if "like_image" not in arrays:
        raise TableError(f"{path} has like_rows and no like_image: the two go together")
    name = f"{path}, the like unit"
    like = checked(rows, arrays["like_image"], arrays["image_size"], name=name)
    if like.pixels.shape[1] != 5:
        raise TableError(f"{name}: its rows have {rows.shape[1]} columns, the teacher takes three colours")
    _check_slopes(like, name)
    return replace(table, untouched=untouched.astype(np.float32), like=like)


def _check_slopes(table: Table, name: str) -> None:
    if not table.gradient.any():
        raise TableError(f"{name}: all slopes are 0, so nothing was pressed: press the ball into the gel")


def checked(rows: NDArray[Any], image: NDArray[Any], image_size: NDArray[Any], *, name: str = "the table") -> Table:
    """Return a table after every check; raises TableError."""
    least = (*CHANNELS, *PLACE, *SLOPES)
    if rows.ndim != 2 or rows.shape[1] < len(least):
        raise TableError(
            f"{name}: rows has shape {rows.shape}, expected (N, {len(least)} or more) = {', '.join(least)}"
        )
    if len(rows) == 0:
        raise TableError(f"{name}: there are no rows: press the ball into the gel")
    if image.shape != (len(rows),) or not np.issubdtype(image.dtype, np.integer):
        raise TableError(f"{name}: image is {image.shape} {image.dtype}, expected ({len(rows)},) whole numbers")
    if image_size.shape != (2,) or image_size.dtype.kind not in "iuf" or not (image_size >= 2).all():
        raise TableError(f"{name}: image_size is {image_size.tolist()}, expected width and height in px")
    _check_values(rows, name)
    _check_places(rows, image_size, name)
    return Table(
        rows=np.ascontiguousarray(rows, dtype=np.float32),
        image=image.astype(np.int32),
        image_size=(int(image_size[0]), int(image_size[1])),
    )


def columns(rows: NDArray[Any]) -> tuple[str, ...]:
    """Return the names of the columns."""
    return *channel_names(rows.shape[1] - len(PLACE) - len(SLOPES)), *PLACE, *SLOPES


def _check_values(rows: NDArray[Any], name: str) -> None:
    names = columns(rows)
    try:
        bad = ~np.isfinite(rows)
    except TypeError as error:
        raise TableError(f"{name}: rows are {rows.dtype}, expected float32") from error
    if bad.any():
        row, column = (int(i) for i in np.argwhere(bad)[0])
        raise TableError(
            f"{name}: row {row}, column {names[column]} is {rows[row, column]} "
            f"({int(bad.sum())} such values): remove the press it comes from"
        )


def _check_places(rows: NDArray[Any], image_size: NDArray[Any], name: str) -> None:
    names, first = columns(rows), rows.shape[1] - len(PLACE) - len(SLOPES)
    for column, limit in ((first, int(image_size[0])), (first + 1, int(image_size[1]))):
        outside = (rows[:, column] < 0) | (rows[:, column] > limit - 1)
        if outside.any():
            row = int(np.argmax(outside))
            raise TableError(
                f"{name}: row {row}, column {names[column]} is {rows[row, column]}, outside the image of {limit} px"
            )
