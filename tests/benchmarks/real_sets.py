"""Ball presses on real sensors, as labelled presses: the images lie in ../shared/data beside the checkout."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from gellight.frames.image_files import read_image
from gellight.frames.view import View
from gellight.lab.report.pictures import write_png
from gellight.lab.training.label_file import read_presses
from gellight.lab.training.labelling import detect, write_presses
from gellight.lab.training.presses import Ball, Press
from gellight.lab.training.training import Reference, read_reference
from tests.helpers.places import REAL_IMAGES


@dataclass(frozen=True, kw_only=True, eq=False)
class RealSet:
    """Presses of one ball on one sensor."""

    ball: Ball
    presses: list[Press]
    reference: Reference
    folds: int
    """into how many parts the images are divided"""


def mini(place: Path) -> RealSet:
    """Return 33 presses of a GelSight Mini, their circles drawn by hand."""
    folder = REAL_IMAGES / "gelsight_mini_ball"
    ball, reference = Ball(radius_mm=2.35, pixel_size_mm=0.05107), read_reference(folder / "background.png")
    presses = read_presses(folder / "presses.csv", ball=ball, image_shape=reference.image_shape)
    return RealSet(ball=ball, presses=presses, reference=reference, folds=5)


def digit(place: Path) -> RealSet:
    """Return 41 presses of a DIGIT. Nobody says how large its ball and its pixels are: mm have another scale here."""
    folder = REAL_IMAGES / "digit_ball"
    images = [folder / f"{number:04}.png" for number in range(1, 42)]  # 0000 is the same picture as 0001
    ball = Ball(radius_mm=3.0, pixel_size_mm=0.06)
    return _found(place, images, read_reference(folder / "background_scripts_0000.png"), ball, folds=3)


def dots(place: Path) -> RealSet:
    """Return 12 presses of a home-made sensor that looks from the side, with marker dots."""
    folder = REAL_IMAGES / "dots"
    view = View.of_corners([(33, 58), (208, 61), (185, 244), (56, 250)], (320, 240), (320, 240))
    for name in ("bg-0", *(f"ball-{number}" for number in range(12))):
        write_png(place / f"{name}.png", view.of(read_image(folder / f"{name}.jpg"), name))
    images = [place / f"ball-{number}.png" for number in range(12)]
    return _found(place, images, read_reference(place / "bg-0.png"), Ball(radius_mm=2.42, pixel_size_mm=0.1), folds=4)


def gelslam(place: Path) -> RealSet:
    """Return 44 presses of another GelSight Mini, whose circles `detect` finds."""
    folder = REAL_IMAGES / "gelslam_ball"
    ball = Ball(radius_mm=3.155, pixel_size_mm=0.0634)
    images = [folder / f"{number:04}.png" for number in range(44)]
    return _found(place, images, read_reference(folder / "background.png"), ball, folds=5)


def gripper(place: Path) -> RealSet:
    """Return 51 presses of a GelSight Mini on a gripper, circles by hand in whole px; the pixel is as of `gelslam`."""
    folder = REAL_IMAGES / "gripper_ball"
    ball, reference = Ball(radius_mm=2.5, pixel_size_mm=0.0634), read_reference(folder / "background.png")
    presses = read_presses(folder / "presses.csv", ball=ball, image_shape=reference.image_shape)
    return RealSet(ball=ball, presses=presses, reference=reference, folds=5)


SETS: dict[str, Callable[[Path], RealSet]] = {
    "mini": mini, "gelslam": gelslam, "gripper": gripper, "digit": digit, "dots": dots,
}  # fmt: skip


def _found(place: Path, images: Sequence[Path], reference: Reference, ball: Ball, *, folds: int) -> RealSet:
    """Presses whose circles nobody drew: those that `detect` finds."""
    write_presses(place / "presses.csv", detect(images, reference.image, ball, dots=reference.dots))
    presses = read_presses(
        place / "presses.csv", ball=ball, image_shape=reference.image_shape, dots=reference.dots
    )  # fmt: skip
    return RealSet(ball=ball, presses=presses, reference=reference, folds=folds)
