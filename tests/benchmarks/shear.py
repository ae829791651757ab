"""How well dots are followed and tell the force along the gel: `python -m tests.benchmarks.shear [SEED]`.

Drags and twists over the simulated gel, in pictures with noise: force and torque in single frames; names and places in
steps and after one jump; the time. `--clips FOLDER` follows the dots of real clips, one in `--every`, from the first
regular frame among their first two fifths.
"""

import argparse
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from gellight.base.errors import InputError
from gellight.bundle.bundle import Bundle, load_bundle
from gellight.frame_path.pipeline import Reconstructor
from gellight.frames.camera import Camera
from gellight.frames.dot_following import DotFollower
from gellight.frames.dot_places import dots_at_rest
from gellight.frames.dots import find_dots
from gellight.frames.picture import PictureSteps, PreparedCamera, steps_in
from gellight.frames.shear import ShearTruth, Unseen
from gellight.opening import open_camera

DRAGS, FOLLOWED = 24, 13
OBJECTS = ("BALL", "CYLINDER", "BALL", "SCROWN")


@dataclass(frozen=True)
class Case:
    """An object pressed somewhere, and how far it is then moved and turned."""

    name: str
    depth_mm: float
    place_mm: tuple[float, float]
    motion: tuple[float, float, float]


def cases(seed: int, count: int, longest_mm: float, most_turn: float) -> Iterator[Case]:
    """Yield drags, every other one with a twist."""
    rng = np.random.default_rng(seed)
    for number in range(count):
        name = OBJECTS[number % len(OBJECTS)]
        # The plate around the crown may not touch: pictures do not tell how deep what fills the view is pressed.
        depth = rng.uniform(0.4, 1.2) * (1.0 if name == "BALL" else 0.6)
        place, angle = (rng.uniform(-4, 4), rng.uniform(-2.5, 2.5)), rng.uniform(0, 2 * np.pi)
        length, turn = rng.uniform(0.1, longest_mm), rng.uniform(-most_turn, most_turn) * (number % 2)
        yield Case(name, float(depth), place, (length * np.cos(angle), length * np.sin(angle), turn))


def carry(camera: Camera, case: Case, steps: int) -> Iterator[None]:
    """Press, then move in so many steps; yield after each."""
    camera.stage.press(case.name, case.depth_mm, *case.place_mm)
    yield
    for share in np.linspace(0, 1, steps + 1)[1:]:
        camera.stage.drag(*(float(share * one) for one in case.motion))
        yield


def opened(query: str) -> tuple[Camera, PictureSteps]:
    """Open a simulated sensor; its dots are those of the whole lattice."""
    camera = open_camera(f"sim://?programme=0&board=0&{query}")
    with open_camera(f"sim://?programme=0&board=0&{query.partition('&dots_missing')[0]}") as whole:
        steps = steps_in(whole.picture_files)
    assert steps is not None
    return camera, steps


def truth_of(camera: Camera) -> ShearTruth:
    """Return the truth of the next frame."""
    truth = camera.read().truth
    assert truth.shear is not None
    return truth.shear


def forces(query: str, seed: int, bundle: Bundle) -> None:
    """Judge force and torque in single frames."""
    camera, steps = opened(query)
    prepared, reconstructor = PreparedCamera(camera, steps), Reconstructor(bundle)
    off, torques, sure, spent = [], [], [], 0.0
    with prepared:
        for case in cases(seed, DRAGS, 0.8, 0.15):
            for _ in carry(camera, case, 2):
                frame = prepared.read()
            felt, truth = reconstructor.reconstruct(frame), truth_of(camera)
            _ = felt.force.pressure_mpa
            began = time.process_time()
            shear = felt.shear
            spent += time.process_time() - began
            assert shear.force_n is not None
            assert shear.force_error_n is not None
            miss, whole = np.hypot(*np.subtract(shear.force_n, truth.force_n)), np.hypot(*truth.force_n)
            arm = 0.25 * np.sqrt(felt.contact.area_mm2 / np.pi)
            off.append(miss / whole)
            torques.append(abs(shear.torque_nmm - truth.torque_nmm) / max(abs(truth.torque_nmm), arm * whole))
            sure.append(miss / np.hypot(*shear.force_error_n))
    told = "; ".join(
        f"{100 * np.median(one):.1f} %, p90 {100 * np.percentile(one, 90):.1f} %" for one in (off, torques)
    )
    surely = np.sqrt(np.mean(np.square(sure)))
    print(f"{query}: force, torque off by {told}; over the error told, rms {surely:.2f}; {1e3 * spent / DRAGS:.1f} ms")


def following(query: str, seed: int, steps: int) -> None:
    """Judge names and places, in so many steps a drag, and back."""
    camera, pictures = opened(query)
    rest = np.array(pictures.dots.places_px)
    right = dots = 0
    off: list[float] = []
    longest = spent = 0.0
    with camera:
        at_rest = truth_of(camera).dots_px
        names = np.hypot(*np.moveaxis(rest[:, None] - at_rest[None], 2, 0)).argmin(axis=1)
        there = find_dots(camera.read().image)
        printed = np.hypot(*np.moveaxis(rest[:, None] - np.array(there.places_px)[None], 2, 0)).min(axis=1) < 3
        for case in cases(seed, FOLLOWED, 1.8, 0.3):
            camera.stage.release()  # type: ignore[union-attr]
            follower = pictures.follower()
            follower.follow(camera.read().image)
            before = at_rest[names]
            for number, _ in enumerate(carry(camera, case, steps)):
                if steps == 1 and number == 0:
                    continue  # one jump: the press is not seen before the drag
                frame = camera.read()
                began = time.process_time()
                seen = follower.follow(frame.image)
                spent += time.process_time() - began
                now = frame.truth.shear.dots_px[names]  # type: ignore[union-attr]
                miss = np.hypot(*(seen.places_px - now).T)
                named = seen.seen & (miss < 0.3 * follower.pitch_px)
                right, dots = (
                    right + int(named[printed].sum() - (seen.seen & ~printed).sum()),
                    dots + int(printed.sum()),
                )
                off += miss[named & printed].tolist()
                longest = max(longest, float(np.hypot(*(now - before).T).max()) / follower.pitch_px)
                before = now
    frames, tail = dots / printed.sum(), np.percentile(off, 95)
    print(
        f"{query}, {steps} steps, the longest {longest:.2f} pitches: names right {100 * right / dots:.2f} % of {dots}; "
        f"places off by {np.median(off):.3f} px, p95 {tail:.3f}; {1e3 * spent / frames:.1f} ms"
    )


def clips(folder: Path, every: int) -> None:
    """Follow the dots of real clips, and count those in which every dot that is in view is on a dot at the end."""
    whole, shares, spent, pictures = 0, [], 0.0, 0
    files = sorted(folder.glob("*.avi"))[1::every]
    for path in files:
        frames = list(read(path))
        follower, first = begun(frames)
        began = time.process_time()
        for image in frames[first:]:
            seen = follower.follow(image)
        spent, pictures = spent + time.process_time() - began, pictures + len(frames) - first
        fine = seen.seen | (seen.reasons == Unseen.BEYOND_VIEW)
        whole, shares = whole + int(fine.all() and not seen.problem), [*shares, fine.mean()]
        if not fine.all() or seen.problem:
            print(f"  {path.name}: {int((~fine).sum())} of {len(fine)} not seen {seen.problem}")
    print(f"{whole} of {len(files)} clips whole; {np.mean(shares):.4f} of the dots; {1e3 * spent / pictures:.2f} ms")


def read(path: Path) -> Iterator[np.ndarray]:
    """Yield the RGB pictures of a clip."""
    clip = cv2.VideoCapture(str(path))
    while (got := clip.read())[0]:
        yield np.ascontiguousarray(got[1][..., ::-1])


def begun(frames: list[np.ndarray]) -> tuple[DotFollower, int]:
    """Return a follower and the frame it begins with: bright, with many dots, in a regular lattice."""
    bright = np.array([frame[::4, ::4].mean() for frame in frames])
    best: tuple[int, float, int, np.ndarray, float, float] | None = None
    for number in range(0, int(0.4 * len(frames)) + 1, max(1, len(frames) // 30)):
        look = find_dots(frames[number]) if bright[number] >= 0.95 * np.median(bright) else None
        if look is None:
            continue
        try:
            places, dark = dots_at_rest(frames[number], look.diameter_px)
        except InputError:
            continue
        apart = np.hypot(*np.moveaxis(places[:, None] - places[None], 2, 0)) + np.diag(np.full(len(places), np.inf))
        uneven = float(np.sort(apart, axis=1)[:, :3].std())
        if best is None or len(places) > 1.03 * best[0] or (len(places) >= 0.97 * best[0] and uneven < best[1]):
            best = len(places), uneven, number, places, look.diameter_px, dark
    if best is None:
        raise InputError("no frame shows dots")
    return DotFollower(best[3], best[4], best[5]), best[2]


def main() -> None:
    """Print all figures."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("seed", type=int, nargs="?", default=7)
    options.add_argument("--clips", type=Path)
    options.add_argument("--every", type=int, default=3)
    chosen = options.parse_args()
    cv2.setNumThreads(1)
    if chosen.clips:
        clips(chosen.clips, chosen.every)
        return
    bundle = load_bundle("synthetic")
    for query in ("dots=9x7", "dots=9x7&dots_missing=0.2", "dots=7x5&dot_pitch=2.6"):
        forces(query, chosen.seed, bundle)
    for query in ("dots=9x7&friction=1", "dots=9x7&friction=1&dots_missing=0.2"):
        for steps in (10, 1):
            following(query, chosen.seed, steps)


if __name__ == "__main__":
    main()
