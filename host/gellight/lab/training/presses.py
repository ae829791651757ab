"""Labelled ball presses: a csv beside its images becomes the table that GelNet is trained on.

A ball of known radius gives the slope of the gel at every pixel of its contact circle, because there the gel has the
shape of the ball (section 3.2.3 of the paper).
"""

import csv
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Self

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import InputError
from gellight.bundle.bundle import Bundle
from gellight.frames.dots import Dots
from gellight.frames.image_files import read_image
from gellight.reconstruction.light_drift import difference_of, light_drift

COLUMNS = ("image", "center_x_px", "center_y_px", "contact_radius_px")
RIM = 0.9
"""of the contact radius: beyond it, within a circle that was drawn by hand, the gel has left the ball already"""
QUALITY = "quality"
"""optional column: how well the pattern of a ball fits, of a circle that `detect` found"""
REFUSED = "refused"
"""optional column: why an image is not used; such a row has no circle"""
Floats = NDArray[np.float32]


@dataclass(frozen=True, kw_only=True)
class Ball:
    """The ball that was pressed, as the camera sees it."""

    radius_mm: float
    pixel_size_mm: float

    def __post_init__(self) -> None:
        """Refuse what is no length."""
        for name in ("radius_mm", "pixel_size_mm"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0):
                raise InputError(f"{name} = {value}: give a length greater than 0")

    @property
    def radius_px(self) -> float:
        """Radius in px."""
        return self.radius_mm / self.pixel_size_mm


@dataclass(frozen=True, kw_only=True)
class Press:
    """One press of the ball: its image and its contact circle."""

    image: Path
    center_x_px: float
    center_y_px: float
    contact_radius_px: float
    dots: Dots | None = None
    """the marker dots of the gel, where it has some"""
    found: bool = False
    """whether `detect` found the circle; else a hand may have drawn it"""

    def picture(self) -> NDArray[np.uint8]:
        """Read its image, (H, W, 3) RGB with the dots filled; InputError where it cannot be read."""
        image = read_image(self.image)
        return self.dots.filled(image) if self.dots else image

    def hidden(self) -> NDArray[np.bool_] | None:
        """Mark the (H, W) pixels that dots hide, None where there are none."""
        return self.dots.mask(read_image(self.image)) if self.dots else None


@dataclass(frozen=True, kw_only=True)
class TableOptions:
    """Which pixels of a press are learnt from."""

    inset_px: float = 1.0
    """the outermost ring of the contact circle is left out: there a label that is a pixel off is wrong most"""
    rim_share: float = 1.0
    """of the pixels beyond `RIM` of a contact radius that a hand may have drawn, how many are learnt from"""
    flat_share: float = 0.3
    """untouched pixels, as a share of the contact pixels, with gradient 0"""
    flat_distance: float = 1.9
    """in contact radii from the centre: where the gel counts as untouched"""
    seed: int = 0
    """chooses the untouched pixels"""


@dataclass(frozen=True, kw_only=True, eq=False)
class PressTable:
    """Labelled pixels of several presses."""

    rows: Floats
    """(N, C + 4) change of each channel, x, y in px, d(depth)/dx, d(depth)/dy; the channels are dR, dG, dB in grey
    levels, or those of `series.channel_network`"""
    image: NDArray[np.int32]
    """(N,) number of the image each row comes from, see `images_of`"""
    image_size: tuple[int, int]
    """(W, H) px"""

    @classmethod
    def of(cls, bundle: Bundle) -> Self:
        """Return the table that a bundle was trained on; BundleError where it keeps none."""
        arrays = bundle.presses()
        width, height = (int(size) for size in arrays["image_size"])
        return cls(rows=arrays["rows"], image=arrays["image"], image_size=(width, height))

    def arrays(self) -> dict[str, NDArray[np.generic]]:
        """Return the arrays as they are stored in an npz file."""
        return {"rows": self.rows, "image": self.image, "image_size": np.array(self.image_size, np.int32)}


def read_presses(path: Path, *, ball: Ball, image_shape: tuple[int, int], dots: Dots | None = None) -> list[Press]:
    """Read and check a csv with the columns of `COLUMNS`; the images are beside it, image_shape is (H, W).

    dots: the marker dots of the gel.
    Raises InputError naming file, row and value unless every row is a circle that this ball can make in this image,
    and every image is readable and of that size. A row with a text in the column `REFUSED` is passed over.
    """
    rows = read_rows(path, COLUMNS)
    presses: list[Press] = []
    seen: dict[Press, int] = {}
    for line, row in enumerate(rows, start=2):
        if (row.get(REFUSED) or "").strip():
            continue
        where = f"{path}, line {line}"
        name = (row["image"] or "").strip()
        if not name:
            raise InputError(f"{where}: column image is empty: give the name of the image beside the csv")
        x, y, radius = (number_in(row, column, where) for column in COLUMNS[1:])
        found = bool((row.get(QUALITY) or "").strip())
        circle = {"center_x_px": x, "center_y_px": y, "contact_radius_px": radius}
        press = Press(image=path.parent / name, **circle, found=found, dots=dots)
        _check_circle(press, ball, image_shape, where)
        _check_apart(press, seen, where)
        seen[press] = line
        check_image(press.image, image_shape, where)
        presses.append(press)
    if not presses:
        raise InputError(f"{path} has no presses: add a line for each image with the columns {', '.join(COLUMNS)}")
    return presses


def read_rows(path: Path, columns: Sequence[str]) -> list[dict[str, str | None]]:
    """Read a csv that must have these columns; InputError where it cannot be read or one is missing."""
    try:
        with path.open(newline="", encoding="utf-8-sig") as stream:
            reader = csv.DictReader(stream)
            missing = [column for column in columns if column not in (reader.fieldnames or [])]
            rows = [dict(row) for row in reader]
    except OSError as error:
        raise InputError(f"presses {path} cannot be opened ({error.strerror}): check the name") from error
    except (UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"presses {path} is not a csv file ({error}): save it as UTF-8 text") from error
    if missing:
        raise InputError(f"{path} has no column {', '.join(missing)}: its first line must be {','.join(columns)}")
    return rows


def number_in(row: dict[str, str | None], column: str, where: str) -> float:
    """Return the number in a column of a row; InputError where there is none."""
    text = row[column]
    try:
        value = float(text or "")
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InputError(f"{where}: {column} is {text!r}: give a number in px")
    return value


def _check_circle(press: Press, ball: Ball, image_shape: tuple[int, int], where: str) -> None:
    height, width = image_shape
    x, y, radius = press.center_x_px, press.center_y_px, press.contact_radius_px
    if radius <= 0:
        raise InputError(f"{where}: contact_radius_px is {radius:g}: give a radius greater than 0")
    if radius >= ball.radius_px:
        raise InputError(
            f"{where}: contact_radius_px is {radius:g}, but a ball of radius {ball.radius_mm:g} mm is only "
            f"{ball.radius_px:.2f} px wide at {ball.pixel_size_mm:g} mm per pixel: "
            "correct the circle, the ball radius or the pixel size"
        )
    if not (0 <= x <= width - 1 and 0 <= y <= height - 1):
        raise InputError(
            f"{where}: the circle's centre ({x:g}, {y:g}) px is outside the image of {width} x {height} px: "
            "correct the circle or remove the line"
        )


def _check_apart(press: Press, seen: Mapping[Press, int], where: str) -> None:
    """Refuse a circle that shares gel with another one of the same image: one of the two is wrong."""
    for other, line in seen.items():
        apart = math.hypot(press.center_x_px - other.center_x_px, press.center_y_px - other.center_y_px)
        if press.image == other.image and apart < press.contact_radius_px + other.contact_radius_px:
            raise InputError(
                f"{where}: image {press.image.name} is already in line {line}, and the two circles overlap: keep one"
            )


def images_of(presses: Sequence[Press]) -> NDArray[np.int32]:
    """Number the image of each press, (N,): what is learnt from and what is judged are divided by it.

    Where all presses are in one image, as with a plate of balls, each press counts as an image.
    """
    numbers = {image: number for number, image in enumerate(dict.fromkeys(press.image for press in presses))}
    if len(numbers) == 1:
        return np.arange(len(presses), dtype=np.int32)
    return np.array([numbers[press.image] for press in presses], np.int32)


def check_image(image: Path, image_shape: tuple[int, int], where: str) -> None:
    """Refuse an image that cannot be read, or of another size (H, W) than the reference; InputError."""
    try:
        shape = read_image(image).shape[:2]
    except InputError as error:
        raise InputError(f"{where}: {error}") from error
    if shape != image_shape:
        raise InputError(
            f"{where}: image {image.name} is {shape[1]} x {shape[0]} px, the reference image is "
            f"{image_shape[1]} x {image_shape[0]} px: use images of one camera setting"
        )


def distance_px(press: Press, image_shape: tuple[int, int]) -> Floats:
    """Return the (H, W) distance of each pixel from the centre of the press, px."""
    rows, columns = np.indices(image_shape, dtype=np.float32)
    distance: Floats = np.hypot(columns - press.center_x_px, rows - press.center_y_px).astype(np.float32)
    return distance


def sphere_gradient(press: Press, ball: Ball, image_shape: tuple[int, int]) -> Floats:
    """Return the (H, W, 2) gradient of a gel that has the shape of the ball; NaN beyond the ball's equator.

    The ball is deepest in its centre: depth = sqrt(R^2 - r^2) + constant, so d(depth)/dx = -(x - cx) / sqrt(R^2 - r^2).
    """
    rows, columns = np.indices(image_shape, dtype=np.float64)
    dx, dy = columns - press.center_x_px, rows - press.center_y_px
    below = ball.radius_px**2 - dx**2 - dy**2
    height = np.sqrt(np.where(below > 0, below, np.nan))
    return np.stack([-dx / height, -dy / height], axis=2).astype(np.float32)


def cap_depth_mm(press: Press, ball: Ball, image_shape: tuple[int, int]) -> Floats:
    """Return the (H, W) depth of the ball's cap below its contact circle, mm, negative outside, NaN beyond the ball."""
    r = distance_px(press, image_shape).astype(np.float64)
    below = ball.radius_px**2 - r**2
    rim = math.sqrt(ball.radius_px**2 - press.contact_radius_px**2)
    depth = np.sqrt(np.where(below > 0, below, np.nan)) - rim
    return (depth * ball.pixel_size_mm).astype(np.float32)


def contact_circle(press: Press, image_shape: tuple[int, int]) -> NDArray[np.bool_]:
    """Return the (H, W) pixels inside the labelled contact circle."""
    return distance_px(press, image_shape) < press.contact_radius_px


def build_table(
    presses: Sequence[Press], reference: Floats, ball: Ball, options: TableOptions, *, follow_light: bool = False
) -> PressTable:
    """Build the table of all presses; reference is the (H, W, 3) image of the untouched gel, grey levels.

    With `follow_light` the drift of the light is taken off each difference image, as the frame path then does.
    """
    shape = (reference.shape[0], reference.shape[1])
    random = np.random.default_rng(options.seed)
    parts = [_press_rows(press, presses, reference, ball, options, follow_light, random) for press in presses]
    counts = [len(part) for part in parts]
    return PressTable(
        rows=np.concatenate(parts),
        image=np.repeat(images_of(presses), counts),
        image_size=(shape[1], shape[0]),
    )


def drift_of_presses(presses: Sequence[Press], reference: Floats) -> float:
    """Return how far the light of the presses is from the reference's: root mean square over images and channels."""
    drifts = [light_drift(press.picture().astype(np.float32) - reference) for press in presses]
    return float(np.sqrt(np.mean(np.square(drifts))))


def _flat(press: Press, presses: Sequence[Press], distance: Floats, options: TableOptions) -> NDArray[np.bool_]:
    """Mark the (H, W) pixels that count as untouched, from the distances from one press and all presses."""
    flat = distance > options.flat_distance * press.contact_radius_px
    for other in presses:
        if other.image == press.image and other is not press:
            shape = (distance.shape[0], distance.shape[1])
            flat &= distance_px(other, shape) > options.flat_distance * other.contact_radius_px
    return np.asarray(flat)


def _press_rows(
    press: Press,
    presses: Sequence[Press],
    reference: Floats,
    ball: Ball,
    options: TableOptions,
    follow_light: bool,
    random: np.random.Generator,
) -> Floats:
    """Return the rows of one of the presses; flat are pixels that are far from every press in the same image."""
    shape = (reference.shape[0], reference.shape[1])
    difference = difference_of(press.picture(), reference, follow_light=follow_light)
    distance = distance_px(press, shape)
    hidden = press.hidden()
    if hidden is not None:
        distance[hidden] = np.nan  # neither in contact nor flat: what is filled in was not seen
    contact = np.flatnonzero(distance < press.contact_radius_px - options.inset_px)
    if not len(contact):
        raise InputError(
            f"{press.image}: no pixel is left of a contact circle of {press.contact_radius_px:g} px after an inset "
            f"of {options.inset_px:g} px: press deeper or remove the line"
        )
    if options.rim_share < 1 and not press.found:
        rim = distance.ravel()[contact] > RIM * press.contact_radius_px
        contact = contact[~rim | (random.random(len(contact)) < options.rim_share)]
    far = np.flatnonzero(_flat(press, presses, distance, options))
    flat = random.choice(far, min(len(far), round(options.flat_share * len(contact))), replace=False)
    gradient = sphere_gradient(press, ball, shape).reshape(-1, 2)[contact]
    rows = np.zeros((len(contact) + len(flat), 7), np.float32)
    chosen = np.concatenate([contact, flat])
    rows[:, :3] = difference.reshape(-1, 3)[chosen]
    rows[:, 3], rows[:, 4] = chosen % shape[1], chosen // shape[1]
    rows[: len(contact), 5:] = gradient
    return rows
