"""The table of labelled pixels that GelNet learns from: read and checked."""

import zipfile
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

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
    lit: NDArray[np.float32] | None = None
    """(N, 3) change of the colours of the rows as measured lights show a matt gel; None where none were measured"""
    lit_rows: NDArray[np.float32] | None = None
    """(M, 7) rows that the lights show of such a gel all over the view"""

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
        lit = None if self.lit is None else self.lit[mask]
        return replace(self, rows=self.rows[mask], image=self.image[mask], lit=lit)

    def joined(self, other: "Table") -> "Table":
        """Return the table with the rows of another one of the same sensor behind its own."""
        rows, image = np.concatenate([self.rows, other.rows]), np.concatenate([self.image, other.image])
        lit = None if self.lit is None or other.lit is None else np.concatenate([self.lit, other.lit])
        return replace(self, rows=rows, image=image, lit=lit)


def load_table(path: Path) -> Table:
    """Read an npz with rows (N, C + 4), image (N,) and image_size (2,) = W, H; raises TableError.

    It may have untouched (H, W, 3), the picture of the untouched gel, and with it like_rows and like_image, presses of
    a like unit, and lit, lit_rows and like_lit, what measured lights show. The host wrote it: looked at is what presses
    may lack.
    """
    try:
        with np.load(path, allow_pickle=False) as file:
            arrays = {name: file[name] for name in file.files}
        size, parts = arrays["image_size"], [(arrays["rows"], arrays["image"])]
        if "like_rows" in arrays:
            parts.append((arrays["like_rows"], arrays["like_image"]))
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile) as error:
        raise TableError(f"table {path} cannot be read ({error}): give the .npz that the calibration wrote") from error
    table, *like = [checked(rows, image, size, name=str(path)) for rows, image in parts]
    if (untouched := arrays.get("untouched")) is None:
        return table
    if not all(one.gradient.any() for one in (table, *like)):
        raise TableError(f"{path}: all slopes are 0, so nothing was pressed: press the ball into the gel")
    begun = replace(like[0], lit=arrays.get("like_lit")) if like else None
    lit, lit_rows = arrays.get("lit"), arrays.get("lit_rows")
    return replace(table, untouched=untouched.astype(np.float32), like=begun, lit=lit, lit_rows=lit_rows)


def checked(
    rows: NDArray[np.floating], image: NDArray[np.integer], image_size: NDArray[np.integer], *, name: str = "the table"
) -> Table:
    """Return a table of such arrays; raises TableError for one without rows, and for values that are not finite."""
    if not len(rows):
        raise TableError(f"{name}: there are no rows: press the ball into the gel")
    if lost := int((~np.isfinite(rows)).sum()):
        raise TableError(f"{name}: {lost} values are not finite: remove the press that they come from")
    return Table(
        rows=np.ascontiguousarray(rows, dtype=np.float32),
        image=image.astype(np.int32),
        image_size=(int(image_size[0]), int(image_size[1])),
    )
