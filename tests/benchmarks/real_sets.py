"""Ball presses on real sensors, as labelled presses. `places.real` says where the pictures of each are."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gellight.frames.image_files import read_grey, read_image
from gellight.frames.view import View
from gellight.lab.report.pictures import write_png
from gellight.lab.training.label_file import read_presses
from gellight.lab.training.labelling.detection import detect, write_presses
from gellight.lab.training.presses import Ball, Press
from gellight.lab.training.training import Reference, read_reference
from tests.helpers.places import REAL_CROPS, real

Floats = NDArray[np.floating]
HAND, OWN = "hand", "own"
"""who drew the circles: a person, or `detect`"""


@dataclass(frozen=True, kw_only=True, eq=False)
class RealSet:
    """Presses of one ball on one sensor."""

    ball: Ball
    reference: Reference
    folds: int
    """into how many parts the images are divided"""
    place: Path
    """an empty folder for what `detect` finds"""
    pictures: Sequence[Path]
    hand: Sequence[Press] = ()
    """circles that a person drew; none where nobody did"""

    @cached_property
    def own(self) -> list[Press]:
        """Circles that `detect` finds; pictures that it refuses have none."""
        write_presses(
            self.place / "own.csv", detect(self.pictures, self.reference.image, self.ball, dots=self.reference.dots)
        )
        return self._read(self.place / "own.csv")

    @property
    def presses(self) -> list[Press]:
        """The circles that judge: by hand where somebody drew some."""
        return list(self.hand) or self.own

    def labelled(self, circles: str) -> list[Press]:
        """Return the presses with circles of HAND or OWN."""
        return list(self.hand) if circles == HAND else self.own

    def _read(self, path: Path) -> list[Press]:
        return read_presses(
            path, ball=self.ball, image_shape=self.reference.image_shape, dots=self.reference.dots
        )  # fmt: skip


def _by_hand(place: Path, folder: Path, ball: Ball, without: Sequence[str] = ()) -> RealSet:
    reference = read_reference(folder / "background.png")
    labels, shape = folder / "presses.csv", reference.image_shape
    every = read_presses(labels, ball=ball, image_shape=shape, dots=reference.dots)
    presses = [press for press in every if press.image.name not in without]
    images = [press.image for press in presses]
    return RealSet(ball=ball, reference=reference, folds=5, place=place, pictures=images, hand=presses)


def mini(place: Path) -> RealSet:
    """Return 33 presses of a GelSight Mini, their circles drawn by hand."""
    return _by_hand(place, real("gelsight_mini_ball"), Ball(radius_mm=2.35, pixel_size_mm=0.05107))


def gripper(place: Path) -> RealSet:
    """Return 50 presses of a GelSight Mini on a gripper, with marker dots; the pixel is as of `gelslam`.

    Circles are by hand in whole px. Picture 0050 is left out: its label is that of 0049, the ball is 72 px away.
    """
    ball = Ball(radius_mm=2.5, pixel_size_mm=0.0634)
    return _by_hand(place, real("gripper_ball"), ball, without=("0050.png",))


def skleff(place: Path) -> RealSet:
    """Return 25 presses of one more GelSight Mini, circles by hand in whole px. Of 0050 the label is 85 px away."""
    ball = Ball(radius_mm=4.735, pixel_size_mm=0.0634)
    return _by_hand(place, real("skleff_mini_ball"), ball, without=("0050.png",))


def objectfolder(place: Path) -> RealSet:
    """Return 49 deep presses of an older GelSight, 160 x 120 px, whose circles `detect` finds."""
    folder, ball = real("objectfolder_ball"), Ball(radius_mm=2.0, pixel_size_mm=0.1245)
    images = sorted(folder.glob("[0-9]*.png"))
    reference = read_reference(folder / "background.png")
    return RealSet(ball=ball, reference=reference, folds=5, place=place, pictures=images)


def digit(place: Path) -> RealSet:
    """Return 41 presses of a DIGIT. Nobody says how large its ball and its pixels are: mm have another scale here."""
    folder = real("digit_ball")
    images = [folder / f"{number:04}.png" for number in range(1, 42)]  # 0000 is the same picture as 0001
    reference, ball = read_reference(folder / "background_scripts_0000.png"), Ball(radius_mm=3.0, pixel_size_mm=0.06)
    return RealSet(ball=ball, reference=reference, folds=3, place=place, pictures=images)


def dots(place: Path) -> RealSet:
    """Return 12 presses of a home-made sensor that looks from the side, with marker dots."""
    folder = real("dots")
    view = View.of_corners([(33, 58), (208, 61), (185, 244), (56, 250)], (320, 240), (320, 240))
    for name in ("bg-0", *(f"ball-{number}" for number in range(12))):
        write_png(place / f"{name}.png", view.of(read_image(folder / f"{name}.jpg"), name))
    images, ball = [place / f"ball-{number}.png" for number in range(12)], Ball(radius_mm=2.42, pixel_size_mm=0.1)
    return RealSet(ball=ball, reference=read_reference(place / "bg-0.png"), folds=4, place=place, pictures=images)


def gelslam(place: Path) -> RealSet:
    """Return 44 presses of another GelSight Mini, whose circles `detect` finds."""
    folder, ball = real("gelslam_ball"), Ball(radius_mm=3.155, pixel_size_mm=0.0634)
    images = [folder / f"{number:04}.png" for number in range(44)]
    reference = read_reference(folder / "background.png")
    return RealSet(ball=ball, reference=reference, folds=5, place=place, pictures=images)


def three_lights(place: Path) -> RealSet:
    """Return the 28 balls of a plate under three of six lights as red, green and blue, centres by the plate's maker."""
    folder = real("oem_six_lights")
    for kind in ("balls", "flat"):
        write_png(place / f"{kind}.png", _in_colour(folder, f"{kind}_light"))
    centres = np.loadtxt(folder / "balls.csv", delimiter=",", skiprows=1)
    return _plate(place, place / "balls.png", place / "flat.png", centres, pixel_size_mm=0.0068069)


def groove() -> NDArray[np.uint8]:
    """Return (1024, 612, 3) RGB of a straight groove under these lights, where `three_lights` has its balls."""
    return np.ascontiguousarray(_in_colour(real("oem_groove"), "light")[:, :612])


def _in_colour(folder: Path, names: str) -> NDArray[np.uint8]:
    """(H, W, 3) lights 1, 3 and 5 as red, green and blue."""
    lights = [read_grey(folder / f"{names}{number}.png", 1020) for number in (1, 3, 5)]
    return np.rint(np.stack(lights, axis=2)).clip(0, 255).astype(np.uint8)


def three_lights_crop(place: Path) -> RealSet:
    """Return 12 of these balls in pixels twice as large: the crop that comes along."""
    folder = REAL_CROPS / "three_lights"
    centres = [(74.27 + 146.89 * i - 2.65 * j, 62.29 + 2.54 * i + 147.16 * j) for j in range(3) for i in range(4)]
    return _plate(place, folder / "press.png", folder / "untouched.png", np.array(centres) / 2, pixel_size_mm=0.0136138)


PLATE_CIRCLE = 0.95
"""contact radius over the ball's: so far the balls of that plate touch the gel for sure"""


def _plate(place: Path, image: Path, flat: Path, centres: Floats, *, pixel_size_mm: float) -> RealSet:
    ball = Ball(radius_mm=0.2465, pixel_size_mm=pixel_size_mm)
    presses = [
        Press(image=image, center_x_px=x, center_y_px=y, contact_radius_px=PLATE_CIRCLE * ball.radius_px)
        for x, y in centres.tolist()
    ]
    reference = read_reference(flat)
    return RealSet(ball=ball, reference=reference, folds=4, place=place, pictures=[image], hand=presses)


SETS: dict[str, Callable[[Path], RealSet]] = {
    "mini": mini, "gelslam": gelslam, "gripper": gripper, "digit": digit,
    "skleff": skleff, "objectfolder": objectfolder, "dots": dots,
    "three_lights": three_lights, "three_lights_crop": three_lights_crop,
}  # fmt: skip
