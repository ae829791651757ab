"""The state of slip on real clips whose moments were marked by eye: `python -m tests.benchmarks.slip_marks FOLDER`.

FOLDER holds the clips that tests/data/slip_marks names; RULE.txt there says how they were marked. The marks judge, and
nothing is tuned to them. No gel of the clips is calibrated: depth is felt by a bundle of another GelSight Mini, with
the dots and the untouched picture of the clip itself. An alarm is the first of a run of frames with `full`.
"""

import argparse
import csv
import tempfile
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path

import cv2
import numpy as np

from gellight.base.errors import GellightError
from gellight.bundle.bundle import Bundle, write_bundle
from gellight.frame_path.pipeline import Reconstructor
from gellight.frames.frames import CameraFrame
from gellight.frames.picture import PictureSteps
from gellight.frames.shear import SlipState
from gellight.lab.report.pictures import write_png
from gellight.lab.training.training import Learning, TrainingOptions, fit, read_reference
from gellight.reconstruction.following import ContactFollower
from gellight.reconstruction.shear.slip import SlipFollower
from tests.benchmarks.real_sets import mini
from tests.benchmarks.shear import begun, read

MARKS = Path(__file__).parents[1] / "data" / "slip_marks" / "marks.csv"
RATE_HZ = 25
APART = 10
"""frames between two marks of one slip"""
LATEST = 25
"""frames after the mark in which an alarm still finds it"""


@dataclass(frozen=True)
class Mark:
    """What one marker saw in a clip: `after` and `frame` as in RULE.txt."""

    clip: str
    marker: str
    mark: str
    after: int | None
    frame: int | None


def marks() -> list[Mark]:
    """Return those of the file."""

    def frame(text: str) -> int | None:
        return int(text) if text else None

    with MARKS.open() as file:
        return [
            Mark(row["clip"], row["marker"], row["mark"], frame(row["after"]), frame(row["frame"]))
            for row in csv.DictReader(file)
        ]


def agreed(one: Mark, other: Mark) -> Mark | None:
    """Return what two marks of a clip say together, None where they disagree: see RULE.txt."""
    if one.mark != other.mark:
        return None
    if one.after is None or other.after is None:
        return Mark(one.clip, "both", one.mark, None, None)
    after = min(one.after, other.after)
    if one.frame is None or other.frame is None:
        return Mark(one.clip, "both", one.mark, after, None)
    apart = max(one.after, other.after) - min(one.frame, other.frame)
    return Mark(one.clip, "both", one.mark, after, max(one.frame, other.frame)) if apart <= APART else None


def in_both(some: Iterable[Mark], others: Iterable[Mark]) -> tuple[list[Mark], int]:
    """Return what two markers agree on, and how many clips both marked."""
    seen = {mark.clip: mark for mark in others}
    pairs = [(mark, seen[mark.clip]) for mark in some if mark.clip in seen]
    return [mark for pair in pairs if (mark := agreed(*pair))], len(pairs)


def told(path: Path, other: Bundle, place: Path) -> tuple[int, list[SlipState]]:
    """Return the frame that is taken as untouched, and the state in it and each later one."""
    pictures = list(read(path))
    _, first = begun(pictures)
    write_png(place / "untouched.png", pictures[first])
    reference = read_reference(place / "untouched.png")
    steps = PictureSteps.of(reference.image_shape, None, reference.dots)
    follower = steps.follower() if steps else None
    if steps is None or follower is None:
        raise SystemExit(f"{path.name}: no dots in frame {first}")
    bundle = write_bundle(
        place / "bundle", sensor="another unit", overwrite=True, reference=reference.image, reference_frames=1,
        noise_grey=reference.noise_grey, rest_grey=other.manifest.rest_grey, follow_light=True, network=other.network,
        pixel_size_mm=other.pixel_size_mm, presses=other.presses(), metrics={},
    )  # fmt: skip
    reconstructor, contacts, slips, states = Reconstructor(bundle), ContactFollower(), SlipFollower(), []
    for number, image in enumerate(pictures[first:], first):
        seen = CameraFrame(
            image=steps.filled(image), time_s=number / RATE_HZ, sequence=number, dots=follower.follow(image)
        )
        slip = slips.follow(contacts.follow(reconstructor.reconstruct(seen))).slip
        states.append(slip.state if slip else SlipState.UNKNOWN)
    return first, states


def alarms(first: int, states: list[SlipState]) -> list[int]:
    """Return the frames at which runs of `full` begin."""
    full = np.array([False, *(state == SlipState.FULL for state in states)])
    return [int(number) + first for number in np.flatnonzero(full[1:] & ~full[:-1])]


def judged(every: list[Mark], felt: dict[str, tuple[int, list[SlipState]]]) -> str:
    """Return what the alarms are worth by these marks."""
    delays: list[int] = []
    slipped = false = still = unknown = late_start = 0
    for one in every:
        if one.after is None or one.clip not in felt:
            continue
        first, states = felt[one.clip]
        if first > one.after:
            late_start += 1
            continue
        called = alarms(first, states)
        quiet = states[: one.after + 1 - first]
        false, still = false + sum(number <= one.after for number in called), still + len(quiet)
        unknown += sum(state == SlipState.UNKNOWN for state in quiet)
        if one.frame is not None:
            slipped += 1
            delays += [number - one.frame for number in called if one.after < number <= one.frame + LATEST][:1]
    late = f"{np.median(delays):.0f} frames, p90 {np.percentile(delays, 90):.0f}" if delays else "not known"
    rate = f"{60 * RATE_HZ * false / still:.1f}" if still else "no"
    return (
        f"{len(every)} clips, {sum(one.after is None for one in every)} untellable, {late_start} without an untouched "
        f"frame before; {len(delays)} of {slipped} slips found, delay {late}; {rate} false alarms a minute in "
        f"{still / RATE_HZ:.0f} s without slip, of which {100 * unknown / max(1, still):.0f} % unknown"
    )


def feel(clips: Iterable[str], folder: Path, other: Bundle, place: Path) -> dict[str, tuple[int, list[SlipState]]]:
    """Return what is told in each clip, and print its alarms."""
    felt = {}
    for clip in clips:
        try:
            felt[clip] = told(folder / f"{clip}.avi", other, place)
        except GellightError as reason:
            print(f"{clip}: not felt: {reason}", flush=True)
            continue
        print(f"{clip}: from {felt[clip][0]}, alarms {alarms(*felt[clip])}", flush=True)
    return felt


def judge(folder: Path, other: Bundle, place: Path) -> None:
    """Print how well the markers agree, and what the alarms are worth by each and by what two agree on."""
    every = marks()
    by = {
        marker: [mark for mark in every if mark.marker == marker] for marker in sorted({mark.marker for mark in every})
    }
    sets = dict(by)
    for one, other_one in combinations(by, 2):
        both, of = in_both(by[one], by[other_one])
        print(f"markers {one} and {other_one} agree on {len(both)} of {of} clips")
        sets[f"{one} and {other_one}"] = both
    felt = feel(dict.fromkeys(mark.clip for mark in every if mark.after is not None), folder, other, place)
    for name, some in sets.items():
        print(f"by {name}: {judged(some, felt)}")


def main() -> None:
    """Calibrate another unit, then judge."""
    options = argparse.ArgumentParser(prog="python -m tests.benchmarks.slip_marks", description=__doc__)
    options.add_argument("folder", type=Path)
    cv2.setNumThreads(1)
    folder = options.parse_args().folder
    with tempfile.TemporaryDirectory() as made:
        place = Path(made)
        (place / "set").mkdir()
        one = mini(place / "set")
        how = Learning(options=TrainingOptions(recipe="fast"))
        other = fit(one.presses, one.reference, one.ball, place / "other", sensor="mini", how=how)
        judge(folder, other, place)


if __name__ == "__main__":
    main()
