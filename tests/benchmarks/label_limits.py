"""What decides two limits of calibration, on real sets: `python -m tests.benchmarks.label_limits circles|wrong [SET]`.

circles   how well `detect` says that it knows the centres of whole circles, in ball radii, with no limit; and normals
          of presses held out (of those that are known best, or by circles of a hand) without the least certain
          circles, and without as many at random
wrong     normals of presses held out, by their labels as `fit` judges them, where the labels are right and where they
          are wrong: x and y exchanged, the circle of another picture, mirrored
"""

import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from unittest.mock import patch

import numpy as np

from gellight.lab.training.labelling import circle, detect
from gellight.lab.training.presses import Press
from gellight.lab.training.training import TrainingOptions
from tests.benchmarks.real_judging import GIVEN, PLAIN, folds_of, judged, learnt
from tests.benchmarks.real_sets import OWN, SETS, RealSet

OPTIONS = TrainingOptions(recipe="fast")
SETS_OF_ONE_BALL = ("mini", "gelslam", "gripper", "digit", "dots")
BEST, SHARES = 0.7, (0.7, 0.85, 1.0)
"""shares of the circles by how certain they are: those that judge where no hand drew any, and those trained on"""


def errors_told(images: RealSet) -> dict[Path, float]:
    """Return the error of the centre that each picture's circle is told with, in ball radii."""
    found = detect(images.pictures, images.reference.image, images.ball, dots=images.reference.dots)
    known = [(one.image, one.contact) for one in found if isinstance(one.contact, circle.PressCircle)]
    return {image: contact.center_error_px / images.ball.radius_px for image, contact in known}


def without_uncertain(images: RealSet, told: dict[Path, float]) -> Iterator[str]:
    """Yield held-out normals for each share of the circles, and for as many circles at random."""
    best = np.quantile(list(told.values()), BEST)
    for share in SHARES:
        limit, kept, some = np.quantile(list(told.values()), share), [], []
        for number, fold in enumerate(folds_of(images, None, OWN)):
            certain = [press for press in fold.training if told[press.image] <= limit]
            drawn = np.random.default_rng(number).permutation(len(fold.training))[: len(certain)]
            judges = {GIVEN: [one for one in fold.held_out if images.hand or told[one.image] <= best]}
            for presses, errors in ((certain, kept), ([fold.training[n] for n in drawn], some)):
                errors += judged(learnt(presses, images, PLAIN, OPTIONS), images, judges)[GIVEN]
        means = [np.mean([one.normals_deg for one in errors]) for errors in (kept, some)]
        yield f"up to {limit:.2f}: {means[0]:.2f} deg, as many at random {means[1]:.2f}"


def wrongly_labelled(images: RealSet) -> dict[str, Sequence[Press]]:
    """Return the presses with right labels, and with wrong ones."""
    height, width = images.reference.image_shape
    right, after = list(images.hand), [*images.hand[1:], images.hand[0]]
    swapped = [replace(one, center_x_px=one.center_y_px, center_y_px=one.center_x_px) for one in right]
    return {
        "right": right,
        "x and y exchanged": [one for one in swapped if one.center_x_px < width and one.center_y_px < height],
        "of another picture": [replace(one, image=other.image) for one, other in zip(right, after, strict=True)],
        "mirrored": [replace(one, center_x_px=width - 1 - one.center_x_px) for one in right],
    }


def held_out_deg(presses: Sequence[Press], images: RealSet) -> float:
    """Return the mean error of the normals of a third of the presses, which is not trained on."""
    order = np.random.default_rng(1).permutation(len(presses))
    felt = learnt([presses[n] for n in sorted(order[len(order) // 3 :])], images, PLAIN, OPTIONS)
    errors = judged(felt, images, {GIVEN: [presses[n] for n in order[: len(order) // 3]]})[GIVEN]
    return float(np.nanmean([one.normals_deg for one in errors]))


def main() -> None:
    """Print one of both tables."""
    what, names = sys.argv[1], sys.argv[2:]
    for name in names or (SETS_OF_ONE_BALL if what == "circles" else ("mini", "gripper")):
        with ExitStack() as stack:
            stack.enter_context(patch.object(circle, "_MOST_ERROR", np.inf))
            images = SETS[name](Path(stack.enter_context(tempfile.TemporaryDirectory())))
            if what == "wrong":
                for labels, presses in wrongly_labelled(images).items():
                    print(f"{name:10}{labels:20}{held_out_deg(presses, images):6.1f} deg", flush=True)
                continue
            told = errors_told(images)
            print(f"{name:10}{len(told)} circles, told to {np.quantile(list(told.values()), [0, 0.5, 1]).round(3)} R")
            for line in without_uncertain(images, told):
                print(f"{'':10}{line}", flush=True)


if __name__ == "__main__":
    main()
