"""Tracking on real clips, whose poses nobody knows: `python -m tests.benchmarks.tracking.clips CLIP ...`.

Each is a film of a sensor that begins untouched. The bundle is another unit's of the same make (`--bundle`; default:
GelSLAM's Mini, learnt from its balls), with the clip's first pictures for the gel at rest. A row a clip, of its longest
contact: frames tracked, lost and not all told before the object is another one, how far it moved by then, why it
ended (`registration.Loss`), and how that closes: a fresh tracker follows the same frames backwards, and both ways
together should lead to where they began. What is wrong alike in both directions does not show.
"""

import argparse
import tempfile
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from gellight.bundle.bundle import Bundle, load_bundle
from gellight.frame_path.pipeline import Reconstructor
from gellight.frames.frames import CameraFrame, TactileFrame
from gellight.lab.training.training import TrainingOptions
from gellight_scan.tracking.rigid import twist_of
from gellight_scan.tracking.tracker import Tracker
from gellight_scan.tracking.view import View
from tests.benchmarks.real_judging import fitted
from tests.benchmarks.real_sets import gelslam

UNTOUCHED = 2
"""pictures at the beginning"""
DEEP_MM, SHORTEST = 0.15, 20
"""a contact is so deep for so many frames"""
AT_REST = 3
"""frames at either end of a contact in which it comes and goes"""


def pictures(path: Path) -> list[NDArray[np.uint8]]:
    """Return the (H, W, 3) RGB pictures of a film."""
    film, taken = cv2.VideoCapture(str(path)), []
    while True:
        there, picture = film.read()
        if not there:
            return taken
        taken.append(np.asarray(cv2.cvtColor(picture, cv2.COLOR_BGR2RGB), np.uint8))


def felt(bundle: Bundle, taken: Sequence[NDArray[np.uint8]]) -> list[TactileFrame]:
    rest = np.mean(taken[:UNTOUCHED], axis=0)
    path = Reconstructor(bundle.with_reference(rest, frames=UNTOUCHED))
    return [path.reconstruct(CameraFrame(image=image, time_s=0.04 * n, sequence=n)) for n, image in enumerate(taken)]


def longest_contact(frames: Sequence[TactileFrame]) -> Sequence[TactileFrame]:
    """Return the frames of the longest contact, without its ends."""
    deep = np.array([frame.contact.indentation_mm > DEEP_MM for frame in frames], np.int8)
    ends = np.flatnonzero(np.diff(np.r_[0, deep, 0])).reshape(-1, 2)
    begin, end = max(ends, key=lambda each: each[1] - each[0], default=(0, 0))
    return frames[begin + AT_REST : max(end - AT_REST, 0)]


def followed(views: Sequence[View]) -> tuple[NDArray[np.float64], list[str], str]:
    """Return the pose (4, 4) of the last frame that knew the first object, what became of each until then, and why."""
    tracker, motion, fates, ended = Tracker(), np.eye(4), list[str](), "at the end of the contact"
    for number, view in enumerate(views):
        pose = tracker.follow(view, number)
        if pose is not None and pose.number > 1:
            break
        lost = pose is None or pose.lost
        fates.append(f"lost, {tracker.loss}" if lost else "in part" if len(pose.untellable) else "tracked")
        motion = motion if lost else pose.motion
    while fates and fates[-1].startswith("lost"):
        ended = fates.pop()
    return motion, fates, ended


def distance(motion: NDArray[np.float64], view: View) -> str:
    """Say how far a motion (4, 4) leads at the middle of the contact."""
    twist = twist_of(motion, view.centre_mm)
    return f"{np.linalg.norm(twist[:3]):.2f} mm {np.degrees(np.linalg.norm(twist[3:])):.1f} deg"


def judge(bundle: Bundle, clip: Path) -> str:
    contact = longest_contact(felt(bundle, pictures(clip)))
    if len(contact) < SHORTEST:
        return f"{clip.stem:28} {len(contact)} frames of contact: too few"
    pixel_mm, height_mm = bundle.pixel_size_mm, bundle.manifest.camera_height_mm
    views = [View.of(one.depth_mm, one.gradient_map, pixel_mm, camera_height_mm=height_mm) for one in contact]
    there, fates, ended = followed(views)
    back, *_ = followed(views[: len(fates)][::-1])
    return (
        f"{clip.stem:28} {fates.count('tracked') + fates.count('in part'):3} of {len(views):3} tracked, "
        f"{fates.count('in part'):3} in part, {sum(fate.startswith('lost') for fate in fates):2} lost; moved "
        f"{distance(there, views[0])}, closes to {distance(back @ there, views[0])}; ended {ended}"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("clips", nargs="+", type=Path, metavar="CLIP")
    parser.add_argument("--bundle", help="of a unit of the same make")
    asked = parser.parse_args()
    if missing := [str(clip) for clip in asked.clips if not clip.is_file()]:
        parser.error(f"no such clip: {', '.join(missing)}")
    with tempfile.TemporaryDirectory() as folder:
        images = None if asked.bundle else gelslam(Path(folder))
        bundle = fitted(images.presses, images, TrainingOptions()) if images else load_bundle(asked.bundle)
        for clip in asked.clips:
            print(judge(bundle, clip), flush=True)


if __name__ == "__main__":
    cv2.setNumThreads(1)
    main()
