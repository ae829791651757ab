"""How far the mesh of a rolled body is right: `python -m tests.benchmarks.scan_bodies DIR [NAME ...] [--kept-apart]`.

Beads with a relief that is known are rolled in a simulated gel by the elastic layer, photographed with noise of 1 grey
level, and reconstructed by GelNet; nothing of their places is given away. What is not in DIR yet is pressed. A row:

- touches, joints between them, how many touches have a place, and how many joints contradict the rest;
- how far the poses are off, median and worst, in mm at the middle of the contact and degrees: by the tracker alone, and
  by all overlaps;
- the mesh: rms and 95th percentile by which its points are off the bead, moved as a whole to where it fits best;
- what it states: rms of its errors, and by how much touches lie off it where several touched;
- how much was touched, and processor time for joining and fusing.
"""

import argparse
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gellight.frames.frames import Provenance, TactileFrame
from gellight.lab.simulator.bodies import BEADS, bead_radius_mm
from gellight_scan.body_scan import BodyScan
from gellight_scan.touches import Touch, touches_in
from gellight_scan.tracking.rigid import carried, inverse, pose_of, twist_of
from tests.benchmarks.tracking.judge import PIXEL_MM, felt, height_mm
from tests.benchmarks.tracking.sequences import SEQUENCES, Moving, press, rolled

Array = NDArray[np.float64]
ROLLS = {name: SEQUENCES[name] for name in ("bead_roll", "finebead_roll")}
HELD_OUT = {
    "finebead_aslant": rolled(4.0, 120, "FINEBEAD", np.radians(40)),
    "largebead_roll": rolled(5.0, 150, "LARGEBEAD", np.radians(15)),
}
"""kept apart: looked at once, when nothing is changed any more"""
STEP = 1e-4
ROUNDS = 6


def fitted(points_mm: Array, radius_mm: Callable[[Array], Array]) -> Array:
    """Return how far points (N, 3) lie outside a star-shaped body about the origin, mm, moved to where it fits best."""
    pose = np.eye(4)
    for _ in range(ROUNDS):
        moved = carried(pose, points_mm)
        off = _outside(moved, radius_mm)
        slopes = [(_outside(carried(pose_of(STEP * one), moved), radius_mm) - off) / STEP for one in np.eye(6)]
        weight = 1 / (1 + (off / (3 * np.median(np.abs(off)) + 1e-9)) ** 2)
        step = np.linalg.lstsq(np.stack(slopes, axis=1) * weight[:, None], -off * weight, rcond=None)[0]
        pose = pose_of(step) @ pose
    return _outside(carried(pose, points_mm), radius_mm)


def _outside(points_mm: Array, radius_mm: Callable[[Array], Array]) -> Array:
    distance = np.linalg.norm(points_mm, axis=1)
    return np.asarray(distance - radius_mm(points_mm / distance[:, None]))


def off(poses: list[Array], true: list[Array], touches: list[Touch]) -> str:
    """Return by how much poses are off, in words."""
    twists = np.array([
        twist_of(pose @ inverse(one @ inverse(true[0])), touch.view.centre_mm)
        for pose, one, touch in zip(poses, true, touches, strict=True)
    ])  # fmt: skip
    mm, deg = np.linalg.norm(twists[:, :3], axis=1), np.degrees(np.linalg.norm(twists[:, 3:], axis=1))
    return f"{np.median(mm):.3f} ({mm.max():.3f}) mm, {np.median(deg):.2f} ({deg.max():.2f}) deg"


def frames(pressed: Path) -> Iterator[tuple[Array, TactileFrame]]:
    """Yield the true pose of each picture of a sequence, and the frame."""
    made = Provenance(
        calibration="synthetic",
        zero="synthetic",
        pixel_size_mm=PIXEL_MM,
        unix_s=0.0,
        ages_s={},
        camera_height_mm=height_mm(),
    )
    for pose, frame in felt(pressed):
        yield pose, replace(frame, provenance=made)


def _tracked(touches: list[Touch], true: list[Array]) -> str:
    """Return by how much the tracker is off by itself, over what it follows as one object."""
    count = sum(touch.number == touches[0].number for touch in touches)
    motions = [touch.motion @ inverse(touches[0].motion) for touch in touches[:count]]
    return f"{off(motions, true[:count], touches[:count])} over {count} touches, then lost or at the end"


def judge(name: str, moving: Moving, folder: Path) -> str:
    poses_of, felt_frames = zip(*frames(press(name, folder, moving=moving)), strict=True)
    true = {frame.camera_frame.sequence: pose for pose, frame in zip(poses_of, felt_frames, strict=True)}
    touches = list(touches_in(iter(felt_frames)))
    with tempfile.TemporaryDirectory() as kept:
        scan, begun = BodyScan(Path(kept)), time.process_time()
        for touch in touches:
            scan.add(touch)
        mesh, took_s = scan.mesh(), time.process_time() - begun
    placed = [touches[number] for number in scan.placed]
    poses = [true[touch.sequence] for touch in placed]
    error = fitted(carried(inverse(poses[0]), mesh.points_mm), bead_radius_mm(*BEADS[moving.object_name])) * 1e3
    return (
        f"{name:16} {len(touches)} touches, {len(scan.joints)} joints, {len(placed)} placed, "
        f"{scan.contradicted} left out\n"
        f"    tracker {_tracked(placed, poses)}; "
        f"overlaps {off([inverse(scan.solved.poses[number]) for number in scan.placed], poses, placed)}\n"
        f"    mesh {np.sqrt((error**2).mean()):.1f} um rms, 95 % within {np.percentile(np.abs(error), 95):.1f}; stated "
        f"{np.sqrt((mesh.error_mm**2).mean()) * 1e3:.1f}, touches {mesh.seam_mm * 1e3:.1f} off it; "
        f"{mesh.area_mm2:.0f} mm2; {took_s:.1f} s"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join((*ROLLS, *HELD_OUT)))
    parser.add_argument("--kept-apart", action="store_true", help="those that nothing was chosen by")
    asked = parser.parse_args()
    for name in asked.names or (HELD_OUT if asked.kept_apart else ROLLS):
        print(judge(name, {**ROLLS, **HELD_OUT}[name], asked.folder), flush=True)


if __name__ == "__main__":
    main()
