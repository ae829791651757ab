"""Contacts in many images: what was found or why not, as the csv that training reads, and as pictures for a glance."""

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gellight.base.csv_file import csv_text
from gellight.base.errors import InputError
from gellight.base.writing import write_file
from gellight.frames.dots import Dots
from gellight.frames.image_files import read_image
from gellight.lab.report.pictures import with_circle, write_png
from gellight.lab.training.label_file import COLUMNS, QUALITY, REFUSED
from gellight.lab.training.labelling.circle import ARC, PressCircle, find_circle
from gellight.lab.training.presses import Ball

_SAME = 3
"""circles at one place: by chance two presses fall together, not three of the same size"""


@dataclass(frozen=True, kw_only=True)
class Detection:
    """What was found in one image: a contact, or the reason why it is not used."""

    image: Path
    contact: PressCircle | None
    refused: str = ""

    def record(self) -> dict[str, object]:
        """Return the contact or the reason by name, rounded, ready for JSON."""
        found = {"refused": self.refused} if self.contact is None else self.contact.record()
        return {"image": str(self.image), **found}


def detect(
    images: Sequence[Path],
    reference: NDArray[np.number],
    ball: Ball,
    *,
    dots: Dots | None = None,
) -> list[Detection]:
    """Look for the circle in each image; reference is (H, W, 3), grey levels. An image at fault is refused, not raised.

    dots: the marker dots of the gel, which are filled in each image; the reference has none any more.
    """
    found = []
    for path in images:
        try:
            image = read_image(path)
            seen = dots.filled(image) if dots else image
            contact = find_circle(seen, reference, ball=ball, least_view=ARC)
            found.append(Detection(image=path, contact=contact))
        except InputError as error:
            found.append(Detection(image=path, contact=None, refused=str(error)))
    return _refused_touch_of_reference(found)


def _refused_touch_of_reference(found: list[Detection]) -> list[Detection]:
    """Refuse the circles that most pictures show at one place, as large as each other: the reference was touched there.

    A fit with free light takes what is missing for what is there, so it finds the touch of the reference in each.
    """
    known = [one.contact for one in found if one.contact]
    if len(known) < _SAME:
        return found
    circles = np.array([(one.center_x_px, one.center_y_px, one.contact_radius_px) for one in known])
    x, y, radius = np.median(circles, axis=0)
    errors = np.array([(one.center_error_px, one.radius_error_px) for one in known])
    off = np.stack([np.hypot(circles[:, 0] - x, circles[:, 1] - y), np.abs(circles[:, 2] - radius)], axis=1)
    near = np.all(off < 2 * errors + 1, axis=1).tolist()
    same = {id(one) for one, is_near in zip(known, near, strict=True) if is_near}
    if len(same) < max(_SAME, len(known) / 2):
        return found
    why = (
        f"{len(same)} of {len(known)} pictures show one circle, {radius:.0f} px around ({x:.0f}, {y:.0f}) px: the "
        "reference holds a touch there; give one of the untouched gel, and press at different places"
    )
    return [replace(one, contact=None, refused=why) if id(one.contact) in same else one for one in found]


def write_presses(path: Path, detections: Sequence[Detection]) -> None:
    """Write the csv that `presses.read_presses` reads, whole or not at all.

    Refused images have a row too, with their reason and no contact, and are passed over when it is read. Names are
    relative to the folder of the csv, which is made. Raises InputError where it cannot be written.
    """
    columns = next((one.contact.record() for one in detections if one.contact), dict.fromkeys((*COLUMNS[1:], QUALITY)))
    names = [COLUMNS[0], *columns, REFUSED]
    rows = ({**one.record(), "image": os.path.relpath(one.image, path.parent)} for one in detections)
    text = csv_text(names, ([row.get(name, "") for name in names] for row in rows))
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_file(path, text.encode(errors="surrogateescape"))
    except OSError as error:
        raise InputError(f"{path} cannot be written ({error.strerror or error}): choose another place") from error


def write_overlays(folder: Path, detections: Sequence[Detection]) -> None:
    """Write NAME.png of each image that was found, with the contact drawn in; InputError where it cannot."""
    stems = [one.image.stem for one in detections]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for image, contact in ((one.image, one.contact) for one in detections if one.contact):
            # Images of one name from two folders must not replace each other.
            name = image.stem if stems.count(image.stem) == 1 else f"{image.parent.name}-{image.stem}"
            target = folder / f"{name}.png"
            if target.resolve() == image.resolve():
                raise InputError(f"the overlay of {image} would replace it: give another folder to --overlay")
            circle = contact.center_x_px, contact.center_y_px, contact.contact_radius_px
            write_png(target, with_circle(read_image(image), *circle))
    except OSError as error:
        raise InputError(
            f"overlays cannot be written to {folder} ({error.strerror or error}): choose another"
        ) from error
