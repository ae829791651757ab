"""The state of slip on real clips whose moments were marked by eye: `python -m tests.benchmarks.slip_marks FOLDER`.

FOLDER holds the clips that tests/data/slip_marks names; RULE.txt there says how they were marked. The marks judge, and
nothing is tuned to them. No gel of the clips is calibrated: depth is felt by a bundle of another GelSight Mini, with
the dots and the untouched picture of the clip itself. An alarm is the first of a run of frames with `full`.
"""

import argparse
import csv
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
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
LATEST = 25
"""frames after the mark in which an alarm still finds it"""


@dataclass(frozen=True)
class Mark:
    """What a clip shows: `after` and `frame` as in RULE.txt."""

    clip: str
    mark: str
    after: int | None
    frame: int | None


def marks() -> Iterator[Mark]:
    """Yield those of the file."""
    with MARKS.open() as file:
        for row in csv.DictReader(file):
            after, frame = (int(row[name]) if row[name] else None for name in ("after", "frame"))
            yield Mark(row["clip"], row["mark"], after, frame)


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


def judge(folder: Path, other: Bundle, place: Path) -> None:
    """Print a line for each clip that can be told, and the sum."""
    every, delays = list(marks()), []
    slipped = false = still = unknown = late_start = 0
    for one in every:
        if one.after is None:
            continue
        try:
            first, states = told(folder / f"{one.clip}.avi", other, place)
        except GellightError as reason:
            print(f"{one.clip}: not felt: {reason}", flush=True)
            continue
        if first > one.after:
            late_start += 1
            print(
                f"{one.clip}: not judged: the first frame fit as untouched, {first}, comes after {one.after}",
                flush=True,
            )
            continue
        called = alarms(first, states)
        quiet = states[: max(0, one.after + 1 - first)]
        wrong = [number for number in called if number <= one.after]
        false, still = false + len(wrong), still + len(quiet)
        unknown += sum(state == SlipState.UNKNOWN for state in quiet)
        line = f"{one.clip}: from {first}, {one.mark} {one.frame or ''}, false alarms {wrong}"
        if one.frame is not None:
            slipped += 1
            found = [number for number in called if one.after < number <= one.frame + LATEST]
            delays += [number - one.frame for number in found[:1]]
            line += f", found {found[:1]}"
        print(line, flush=True)
    late = f"{np.median(delays):.0f} frames, p90 {np.percentile(delays, 90):.0f}" if delays else "not known"
    rate = f"{60 * RATE_HZ * false / still:.1f}" if still else "no"
    print(
        f"{len(every)} clips, {sum(one.after is None for one in every)} untellable, "
        f"{late_start} without an untouched frame before; {len(delays)} of {slipped} slips "
        f"found, delay {late}; {rate} false alarms a minute in {still / RATE_HZ:.0f} s without slip, of which "
        f"{100 * unknown / max(1, still):.0f} % unknown"
    )


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
