"""How deep presses held out are felt over how deep contact mechanics say: `python -m tests.benchmarks.indentations`.

By folds, `fast`: a calibration by `fit` judges itself on its own presses, then on those held out; circles that judge
are those by hand where there are some. The gel's thickness is what is published of
the GelSight Mini (4.25 mm); of the older sensor and the DIGIT nobody says it, and it is a guess there.
"""

import sys
import tempfile
from pathlib import Path

import numpy as np

from gellight.lab.training.judged_fit import fit_judged
from gellight.lab.training.training import Learning
from gellight.lab.training.validation import press_errors
from gellight.reconstruction.force import Layer
from tests.benchmarks.real_judging import folds_of
from tests.benchmarks.real_sets import SETS

THICKNESS_MM = {"mini": 4.25, "gelslam": 4.25, "gripper": 4.25, "skleff": 4.25, "objectfolder": 3.0, "digit": 3.0}


def main(names: list[str]) -> None:
    print(f"{'set':14}{'presses':>8}{'median':>8}{'mean':>8}{'within 15 %':>13}{'nine in ten within':>20}")
    for name in names or list(THICKNESS_MM):
        shares = np.array(felt_over_expected(name))
        off = np.abs(shares - 1)
        figures = f"{np.median(shares):>8.3f}{shares.mean():>8.3f}{(off <= 0.15).mean():>13.0%}"
        print(f"{name:14}{len(shares):>8}{figures}{np.quantile(off, 0.9):>20.0%}", flush=True)


def felt_over_expected(name: str) -> list[float]:
    layer, found = Layer(THICKNESS_MM[name]), []
    with tempfile.TemporaryDirectory() as folder:
        images = SETS[name](Path(folder))
        for fold in folds_of(images):
            place, given = Path(folder) / "bundle", (fold.training, images.reference, images.ball)
            bundle = fit_judged(*given, place, sensor="real", how=Learning(), layer=layer, overwrite=True)
            print(f"{name}: {bundle.manifest.skirt_share:.2f} of the slopes beside contacts count", flush=True)
            errors = press_errors(bundle, fold.held_out, images.ball, layer)
            found += [error.indentation.share for error in errors if error.indentation]
    return found


if __name__ == "__main__":
    main(sys.argv[1:])
