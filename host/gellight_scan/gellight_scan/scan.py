"""A scan in a folder: presses come in one by one, and after each the map is there as far as they tell.

    press-000.npz ...  what is kept of each press, and how it lies to those before it
    map.npz            the `HeightMap` of all that could be joined
    map.png            a picture of it

Every file is written whole or not at all, the press first. So what ends the program at any moment costs at most the
press under way, and the same folder goes on later.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import InputError
from gellight.lab.report.pictures import write_png
from gellight_scan.contact_view import ContactView
from gellight_scan.fusion import Fused, fuse
from gellight_scan.pairs import Joint, joined
from gellight_scan.pictures import height_picture
from gellight_scan.pose_graph import LEFT_OUT, Solved, solve
from gellight_scan.scan_files import KeptPresses, path_of
from gellight_scan.tracking.rigid import carried, inverse

Array = NDArray[np.float64]
MAP, PICTURE = "map.npz", "map.png"
SEARCHED = 12
"""presses, the last ones first, that are looked at for where a press lies that nobody knows"""
BESIDE = 0.6
"""of a view: so far beside a press the next one is proposed"""
SIDES = {"right": (1, 0), "left": (-1, 0), "below": (0, 1), "above": (0, -1)}
UNSEEN = 0.3
"""of the view there that no press has seen: it is worth a press"""
LITTLE = 0.05
"""of a view that reached the part: the press was too gentle"""


@dataclass(frozen=True, kw_only=True)
class PressReport:
    """What became of a press."""

    number: int
    joined_to: tuple[int, ...]
    """presses that it overlaps; none, and it has no place yet"""
    contradicted: tuple[int, ...]
    """of these, those whose overlap contradicts all others and so does not count"""
    reached: float
    """share of its view where the gel reached the part"""
    missing: tuple[str, ...]
    """sides of it where no press has been: right, left, below, above, as the picture of the first press has them"""

    worth_saying = True

    def in_words(self) -> str:
        """Return what became of it, and where to press next."""
        reached = f"press {self.number}: the gel reached {self.reached:.0%} of the view"
        harder = "; press harder" if self.reached < LITTLE else ""
        if self.number > 0 and not self.joined_to:
            return f"{reached}{harder}. It could not be joined: press again, over half of a press that was"
        to = f", joined to {', '.join(map(str, self.joined_to))}" if self.joined_to else ""
        against = f"; what it has in common with {', '.join(map(str, self.contradicted))} contradicts the others"
        beside = f". Not scanned yet: {', '.join(self.missing)}" if self.missing else ". All around it is scanned"
        return f"{reached}{to}{against if self.contradicted else ''}{harder}{beside}"


class Scan(KeptPresses):
    """Presses of one part by one sensor, kept in a folder."""

    kind = "press"

    def __init__(self, folder: Path, *, curved: bool = False) -> None:
        """Go on with the scan in `folder`, or begin one; InputError where it cannot be read or made.

        curved: the part is not flat as a whole; see `fusion`.
        """
        super().__init__(folder)
        self._curved = curved
        self.fused: Fused | None = None
        if self.views:
            self._solve()

    def add(self, view: ContactView, source: str = "this press") -> PressReport:
        """Take a press; say what became of it. InputError for one of another sensor, and where it cannot be written."""
        self.refuse_other(view, source)
        number = self.next_number
        self.keep(number, view, list(self._joints(number, view)))
        self._solve()
        self.write_map()
        return self._report(number)

    def take_back(self) -> int:
        """Take the last press back, and say which one it was; InputError where there is none."""
        if not self.views:
            raise InputError("there is no press to take back")
        number = max(self.views)
        self.write(path_of(self.folder, number, self.kind).unlink)
        del self.views[number]
        self.joints = [joint for joint in self.joints if number not in (joint.one, joint.other)]
        if self.views:
            self._solve()
            self.write_map()
        else:
            self.solved, self.fused = Solved({}, ()), None
            for name in (MAP, PICTURE):
                (self.folder / name).unlink(missing_ok=True)
        return number

    def write_map(self) -> None:
        """Write the map of what is placed, and its picture."""
        if self.fused is not None:
            fused = self.fused
            self.write(lambda: fused.height_map.save(self.folder / MAP))
            if fused.height_map.reached.any():
                self.write(lambda: write_png(self.folder / PICTURE, map_picture(fused)))

    # ---- where a press lies ----

    def _joints(self, number: int, view: ContactView) -> Iterator[Joint]:
        """Yield what a new press has in common with others: first looked for, then where it has to be."""
        pose, tried = None, set()
        for other in self._likely():
            placed = other in self.solved.poses
            if placed and pose is not None:
                continue
            tried.add(other)
            joint = joined((other, self.views[other]), (number, view))
            if joint is not None:
                yield joint
                if placed:
                    pose = self.solved.poses[other] @ inverse(joint.pose)
        if pose is not None:
            for other in sorted(set(self.solved.poses) - tried):
                guess = inverse(pose) @ self.solved.poses[other]
                if self._near(guess, view) and (joint := joined((other, self.views[other]), (number, view), guess)):
                    yield joint

    def _likely(self) -> list[int]:
        """Return the presses to look at, the last ones first: those that have a place, then those that have none."""
        last = sorted(self.views, reverse=True)
        placed = [other for other in last if other in self.solved.poses]
        return placed[:SEARCHED] + [other for other in last if other not in self.solved.poses][:SEARCHED]

    def _near(self, pose: Array, view: ContactView) -> bool:
        """Say whether a pose from another press may let both views overlap."""
        width, height = view.size_mm
        return bool(np.hypot(*pose[:2, 3]) < np.hypot(width, height))

    def _solve(self) -> None:
        """Find all places anew, and the map."""
        self.solved = solve(self.joints, self.first)
        self.fused = fuse(
            {number: self.views[number] for number in self.placed}, self.solved.poses, curved=self._curved
        )

    # ---- what is said of it ----

    def _report(self, number: int) -> PressReport:
        mine = [(joint, weight) for joint, weight in zip(self.joints, self.solved.weights, strict=True)
                if number in (joint.one, joint.other)]  # fmt: skip
        others = [(joint.one + joint.other - number, weight) for joint, weight in mine]
        placed = number in self.solved.poses
        return PressReport(
            number=number,
            joined_to=tuple(sorted(other for other, _ in others)) if placed else (),
            contradicted=tuple(sorted(other for other, weight in others if weight < LEFT_OUT)),
            reached=float(self.views[number].reached.mean()),
            missing=tuple(self.missing(number)) if placed else (),
        )

    def missing(self, number: int) -> dict[str, Array]:
        """Return the sides of a press where no press has been, and the middle (2,) mm of one there, in the map."""
        assert self.fused is not None
        found: dict[str, Array] = {}
        pixel, (width, height) = self.fused.height_map.pixel_mm, self.views[number].size_mm
        middle = carried(self.solved.poses[number], np.zeros(3))[:2]
        rows, columns = self.fused.seen.shape
        for side, (across, down) in SIDES.items():
            beside = middle + BESIDE * np.array([across * width, down * height])
            left, top = np.rint((beside - np.array([width, height]) / 2 - self.fused.origin_mm) / pixel).astype(int)
            part = self.fused.seen[
                max(top, 0) : max(min(top + round(height / pixel), rows), 0),
                max(left, 0) : max(min(left + round(width / pixel), columns), 0),
            ]
            if 1 - part.sum() / (width * height / pixel**2) > UNSEEN:
                found[side] = beside
        return found


def map_picture(fused: Fused) -> NDArray[np.uint8]:
    """Draw the heights; hatched where a press saw the part and did not reach it. ValueError where none did."""
    return height_picture(fused.height_map.height_mm, fused.height_map.pixel_mm, unseen=~fused.seen)
