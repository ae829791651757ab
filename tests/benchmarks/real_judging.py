"""How presses of a real sensor that were not trained on are judged.

Inside a circle the ball says how the gel is shaped:

normals   mean angle between felt and true normal, deg, within the circle and within 0.8 of its radius, where the ball
          touches for sure
depth     mean absolute error within the circle, mm, without its mean, because a circle does not say how deep its rim is
scale     felt depth over the ball's within 0.8 of the radius, by least squares; it does not depend on the radius
"""

import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import astuple, dataclass
from functools import cached_property, partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gellight.bundle.bundle import Bundle
from gellight.frame_path.pipeline import Reconstructor
from gellight.frames.frames import CameraFrame
from gellight.lab.training.labelling.refinement import refine
from gellight.lab.training.presses import Press, cap_depth_mm, distance_px, sphere_gradient
from gellight.lab.training.table import images_of
from gellight.lab.training.training import Learning, TrainingOptions, fit
from gellight.lab.training.validation import frame_of
from gellight.reconstruction.integration import angle_deg, normals
from tests.benchmarks.peer_network import PeerNetwork
from tests.benchmarks.real_sets import RealSet

Floats = NDArray[np.float32]
FOLD_SEED = 1
SURE = 0.8
"""of a contact radius: so far the ball touches the gel, whoever drew the circle"""
GIVEN, REFINED = "as given", "refined"
PLAIN, REFINING, PEER = "GelLight", "GelLight, --refine", "gs_sdk"
WAYS = (PLAIN, REFINING, PEER)


@dataclass(frozen=True)
class Errors:
    """Of one press, by one judge."""

    normals_deg: float
    sure_deg: float
    depth_mm: float
    scale: float


Felt = Callable[[CameraFrame], tuple[Floats, NDArray[np.floating]]]
"""gradient map and depth, mm"""
Judges = Mapping[str, Sequence[Press]]
"""the presses held out, by judge: circles as given, and as `fit --refine` moves each to where its picture shows it"""


@dataclass(frozen=True, kw_only=True, eq=False)
class Fold:
    """What is trained on, and what judges."""

    images: RealSet
    known: Sequence[Press]
    """all that may be trained on"""
    held_out: Sequence[Press]
    drawn: Sequence[int]
    """which of `known` are trained on"""

    @property
    def training(self) -> list[Press]:
        """The presses trained on, as labelled."""
        return [self.known[number] for number in self.drawn]

    @property
    def refined(self) -> list[Press]:
        """The presses trained on, their circles where the pictures show them."""
        return self._refined(self.training)

    @cached_property
    def judges(self) -> Judges:
        """By both judges."""
        return {GIVEN: self.held_out, REFINED: self._refined(self.held_out)}

    def _refined(self, presses: Sequence[Press]) -> list[Press]:
        return refine(presses, self.images.reference.image, self.images.ball).presses


def folds_of(images: RealSet, most: int | None = None, circles: str | None = None) -> Iterator[Fold]:
    """Divide a set by image; most: how many presses of a fold, drawn at random, are trained on.

    circles: whose circles are trained on; those that judge where not given.
    """
    labelled = images.presses if circles is None else images.labelled(circles)
    known, judging = _numbers(labelled, images), _numbers(images.presses, images)
    order = np.random.default_rng(FOLD_SEED).permutation(int(judging.max()) + 1)
    for fold in range(images.folds):
        out = order[fold :: images.folds]
        training = [press for press, number in zip(labelled, known, strict=True) if number not in out]
        held_out = [press for press, number in zip(images.presses, judging, strict=True) if number in out]
        drawn = np.random.default_rng(fold).permutation(len(training))[:most]
        yield Fold(images=images, known=training, held_out=held_out, drawn=sorted(drawn.tolist()))


def _numbers(presses: Sequence[Press], images: RealSet) -> NDArray[np.int32]:
    """Number the image of each press as the circles that judge do; each press of a plate counts as an image."""
    of = images_of(images.presses)
    if len(images.pictures) == 1:
        return of[: len(presses)]
    by_image = {press.image: number for press, number in zip(images.presses, of, strict=True)}
    return np.array([by_image.get(press.image, -1) for press in presses], np.int32)


def errors_of(press: Press, images: RealSet, gradient_map: Floats, depth_mm: NDArray[np.floating]) -> Errors:
    """Compare slopes and depth with the ball inside a circle."""
    shape = images.reference.image_shape
    radii = distance_px(press, shape) / press.contact_radius_px
    inside, sure = radii < 1, radii < SURE
    right = normals(sphere_gradient(press, images.ball, shape))
    cap = cap_depth_mm(press, images.ball, shape)
    left = depth_mm[inside] - cap[inside]
    true, felt = cap[sure] - cap[sure].mean(), depth_mm[sure]
    return Errors(
        normals_deg=float(angle_deg(normals(gradient_map)[inside], right[inside]).mean()),
        sure_deg=float(angle_deg(normals(gradient_map)[sure], right[sure]).mean()),
        depth_mm=float(np.abs(left - left.mean()).mean()),
        scale=float((true * felt).sum() / (true**2).sum()),
    )


def judged(felt: Felt, images: RealSet, judges: Judges) -> dict[str, list[Errors]]:
    """Return the errors of each press by each judge."""
    found: dict[str, list[Errors]] = {by: [] for by in judges}
    for number, press in enumerate(judges[GIVEN]):
        maps = felt(frame_of(press))
        for by, labels in judges.items():
            found[by].append(errors_of(labels[number], images, *maps))
    return found


def learnt(presses: Sequence[Press], images: RealSet, way: str, options: TrainingOptions) -> Felt:
    """Train in one way on labelled presses, and return what it feels."""
    if way == PEER:
        peer = PeerNetwork(presses, images.reference.image, images.ball, seed=options.seed)
        return lambda frame: peer.felt(frame.image, images.ball.pixel_size_mm)
    return felt_by(fitted(presses, images, options))


def fitted(presses: Sequence[Press], images: RealSet, options: TrainingOptions) -> Bundle:
    """Calibrate on labelled presses as they are."""
    how = Learning(options=options)
    with tempfile.TemporaryDirectory() as folder:
        return fit(presses, images.reference, images.ball, Path(folder) / "b", sensor="real", how=how)


def felt_by(bundle: Bundle) -> Felt:
    """Return what a bundle feels."""
    return partial(_felt, Reconstructor(bundle))


def _felt(path: Reconstructor, frame: CameraFrame) -> tuple[Floats, NDArray[np.floating]]:
    found = path.reconstruct(frame)
    return found.gradient_map, found.depth_mm.astype(np.float64)


def means(errors: Sequence[Errors]) -> Errors:
    """Return the mean over presses."""
    return Errors(*np.mean([astuple(one) for one in errors], axis=0).tolist())
