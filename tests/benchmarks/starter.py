"""What a bundle of other units is worth: `python -m tests.benchmarks.starter [--recipe fast]`.

Of three GelSight Mini each is felt by a bundle that learnt on the presses of the other two (`calibrate starter`), with
its own untouched picture: normals within the circles, beside a guess that the gel is flat, and beside a bundle of its
own presses, which were learnt from.
"""

import argparse
import tempfile
from pathlib import Path

import numpy as np

from gellight.lab.training.presses import sphere_gradient
from gellight.lab.training.starter import make_starter
from gellight.lab.training.training import Learning, TrainingOptions, fit
from gellight.lab.training.validation import evaluate
from tests.benchmarks.real_sets import RealSet, gelslam, gripper, mini

SETS = {"mini": mini, "gelslam": gelslam, "gripper": gripper}


def flat_deg(one: RealSet) -> float:
    """Return the mean slope of the balls within their circles, degrees: the error of a flat guess."""
    angles = []
    for press in one.presses:
        rows, columns = np.indices(one.reference.image_shape)
        inside = np.hypot(columns - press.center_x_px, rows - press.center_y_px) < press.contact_radius_px
        slopes = sphere_gradient(press, one.ball, one.reference.image_shape)[inside]
        angles.append(np.degrees(np.arctan(np.linalg.norm(slopes, axis=-1))))
    return float(np.concatenate(angles).mean())


def main() -> None:
    """Print a line for each unit."""
    parser = argparse.ArgumentParser(prog="python -m tests.benchmarks.starter", description=__doc__)
    parser.add_argument("--recipe", default="fast")
    options = TrainingOptions(recipe=parser.parse_args().recipe)
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        for name in SETS:
            (place / f"{name}-set").mkdir()
        sets = {name: make(place / f"{name}-set") for name, make in SETS.items()}
        own = {name: fit(one.presses, one.reference, one.ball, place / name, sensor=name, how=Learning(options=options))
               for name, one in sets.items()}  # fmt: skip
        for name, one in sets.items():
            others = [bundle for other, bundle in own.items() if other != name]
            rough = make_starter(
                others, one.reference, one.ball.pixel_size_mm, place / f"{name}-starter", options=options
            )
            felt, learnt = (evaluate(bundle, one.presses, one.ball) for bundle in (rough, own[name]))
            print(
                f"{name:<8} learnt on others {felt.normal_error_deg.mean:.1f} degrees, {felt.depth_mae_mm:.3f} mm, "
                f"contact {felt.contact_iou:.2f}; flat {flat_deg(one):.1f} degrees; its own presses "
                f"{learnt.normal_error_deg.mean:.1f} degrees",
                flush=True,
            )


if __name__ == "__main__":
    main()
