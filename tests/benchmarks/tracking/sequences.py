"""The moving objects that tracking is judged by, and which of them nothing may be tuned on.

`python -m tests.benchmarks.tracking.sequences DIR [NAME ...]` presses them: for each a folder with the pictures and
the true poses, as `gellight simulate sequence` writes them. What is there is not made again.
"""

import argparse
import json
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gellight.lab.simulator.sequence import read_sequence
from gellight_design.simulating.choices import GelKind
from gellight_design.simulating.written_sequence import write_sequence
from sim_reference.geometry import AS_BUILT

Array = NDArray[np.float64]
HELD_OUT = ("wave_slide", "pconvex_slide", "key_6dof", "largebead_spin", "gentlebead_rock", "qucave_mixed")
"""kept apart: looked at once, when nothing is changed any more"""


@dataclass(frozen=True, kw_only=True)
class Moving:
    """One object and its way. Functions of 0..1 give mm and degrees."""

    object_name: str
    within_mm: float = 0.0
    frames: int = 60
    depth: Callable[[Array], Array] = field(default=lambda s: 0.7 + 0 * s)
    place: Callable[[Array], tuple[Array, Array]] = field(default=lambda s: (0 * s, 0 * s))
    turn: Callable[[Array], tuple[Array, Array, Array]] = field(default=lambda s: (0 * s, 0 * s, 0 * s))
    hidden: Callable[[Array], Array] = field(default=lambda pose: np.zeros((6, 0)))
    """the twists (6, k) of a pose (4, 4) that move nothing that can be felt: translation of the image centre first"""

    def steps(self) -> list[list[float]]:
        """Depth, place and turn in each frame."""
        s = np.linspace(0, 1, self.frames)
        columns = np.stack([self.depth(s), *self.place(s), *self.turn(s)], axis=1)
        return [[float(value) for value in row] for row in columns.round(6)]


def wave(s: Array, turns: float = 1.0, phase: float = 0.0) -> Array:
    """Return a sine that begins at 0."""
    return np.asarray(np.sin(2 * np.pi * turns * s + phase) - np.sin(phase))


def about(point: Array, axes: Array) -> Array:
    """Return the twists (6, k) of turns about axes (k, 3) through a point."""
    return np.stack([np.concatenate([-np.cross(axis, point), axis]) for axis in axes], axis=1)


def sphere(below_mm: float) -> Callable[[Array], Array]:
    """Return what a sphere hides, whose centre lies so far below the origin."""
    return lambda pose: about(pose[:3, 3] - below_mm * pose[:3, 2], np.eye(3))


def upright(pose: Array) -> Array:
    """Return what rings about the object's z hide."""
    return about(pose[:3, 3], pose[None, :3, 2])


def along_a_bar(pose: Array) -> Array:
    """Return what a bar of 3 mm radius along the object's x hides."""
    axis = pose[:3, 0]
    slide = np.concatenate([axis, np.zeros(3)])[:, None]
    return np.concatenate([slide, about(pose[:3, 3] - 3 * pose[:3, 2], axis[None])], axis=1)


def rolled(radius_mm: float, frames: int, name: str, aslant_rad: float = 0.0) -> Moving:
    """Return a bead that rolls once without slipping: about y, or an axis that is turned from it towards x."""
    length, c, s = 2 * np.pi * radius_mm, np.cos(aslant_rad), np.sin(aslant_rad)
    return Moving(
        object_name=name,
        frames=frames,
        depth=lambda t: 0.8 + 0 * t,
        place=lambda t: (c * length * (t - 0.5), -s * length * (t - 0.5)),
        turn=lambda t: (s * 360 * t, c * 360 * t, 0 * t),
    )


SEQUENCES = {
    "tstep_slide": Moving(object_name="TSTEP", within_mm=9, place=lambda s: (-2 + 4 * s, wave(s))),
    "tstep_yaw": Moving(
        object_name="TSTEP", within_mm=9, place=lambda s: (-2 + 4 * s, wave(s)), turn=lambda s: (0 * s, 0 * s, 40 * s)
    ),
    "cconvex_slide": Moving(object_name="CCONVEX", within_mm=10, place=lambda s: (3 * wave(s, 0.5), -2 + 4 * s)),
    "cconvex_yaw": Moving(
        object_name="CCONVEX",
        within_mm=10,
        place=lambda s: (3 * wave(s, 0.5), -2 + 4 * s),
        turn=lambda s: (0 * s, 0 * s, 25 * wave(s)),
    ),
    "wave_slide": Moving(object_name="WAVE", within_mm=9, place=lambda s: (-2 + 4 * s, s), hidden=upright),
    "pconvex_slide": Moving(object_name="PCONVEX", within_mm=8, place=lambda s: (2 * wave(s, 0.5), -1.5 + 3 * s)),
    "pconvex_tilt": Moving(
        object_name="PCONVEX",
        within_mm=6,
        place=lambda s: (s, 0 * s),
        turn=lambda s: (5 * wave(s), 4 * wave(s, 2), 0 * s),
    ),
    "ballvex_tilt": Moving(
        object_name="BALLVEX",
        within_mm=7,
        place=lambda s: (0 * s, s),
        turn=lambda s: (3 * wave(s, 2), 4 * wave(s), 5 * s),
    ),
    "scrown_deeper": Moving(
        object_name="SCROWN", within_mm=8, depth=lambda s: 0.3 + 0.9 * s, place=lambda s: (0 * s, s), hidden=sphere(2.5)
    ),
    "peg_6dof": Moving(
        object_name="PEG",
        depth=lambda s: 0.8 + 0.3 * wave(s),
        place=lambda s: (2 * wave(s), 2 * s),
        turn=lambda s: (4 * wave(s), 4 * wave(s, 1, 1), 20 * s),
    ),
    "key_6dof": Moving(
        object_name="KEY",
        depth=lambda s: 0.7 - 0.2 * wave(s),
        place=lambda s: (-2 * s, 1.5 * wave(s)),
        turn=lambda s: (3 * wave(s, 1, 2), 5 * wave(s), -25 * s),
    ),
    "bead_roll": rolled(4.0, 120, "BEAD"),
    "finebead_roll": rolled(4.0, 120, "FINEBEAD"),
    "largebead_spin": Moving(
        object_name="LARGEBEAD",
        depth=lambda s: 0.8 + 0 * s,
        place=lambda s: (0 * s, wave(s)),
        turn=lambda s: (0 * s, 0 * s, 360 * s),
    ),
    "gentlebead_rock": Moving(
        object_name="GENTLEBEAD",
        depth=lambda s: 0.9 + 0 * s,
        place=lambda s: (0 * s, -6 * np.radians(50) * wave(s)),
        turn=lambda s: (50 * wave(s), 0 * s, 0 * s),
    ),
    "qucave_mixed": Moving(
        object_name="QUCAVE",
        within_mm=9,
        depth=lambda s: 0.7 + 0.1 * wave(s),
        place=lambda s: (3 * s, -2 * s),
        turn=lambda s: (2 * wave(s), 2 * wave(s, 2), 20 * s),
    ),
    "marble_slide": Moving(object_name="MARBLE", place=lambda s: (-4 + 8 * s, 2 * wave(s)), hidden=sphere(0.0)),
    "bar_slide": Moving(
        object_name="BAR", place=lambda s: (2 * s, 3 * s), turn=lambda s: (0 * s, 0 * s, 15 * s), hidden=along_a_bar
    ),
}
TUNED_ON = tuple(name for name in SEQUENCES if name not in HELD_OUT)


def press(
    name: str, folder: Path, gel: GelKind = "layer", every: int = 1, *, moving: Moving | None = None, seed: int = 0
) -> Path:
    """Return the folder of a sequence, or of every so many of its frames; pressed unless it is there.

    moving: of another sequence than those here, with the seed of its noise.
    """
    target = folder / f"{name}-{gel}-{every}"
    if not (target / "poses.csv").exists():
        seed = seed if moving else list(SEQUENCES).index(name)
        moving, geometry = moving or SEQUENCES[name], AS_BUILT
        folder.mkdir(parents=True, exist_ok=True)
        file = folder / f"{name}-{every}.json"
        steps = moving.steps()[::every]
        file.write_text(json.dumps({"object": moving.object_name, "within_mm": moving.within_mm, "steps": steps}))
        write_sequence(read_sequence(file, geometry), target, geometry, gel=gel, seed=seed)
    return target


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(SEQUENCES))
    asked = parser.parse_args()
    for name in asked.names or SEQUENCES:
        print(press(name, asked.folder), flush=True)


if __name__ == "__main__":
    main()
