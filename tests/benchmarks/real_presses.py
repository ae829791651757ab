"""Errors on real presses, beside gs_sdk's method in the same run: `python -m tests.benchmarks.real_presses [SET ...]`.

Presses are divided by image; whatever is judged was not trained on. GelLight takes the training circles as given, and
refined among themselves, as `fit --refine` does; gs_sdk's method (`peer_network`) takes them as given. Two judges: the
circles as given, and circles refined with the response of the light to the training presses. Inside a circle the ball
says how the gel is shaped:

normals   mean angle between felt and true normal, deg, within the circle and within 0.8 of its radius, where the ball
          touches for sure
depth     mean absolute error within the circle, mm, without its mean, because a circle does not say how deep its rim is
scale     felt depth over the ball's within 0.8 of the radius, by least squares; it does not depend on the radius
"""

import argparse
import tempfile
import time
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from dataclasses import astuple, dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gellight.frame_path.pipeline import Reconstructor
from gellight.frames.frames import CameraFrame
from gellight.lab.training.labelling.refinement import FirstFits, refine, refine_others
from gellight.lab.training.presses import Press, cap_depth_mm, distance_px, sphere_gradient
from gellight.lab.training.table import images_of
from gellight.lab.training.training import Learning, TrainingOptions, fit
from gellight.lab.training.validation import frame_of
from gellight.reconstruction.integration import angle_deg, normals
from tests.benchmarks.peer_network import PeerNetwork
from tests.benchmarks.real_sets import SETS, RealSet

Floats = NDArray[np.float32]
FOLD_SEED = 1
SURE = 0.8
"""share of a contact radius: within it the ball touches the gel, whoever drew the circle"""
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
Found = dict[tuple[str, str], list[Errors]]
"""by way and judge"""


@dataclass(frozen=True, kw_only=True)
class Fold:
    """What is trained on, and what judges."""

    training: Sequence[Press]
    refined: Sequence[Press]
    """the same, refined among themselves"""
    judges: dict[str, Sequence[Press]]
    """the presses held out, by judge"""


def folds_of(images: RealSet, most: int | None = None) -> Iterator[Fold]:
    """Divide a set by image; most: how many presses of a fold, drawn at random, are trained on."""
    numbers, ball, reference = images_of(images.presses), images.ball, images.reference.image
    order = np.random.default_rng(FOLD_SEED).permutation(int(numbers.max()) + 1)
    first = FirstFits(reference, ball)
    for fold in range(images.folds):
        held = np.isin(numbers, order[fold :: images.folds])
        training, others = ([p for p, out in zip(images.presses, held, strict=True) if out == kind] for kind in (0, 1))
        refined = refine(training, reference, ball, first=first)
        again = refine_others(refined, others, reference, ball, first=first)
        drawn = np.random.default_rng(fold).permutation(len(training))[:most]
        given, light = ([labels[number] for number in sorted(drawn)] for labels in (training, refined.presses))
        yield Fold(training=given, refined=light, judges={GIVEN: others, REFINED: again})


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


def judge(images: RealSet, options: TrainingOptions, ways: Sequence[str], seeds: int, most: int | None = None) -> Found:
    """Train every way on each fold, with each seed, and judge it on the presses held out."""
    found: Found = defaultdict(list)
    for fold in folds_of(images, most):
        for way, felt in trained(fold, images, options, ways, seeds):
            for number, press in enumerate(fold.judges[GIVEN]):
                maps = felt(frame_of(press))
                for by, labels in fold.judges.items():
                    found[way, by].append(errors_of(labels[number], images, *maps))
    return found


def trained(
    fold: Fold, images: RealSet, options: TrainingOptions, ways: Sequence[str], seeds: int
) -> Iterator[tuple[str, Felt]]:
    """Yield the name of each way, and what a network of it feels, once for each seed."""
    for way, presses in ((PLAIN, fold.training), (REFINING, fold.refined)):
        for seed in range(seeds if way in ways else 0):
            with tempfile.TemporaryDirectory() as folder:
                bundle = fit(
                    presses, images.reference, images.ball, Path(folder) / "b", sensor="real",
                    how=Learning(options=replace(options, seed=seed)),
                )  # fmt: skip
            yield way, partial(_felt, Reconstructor(bundle))
    if PEER in ways:
        peer = PeerNetwork(fold.training, images.reference.image, images.ball)
        yield PEER, lambda frame: peer.felt(frame.image, images.ball.pixel_size_mm)


def _felt(path: Reconstructor, frame: CameraFrame) -> tuple[Floats, NDArray[np.floating]]:
    found = path.reconstruct(frame)
    return found.gradient_map, found.depth_mm.astype(np.float64)


def show(name: str, images: RealSet, found: Found, seconds: float) -> None:
    """Print the means over the presses held out."""
    print(f"\n{name}: {len(images.presses)} presses, {images.folds} folds, {seconds:.0f} s")
    print(f"{'trained':26}{'judged by':11}{'normals':>9}{'< 0.8 r':>9}{'depth mm':>10}{'scale':>15}")
    for (way, by), figures in found.items():
        table = np.array([astuple(one) for one in figures])
        deg, sure, depth, scale = table.mean(axis=0).tolist()
        spread = f"{scale:.3f} +- {table[:, 3].std():.3f}"
        print(f"{way:26}{by:11}{deg:9.2f}{sure:9.2f}{depth:10.4f}{spread:>15}", flush=True)


def main() -> None:
    """Print the figures of each set."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sets", nargs="*", choices=[*SETS, []], metavar="SET", help="all where none is named")
    parser.add_argument("--recipe", default="thorough")
    parser.add_argument("--ways", nargs="+", choices=WAYS, default=WAYS)
    parser.add_argument("--seeds", type=int, default=1, help="networks of each fold and way")
    parser.add_argument("--presses", type=int, help="trained on in each fold, drawn at random; all where not given")
    given = parser.parse_args()
    if given.presses is not None and given.presses < 2:
        parser.error(f"--presses {given.presses}: give at least 2")
    for name in given.sets or SETS:
        begun_s = time.perf_counter()
        with tempfile.TemporaryDirectory() as place:
            images = SETS[name](Path(place))
            found = judge(images, TrainingOptions(recipe=given.recipe), given.ways, given.seeds, given.presses)
        show(name, images, found, time.perf_counter() - begun_s)


if __name__ == "__main__":
    main()
