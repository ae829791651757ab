"""The csv of labels beside its images: read and checked, with file, line and value in every refusal."""

import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from gellight.base.csv_file import number_in, read_rows
from gellight.base.errors import InputError
from gellight.frames.dots import Dots
from gellight.frames.image_files import read_image
from gellight.frames.view import View
from gellight.lab.training.presses import Ball, Press

COLUMNS = ("image", "center_x_px", "center_y_px", "contact_radius_px")
QUALITY = "quality"
"""optional column: how well the pattern of a ball fits, of a circle that `detect` found"""
REFUSED = "refused"
"""optional column: why an image is not used; such a row has no circle"""


def read_presses(
    path: Path, *, ball: Ball, image_shape: tuple[int, int], dots: Dots | None = None, view: View | None = None
) -> list[Press]:
    """Read and check a csv with the columns of `COLUMNS`; the images are beside it, image_shape is (H, W).

    dots: the marker dots of the gel. view: the smaller one of the images that ball, shape, dots and what is returned
    are of.
    Raises InputError naming file, row and value unless every row is a circle that this ball can make in this image,
    and every image is readable and of that size. A row with a text in the column `REFUSED` is passed over.
    """
    if view:
        ball, image_shape = replace(ball, pixel_size_mm=ball.pixel_size_mm * view.scale), view.taken_shape
    presses: list[Press] = []
    seen: dict[Press, int] = {}
    for line, row in read_rows(path, "presses", COLUMNS):
        if (row.get(REFUSED) or "").strip():
            continue
        where = f"{path}, line {line}"
        name = (row["image"] or "").strip()
        if not name:
            raise InputError(f"{where}: column image is empty: give the name of the image beside the csv")
        x, y, radius = (number_in(row, column, where) for column in COLUMNS[1:])
        found = bool((row.get(QUALITY) or "").strip())
        place = path.parent / name
        press = Press(image=place, center_x_px=x, center_y_px=y, contact_radius_px=radius, found=found, dots=dots)
        _check_circle(press, ball, image_shape, where)
        _check_apart(press, seen, where)
        seen[press] = line
        check_image(press.image, image_shape, where)
        presses.append(press)
    if not presses:
        raise InputError(f"{path} has no presses: add a line for each image with the columns {', '.join(COLUMNS)}")
    return [press.within(view) for press in presses] if view else presses


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
    if math.hypot(x - min(max(round(x), 0), width - 1), y - min(max(round(y), 0), height - 1)) >= radius:
        raise InputError(
            f"{where}: the circle around ({x:g}, {y:g}) px, {radius:g} px in radius, holds no pixel of the image of "
            f"{width} x {height} px: correct the circle or remove the line"
        )


def _check_apart(press: Press, seen: Mapping[Press, int], where: str) -> None:
    """Refuse a circle that shares gel with another one of the same image: one of the two is wrong."""
    for other, line in seen.items():
        apart = math.hypot(press.center_x_px - other.center_x_px, press.center_y_px - other.center_y_px)
        if press.image == other.image and apart < press.contact_radius_px + other.contact_radius_px:
            raise InputError(
                f"{where}: image {press.image.name} is already in line {line}, and the two circles overlap: keep one"
            )


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
