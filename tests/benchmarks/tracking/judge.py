"""How far tracking is right: `python -m tests.benchmarks.tracking.judge DIR [NAME ...] [--every N]`.

Presses the sequences that are not in DIR yet (sequences.py), reconstructs their pictures with GelNet and tracks the
object. A row a sequence: median and largest error in mm at the middle of the contact and in degrees, without what the
object hides; frames lost; frames wrong by more than 1 mm or 5 degrees while called tracked, how many of those said that
directions are untellable, and how many did not say that the pose is doubtful; frames that are doubtful; share of errors
within the stated 90 % ellipsoid of what is told; processor time of tracking a frame.
"""

import argparse
import csv
import itertools
import time
from collections.abc import Iterator, Sequence
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from gellight.bundle.bundle import load_bundle
from gellight.frame_path.pipeline import Reconstructor
from gellight.frames.frames import CameraFrame, TactileFrame
from gellight.frames.image_files import read_image
from gellight.frames.pose import ObjectPose
from gellight_scan.tracking.registration import SCALE
from gellight_scan.tracking.rigid import inverse, twist_of
from gellight_scan.tracking.tracker import UNTELLABLE_MM, Tracker
from gellight_scan.tracking.view import View
from tests.benchmarks.tracking.sequences import HELD_OUT, SEQUENCES, TUNED_ON, press

Array = NDArray[np.float64]
PIXEL_MM = (0.0588, 0.0588)
WRONG_MM, WRONG_DEG = 1.0, 5.0
WITHIN = 0.9
_AXES = ("_of_x", "_of_y", "_of_z", "_mm")


@cache
def reconstructor() -> Reconstructor:
    return Reconstructor(load_bundle("synthetic"))


def felt(folder: Path) -> Iterator[tuple[Array, TactileFrame]]:
    """Yield the true pose of each picture of a sequence, and what is felt in it."""
    with (folder / "poses.csv").open() as file:
        for row in csv.DictReader(file):
            pose = np.eye(4)
            pose[:3] = [[float(row[axis + of]) for of in _AXES] for axis in "xyz"]
            image = read_image(folder / f"{int(row['frame']):05}.png")
            frame = CameraFrame(image=image, time_s=0.0, sequence=int(row["frame"]))
            yield pose, reconstructor().reconstruct(frame)


def height_mm() -> float:
    """Return how high above the gel the camera of the pictures seems to stand."""
    return reconstructor().bundle.manifest.camera_height_mm


def view_of(frame: TactileFrame) -> View:
    return View.of(frame.depth_mm, frame.gradient_map, PIXEL_MM, camera_height_mm=height_mm())


def error(name: str, pose: ObjectPose, true: Array, now: Array) -> Array:
    """Return the twist (6,) in mm, about the middle of the contact, by which a pose is off what can be felt."""
    off = twist_of(pose.motion @ inverse(true), pose.centre_mm) * SCALE
    hidden = SEQUENCES[name].hidden(now)
    if not hidden.shape[1]:
        return np.asarray(off)
    there = np.concatenate([hidden[:3] + np.cross(hidden[3:].T, pose.centre_mm).T, hidden[3:]]) * SCALE[:, None]
    return np.asarray(off - there @ np.linalg.lstsq(there, off, rcond=None)[0])


def within(pose: ObjectPose, off: Array) -> bool:
    """Say whether an error lies in the stated ellipsoid of what is told."""
    variances, directions = np.linalg.eigh(pose.covariance * SCALE[:, None] * SCALE)
    told = variances < UNTELLABLE_MM**2
    square = float(((directions.T @ off)[told] ** 2 / variances[told]).sum())
    return square < float(chi2.ppf(WITHIN, int(told.sum())))


def judge(name: str, folder: Path, every: int) -> tuple[str, Array]:
    """Return the row of a sequence, and its frames, those within the ellipsoid, wrong, and wrong but not doubtful."""
    tracker, errors, inside, lost, spent = Tracker(), [], [], 0, 0.0
    wrong: list[ObjectPose] = []
    doubtful = 0
    starts: dict[int, Array] = {}
    for true, frame in itertools.islice(felt(press(name, folder)), 0, None, every):
        begun = time.process_time()
        pose = tracker.follow(view_of(frame), frame.camera_frame.sequence)
        spent += time.process_time() - begun
        if pose is None or pose.lost:
            lost += 1
            continue
        first = starts.setdefault(pose.number, true)
        off = error(name, pose, true @ inverse(first), true)
        errors.append((np.linalg.norm(off[:3]), np.degrees(np.linalg.norm(off[3:] / SCALE[3]))))
        if first is not true:
            inside.append(within(pose, off))
        if errors[-1][0] > WRONG_MM or errors[-1][1] > WRONG_DEG:
            wrong.append(pose)
        doubtful += pose.doubtful
    (mm, deg), (most_mm, most_deg) = np.median(errors, axis=0), np.max(errors, axis=0)
    unsaid = sum(not pose.doubtful for pose in wrong)
    parts = (
        f"{name:16s} {mm:.3f} mm {deg:.2f} deg ({most_mm:.3f} {most_deg:.2f})",
        f"end {errors[-1][0]:.3f} {errors[-1][1]:.2f}",
        f"lost {lost}",
        f"objects {len(starts)}",
        f"wrong {len(wrong)}, of these untellable {sum(len(pose.untellable) > 0 for pose in wrong)}",
        f"not doubtful {unsaid}  (doubtful {doubtful} of {len(errors)})",
        f"within {np.mean(inside or [np.nan]):.2f}",
        f"{1e3 * spent / (len(errors) + lost):.1f} ms",
    )
    row = "  ".join(parts)
    return row, np.array([len(inside), np.sum(inside), len(wrong), unsaid], np.float64)


def judged(names: Sequence[str], folder: Path, every: int) -> None:
    total = np.zeros(4)
    for name in names:
        row, counts = judge(name, folder, every)
        print(row, flush=True)
        total += counts
    frames, inside, wrong, unsaid = total
    within_it = f"of {frames:.0f} frames {inside / frames:.3f} within the ellipsoid"
    print(f"{within_it}, {wrong:.0f} wrong while called tracked, {unsaid:.0f} of these not doubtful")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(SEQUENCES))
    parser.add_argument("--every", type=int, default=1, help="leave out all but every N-th frame")
    asked = parser.parse_args()
    for title, names in (("tuned on", TUNED_ON), ("kept apart", HELD_OUT)):
        chosen = [name for name in names if name in (asked.names or SEQUENCES)]
        if chosen:
            print(title)
            judged(chosen, asked.folder, asked.every)


if __name__ == "__main__":
    main()
