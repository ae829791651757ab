"""Real units drawn from their calibration: `python -m tests.benchmarks.drawn_units [SET ...]`.

Presses of real sensors are divided as in `real_presses`. Those trained on make a bundle; each press held out is drawn
from its labelled circle: a ball in the elastic layer, sunk until its contact is as wide. Three ways from the slopes of
that surface to colours:

ours      `MeasuredLight`, as `TouchSensor(bundle)` and `sim://?bundle=` draw
table     the polynomial table of Taxim, from the same labelled pixels (`taxim_table`)
untouched the picture of the untouched gel: what a picture without any press is worth

Compared are pictures before noise with the real one, less the drift of its light where the unit follows that: mean
difference in grey levels and the structural similarity (Wang et al., 2004) in the contact circle; `skirt` is the
difference in the ring beside it, from 1.1 to 1.6 radii. Nobody knows how thick the gels are: 4 mm, of the plate 1 mm.
`own circles` are those that `detect` finds, where the others were drawn by hand.

`normals` is the error on the real presses held out in the first fold, degrees, of GelNet trained on as many drawn
pictures of the same ball at random places, and on the real presses: as labelled, and within 0.8 of the radius.
"""

import argparse
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import astuple, dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from gellight.bundle.bundle import Bundle, write_bundle
from gellight.lab.report.pictures import write_png
from gellight.lab.training.presses import Press, distance_px
from gellight.lab.training.table import PressTable, build_table, drift_of_presses
from gellight.lab.training.training import HAND_DRAWN, TrainingOptions
from gellight.reconstruction.light_drift import difference_of
from gellight_touch import Felt, TouchSensor
from gellight_touch.layer import NOTHING
from tests.benchmarks.real_judging import GIVEN, Fold, felt_by, fitted, folds_of, judged, means
from tests.benchmarks.real_presses import PICTURES
from tests.benchmarks.real_sets import SETS, RealSet
from tests.benchmarks.taxim_table import TaximTable
from tests.helpers.places import is_here

Floats = NDArray[np.floating]
DRAWN = (
    "three_lights_crop",
    "three_lights",
    "gelslam",
    "mini",
    "mini, own circles",
    "gripper",
    "gripper, own circles",
    "digit",
)
"""not the dots: their pictures are views of others"""
WAYS = "ours", "table", "untouched"
GRID = 320
"""points along a side of the layer"""
FINGERTIP = {"gel_thickness_mm": 4.0}
PLATE = {"gel_thickness_mm": 1.0, "coating_smoothing_mm": 0.01}
"""balls of .25 mm: its gel shows more detail than one for fingers does"""
OWN_CIRCLES = ", own circles"
RING = 1.1, 1.6
"""contact radii"""
SSIM_SIGMA_PX, C1, C2 = 1.5, (0.01 * 255) ** 2, (0.03 * 255) ** 2
"""of the paper"""


@dataclass(frozen=True)
class Unlike:
    """How a drawn picture differs from the real one."""

    grey: float
    ssim: float
    skirt: float


class Unit:
    """What one fold's training presses make of a sensor."""

    def __init__(self, images: RealSet, training: Sequence[Press], gel: Mapping[str, float]) -> None:
        """Label their pixels as `fit` does."""
        reference, self.ball = images.reference, images.ball
        self.follow_light = drift_of_presses(training, reference.image) > reference.noise_grey
        self.table = build_table(training, reference.image, self.ball, HAND_DRAWN, follow_light=self.follow_light)
        with tempfile.TemporaryDirectory() as folder:
            bundle = _bundle(Path(folder) / "unit", images, self.table, self.follow_light)
        self.touch = TouchSensor(bundle, size=GRID, gel=gel)
        self._depths_mm = np.linspace(0.05, 1, 12) * min(
            self.touch.geometry.deepest_press_mm, 1.5 * self.ball.radius_mm
        )

    def felt(self, presses: Sequence[Press]) -> Felt:
        """Press the ball in all circles of a picture."""
        height, width = self.touch.geometry.image_shape
        size_mm, gap = self.ball.pixel_size_mm, np.full((GRID, GRID), NOTHING)
        for press in presses:
            x_mm, y_mm = (
                (press.center_x_px - (width - 1) / 2) * size_mm,
                (press.center_y_px - (height - 1) / 2) * size_mm,
            )
            depth_mm = float(np.interp(press.contact_radius_px * size_mm, self._radii_mm, self._depths_mm))
            gap = np.minimum(gap, self._gap_mm(x_mm, y_mm, depth_mm))
        return self.touch.feel(gap)

    @cached_property
    def _radii_mm(self) -> Floats:
        """Return the contact radius at each depth."""
        touched = [self.touch.feel(self._gap_mm(0.0, 0.0, depth)).contact.sum() for depth in self._depths_mm]
        return np.sqrt(np.array(touched) / np.pi) * self.touch.layer.spacing_mm

    def _gap_mm(self, x_mm: float, y_mm: float, depth_mm: float) -> Floats:
        at, radius = self.touch.layer.at_mm, self.ball.radius_mm
        below = radius**2 - (at[None, :] - x_mm) ** 2 - (at[:, None] - y_mm) ** 2
        return np.where(below > 0, radius - np.sqrt(np.maximum(below, 0)) - depth_mm, NOTHING)


def _bundle(folder: Path, images: RealSet, table: PressTable, follow_light: bool) -> Bundle:
    reference, size_mm = images.reference, images.ball.pixel_size_mm
    return write_bundle(
        folder, sensor="real", reference=reference.image, reference_frames=reference.frames, metrics={},
        network=b"none", noise_grey=reference.noise_grey, follow_light=follow_light, pixel_size_mm=(size_mm, size_mm),
        presses=table.arrays(),
    )  # fmt: skip


def drawn(unit: Unit, fold: Fold) -> Iterator[dict[str, Unlike]]:
    """Yield how each press held out differs from what each way draws."""
    reference = fold.images.reference.image
    table = TaximTable.fitted(unit.table)
    by_image: dict[Path, list[Press]] = {}
    for press in [*fold.known, *fold.held_out]:
        by_image.setdefault(press.image, []).append(press)
    for press in fold.held_out:
        felt = unit.felt(by_image[press.image])
        _, across, down = unit.touch.surface(felt)
        real = reference + difference_of(press.picture(), reference, follow_light=unit.follow_light)
        pictures = dict(
            zip(WAYS, (unit.touch.grey(felt), reference + table.change(across, down), reference), strict=True)
        )
        yield {way: unlike(picture, real, press) for way, picture in pictures.items()}


def unlike(picture: Floats, real: Floats, press: Press) -> Unlike:
    """Compare two (H, W, 3) pictures inside a contact circle and around it."""
    radii, hidden = distance_px(press, (real.shape[0], real.shape[1])) / press.contact_radius_px, press.hidden()
    seen = np.ones(radii.shape, bool) if hidden is None else ~hidden
    inside, ring = (radii < 1) & seen, (radii > RING[0]) & (radii < RING[1]) & seen
    off = np.abs(np.clip(picture, 0, 255) - real).mean(axis=2)
    return Unlike(float(off[inside].mean()), float(ssim(picture, real)[inside].mean()), float(off[ring].mean()))


def ssim(first: Floats, second: Floats) -> Floats:
    """Return the (H, W) structural similarity of two (H, W, 3) pictures, mean of the colours."""

    def smooth(values: Floats) -> Floats:
        return ndimage.gaussian_filter(np.asarray(values, np.float64), (SSIM_SIGMA_PX, SSIM_SIGMA_PX, 0), truncate=3.5)

    a, b = smooth(first), smooth(second)
    variances = smooth(first**2) - a**2 + smooth(second**2) - b**2
    covariance = smooth(first * second) - a * b
    return np.asarray(((2 * a * b + C1) * (2 * covariance + C2) / ((a**2 + b**2 + C1) * (variances + C2))).mean(axis=2))


def felt_by_drawn(unit: Unit, fold: Fold, folder: Path, options: TrainingOptions) -> Bundle:
    """Calibrate on drawn pictures alone: as many presses as are trained on, as wide, at random places."""
    random = np.random.default_rng(options.seed)
    (height, width), radii = fold.images.reference.image_shape, [one.contact_radius_px for one in fold.training]
    presses = []
    for number, radius in enumerate(random.permutation(radii).tolist()):
        x, y = random.uniform((radius, radius), (width - radius, height - radius)).tolist()
        press = Press(
            image=folder / f"{number}.png", center_x_px=x, center_y_px=y, contact_radius_px=radius, found=True
        )
        write_png(press.image, unit.touch.picture(unit.felt([press])))
        presses.append(press)
    bundle = fitted(presses, fold.images, options)
    # What the real light does no drawn picture shows: the frame path has to follow it as the unit's own bundle does.
    manifest = bundle.manifest.model_copy(update={"follow_light": unit.follow_light})
    return replace(bundle, manifest=manifest)


def measure(name: str) -> Iterator[str]:
    """Yield the lines of one set."""
    with tempfile.TemporaryDirectory(prefix="gellight-drawn-") as place:
        images = SETS[name.removesuffix(OWN_CIRCLES)](Path(place))
        if name.endswith(OWN_CIRCLES):
            images = replace(images, hand=())
        found: dict[str, list[Unlike]] = {way: [] for way in WAYS}
        first: tuple[Unit, Fold] | None = None
        for fold in folds_of(images):
            unit = Unit(images, fold.training, PLATE if name.startswith("three_lights") else FINGERTIP)
            first = first or (unit, fold)
            for press in drawn(unit, fold):
                for way, one in press.items():
                    found[way].append(one)
        for way, each in found.items():
            grey, similar, skirt = np.mean([astuple(one) for one in each], axis=0)
            yield f"{name:22}{way:11}{len(each):4} presses{grey:8.2f} grey{similar:8.3f} SSIM{skirt:8.2f} skirt"
        assert first
        yield from _normals(name, *first, Path(place))


def _normals(name: str, unit: Unit, fold: Fold, place: Path) -> Iterator[str]:
    """Yield what GelNet makes of the presses held out, trained on drawn and on real ones."""
    options = TrainingOptions(recipe="thorough")
    trained = {
        "real": lambda: fitted(fold.training, fold.images, options),
        "drawn": lambda: felt_by_drawn(unit, fold, place, options),
    }
    for by, train in trained.items():
        errors = means(judged(felt_by(train()), fold.images, {GIVEN: fold.held_out})[GIVEN])
        yield (
            f"{name:22}trained on {by:6}{len(fold.held_out):4} presses{errors.normals_deg:8.2f} deg"
            f"{errors.sure_deg:8.2f} deg < 0.8 r{errors.scale:8.3f} scale"
        )


def main() -> None:
    """Print the lines of the sets that are named, or of all whose pictures are here."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sets", nargs="*", default=DRAWN, metavar="SET")
    for name in parser.parse_args().sets:
        pictures = PICTURES.get(name.removesuffix(OWN_CIRCLES))
        if pictures and not is_here(pictures):
            print(f"{name}: its pictures are not here", flush=True)
            continue
        for line in measure(name):
            print(line, flush=True)


if __name__ == "__main__":
    main()
