"""Circles of many images: what was found or why not, as the csv that training reads, and as pictures for a glance."""

import csv
import io
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import reduce
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import InputError
from gellight.base.writing import write_file
from gellight.frames.dots import Dots
from gellight.frames.image_files import read_image
from gellight.report.pictures import write_png
from gellight.training.labelling.circle import PressCircle, find_circle, find_circles
from gellight.training.labelling.plate import PlateGrid, plate_grid
from gellight.training.presses import COLUMNS, QUALITY, REFUSED, Ball

Array = NDArray[np.float64]
_INK = (255, 255, 255)
_SHADOW = (0, 0, 0)


@dataclass(frozen=True, kw_only=True)
class Detection:
    """What was found in one image: a circle, or the reason why it is not used."""

    image: Path
    circle: PressCircle | None
    refused: str = ""

    def record(self) -> dict[str, object]:
        """Return the circle or the reason by name, rounded, ready for JSON."""
        if self.circle is None:
            return {"image": str(self.image), "refused": self.refused}
        found = self.circle
        return {
            "image": str(self.image),
            "center_x_px": round(found.center_x_px, 2),
            "center_y_px": round(found.center_y_px, 2),
            "contact_radius_px": round(found.contact_radius_px, 2),
            "quality": round(found.quality, 3),
        }


def detect(
    images: Sequence[Path],
    reference: NDArray[np.number],
    ball: Ball,
    *,
    dots: Dots | None = None,
    progress: Callable[[int, int, float], None] = lambda done, total, quality: None,
) -> list[Detection]:
    """Look for the circle in each image; reference is (H, W, 3), grey levels. An image at fault is refused, not raised.

    dots: the marker dots of the gel, which are filled in each image; the reference has none any more.

    progress is called with (images done, images, quality of the last, 0 where it was refused).
    """
    found = []
    for number, path in enumerate(images, start=1):
        try:
            detection = Detection(image=path, circle=_found(path, reference, ball, dots))
        except InputError as error:
            detection = Detection(image=path, circle=None, refused=str(error))
        found.append(detection)
        progress(number, len(images), detection.circle.quality if detection.circle else 0.0)
    return found


def detect_several(
    images: Sequence[Path],
    reference: NDArray[np.number],
    ball: Ball,
    *,
    dots: Dots | None = None,
    pitch_mm: float | None = None,
) -> tuple[list[Detection], PlateGrid | None]:
    """Look for all balls in each image; otherwise as `detect`.

    pitch_mm: distance of neighbours on a plate of balls; what is not in its grid is left out, and the grid of the
    picture with most balls is returned.
    """
    found: list[Detection] = []
    best: PlateGrid | None = None
    for path in images:
        try:
            circles, grid = _balls(path, reference, ball, dots, pitch_mm)
        except InputError as error:
            found.append(Detection(image=path, circle=None, refused=str(error)))
            continue
        found += [Detection(image=path, circle=circle) for circle in circles]
        if grid is not None and (best is None or len(grid.on_grid) > len(best.on_grid)):
            best = grid
    return found, best


def _balls(
    path: Path, reference: NDArray[np.number], ball: Ball, dots: Dots | None, pitch_mm: float | None
) -> tuple[list[PressCircle], PlateGrid | None]:
    """Return the circles of one image, and their grid where the pitch is known; InputError where there is none."""
    image = read_image(path)
    image = dots.filled(image) if dots else image
    seen = list(find_circles(image, reference, ball=ball))
    circles = [one for one in seen if isinstance(one, PressCircle)]
    if not circles:
        raise next((one for one in seen if isinstance(one, InputError)), InputError("no press: nothing has changed"))
    if pitch_mm is None:
        return circles, None
    grid = plate_grid(circles, pitch_mm / ball.pixel_size_mm)
    return [circle for circle, inside in zip(circles, grid.on_grid, strict=True) if inside], grid


def _found(path: Path, reference: NDArray[np.number], ball: Ball, dots: Dots | None) -> PressCircle:
    image = read_image(path)
    return find_circle(dots.filled(image) if dots else image, reference, ball=ball)


def write_presses(path: Path, detections: Sequence[Detection]) -> None:
    """Write the csv that `presses.read_presses` reads, whole or not at all.

    Refused images have a row too, with their reason and no circle; `read_presses` passes over them. Names are relative
    to the folder of the csv, which is made. Raises InputError where it cannot be written.
    """
    text = io.StringIO()
    writer = csv.DictWriter(text, [*COLUMNS, QUALITY, REFUSED], lineterminator="\n")
    writer.writeheader()
    writer.writerows({**one.record(), "image": os.path.relpath(one.image, path.parent)} for one in detections)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_file(path, text.getvalue().encode())
    except OSError as error:
        raise InputError(f"{path} cannot be written ({error.strerror or error}): choose another place") from error


def write_overlays(folder: Path, detections: Sequence[Detection]) -> None:
    """Write NAME.png of each image that was found, with its circle and centre drawn in; InputError where it cannot."""
    circles: dict[Path, list[PressCircle]] = {}
    for detection in detections:
        if detection.circle is not None:
            circles.setdefault(detection.image, []).append(detection.circle)
    stems = [image.stem for image in {detection.image for detection in detections}]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for image, seen in circles.items():
            # Images of one name from two folders must not replace each other.
            name = image.stem if stems.count(image.stem) == 1 else f"{image.parent.name}-{image.stem}"
            target = folder / f"{name}.png"
            if target.resolve() == image.resolve():
                raise InputError(f"the overlay of {image} would replace it: give another folder to --overlay")
            write_png(target, reduce(drawn, seen, read_image(image)))
    except OSError as error:
        raise InputError(
            f"overlays cannot be written to {folder} ({error.strerror or error}): choose another"
        ) from error


def drawn(image: NDArray[np.uint8], circle: PressCircle) -> NDArray[np.uint8]:
    """Draw the circle and its centre into a copy of the (H, W, 3) image, white with a black edge."""
    rows, columns = np.indices(image.shape[:2], dtype=np.float64)
    dx, dy = np.asarray(columns - circle.center_x_px), np.asarray(rows - circle.center_y_px)
    from_line = np.minimum(np.abs(np.hypot(dx, dy) - circle.contact_radius_px), _from_cross(dx, dy))
    picture = image.copy()
    picture[from_line < 1.5] = _SHADOW
    picture[from_line < 0.75] = _INK
    return picture


def _from_cross(dx: Array, dy: Array, arm: float = 4.0) -> Array:
    """Distance of each pixel from a cross at the centre, px."""
    across = np.hypot(np.maximum(np.abs(dx) - arm, 0), dy)
    down = np.hypot(dx, np.maximum(np.abs(dy) - arm, 0))
    return np.asarray(np.minimum(across, down))
