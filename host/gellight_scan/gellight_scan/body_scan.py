"""A scan of a body in a folder: touches come in while it is rolled, and each is joined to those that it overlaps.

    touch-000.npz ...  what is kept of each touch, and how it lies to those before it
    body.ply           the surface, with its errors
    body.stl           the surface for printers
    body.png           a picture of it

Where the tracker says that a touch lies is where to look first; all overlaps together then say where it is, so what the
tracker drifts by while a body rolls once around is found when it comes back to where it began. What touches after a
loss, or in a scan that goes on, is looked for in all touches that are there.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gellight.base.writing import write_file
from gellight.lab.report.pictures import write_png
from gellight_scan.body import Mesh, fused
from gellight_scan.pairs import Joint
from gellight_scan.pictures import mesh_picture
from gellight_scan.pose_graph import LEFT_OUT, Solved, solve
from gellight_scan.scan_files import KeptPresses
from gellight_scan.touches import Touch, covered, view_of
from gellight_scan.tracking.information import Agreement, agreement, information
from gellight_scan.tracking.registration import SCALE, Keyframe, guesses, register, spins
from gellight_scan.tracking.rigid import inverse
from gellight_scan.tracking.tracker import COARSE_POINTS, TRIED_STEPS, agrees, score
from gellight_scan.tracking.view import View

Array = NDArray[np.float64]
MESH, PRINTED, PICTURE = "body.ply", "body.stl", "body.png"
LEAST_COVERED = 0.3
"""of the contact of a touch, by another one: with less nothing is asked of the two"""
STEEPEST = np.cos(np.radians(35.0))
"""between two touches that are asked"""
MOST_UNLIKE = 0.25
"""of a touch that is searched for: at its place it is 0.005 or less; a fine texture in another place had 0.49"""
SEARCHED_EVERY = 5
"""touches of an object that has no place yet; each search takes a second"""
TRIED, LAST = 4, 3
"""starts that are followed to the end; touches that a body which was just lost is looked for in first"""
SAID_EVERY = 10
"""touches that went well"""
MOST_TOUCHES = 400
FEW, SOLVED_EVERY = 40, 10
"""all places are found anew with each touch while there are few, and then with every so manieth"""


def found_again(a: Agreement) -> bool:
    """Say whether a touch that nothing led to is another one's place; one that was followed may be less like it."""
    return agrees(a) and a.unlike <= MOST_UNLIKE


def alike(a: Agreement) -> bool:
    """Say whether two views agree so well that nothing else needs to tell that they show one place."""
    return agrees(a) and a.overlap >= 0.7 and a.unlike <= 0.05 and a.curvature >= 0.8


@dataclass(frozen=True, kw_only=True)
class TouchReport:
    """What became of a touch."""

    number: int
    joined_to: int
    """how many touches it overlaps"""
    placed: bool
    """whether it hangs together with the first touch"""

    @property
    def worth_saying(self) -> bool:
        """Whether a user needs to hear of it: several come a second."""
        return not self.placed or (self.number + 1) % SAID_EVERY == 0

    def in_words(self) -> str:
        """Return what became of it, and what to do."""
        if self.number and not self.joined_to:
            return f"touch {self.number} was joined to none: roll the body back to where it was touched, by small steps"
        if not self.placed:
            return f"touch {self.number}: joined, but not to where the scan began: roll on to what was touched before"
        return f"{self.number + 1} touches; the last one is joined to {self.joined_to} others"


class BodyScan(KeptPresses):
    """Touches of one body by one sensor, kept in a folder."""

    kind = "touch"

    def __init__(self, folder: Path) -> None:
        """Go on with the scan in `folder`, or begin one; InputError where it cannot be read or made."""
        super().__init__(folder)
        self._keys: dict[int, Keyframe] = {}
        self._tracked: dict[int, Touch] = {}
        """touches that the tracker followed, by their number, since the scan goes on"""
        if self.views:
            self.solved = solve(self.joints, self.first)

    def add(self, touch: Touch, source: str = "this touch") -> TouchReport:
        """Take a touch; say what became of it.

        Raises InputError for one of another sensor, and where it cannot be written.
        """
        self.refuse_other(touch.contact, source)
        number = self.next_number
        joints = list(self._joints(number, touch))
        self.keep(number, touch.contact, joints)
        self._tracked[number] = touch
        self._place(number, joints)
        return TouchReport(number=number, joined_to=len(joints), placed=number in self.solved.poses)

    @property
    def room(self) -> int:
        """How many more touches may come."""
        return max(MOST_TOUCHES - len(self.views), 0)

    def mesh(self) -> Mesh:
        """Return the surface of all touches that hang together."""
        self.solved = solve(self.joints, self.first)
        return fused([(self.views[number], self.solved.poses[number]) for number in self.placed])

    def write_mesh(self, mesh: Mesh) -> None:
        """Write the surface and its picture."""
        self.write(lambda: write_file(self.folder / MESH, mesh.ply()))
        self.write(lambda: write_file(self.folder / PRINTED, mesh.stl()))
        self.write(lambda: write_png(self.folder / PICTURE, mesh_picture(mesh.points_mm, mesh.triangles)))

    @property
    def contradicted(self) -> int:
        """How many overlaps contradict all others, and do not count."""
        return sum(weight < LEFT_OUT for weight in self.solved.weights)

    # ---- where a touch lies ----

    def _place(self, number: int, joints: list[Joint]) -> None:
        """Find the place of a touch: with those of all others while they are few, else by one joint most times."""
        placing, poses = self._placing(joints), self.solved.poses
        connects = any(joint.one not in poses for joint in joints)
        if placing is None or connects or number < FEW or number % SOLVED_EVERY == 0:
            self.solved = solve(self.joints, self.first)
        else:
            placed = {**poses, number: poses[placing.one] @ inverse(placing.pose)}
            self.solved = Solved(placed, (*self.solved.weights, *[1.0] * len(joints)))

    def _joints(self, number: int, touch: Touch) -> Iterator[Joint]:
        """Yield what a new touch has in common with others: with those that the tracker says, or with any."""
        view = touch.view
        found = list(self._where(number, view, dict(self._by_tracker(touch))))
        if not self._placing(found) and (number % SEARCHED_EVERY == 0 or not self._follows(touch)):
            found += self._found(number, view, set(self.views) - {joint.one for joint in found})
        yield from found
        placing = self._placing(found)
        if placing is not None:
            lies = self.solved.poses[placing.one] @ inverse(placing.pose)
            told = {joint.one for joint in found}
            poses = {one: inverse(lies) @ pose for one, pose in self.solved.poses.items() if one not in told}
            yield from self._where(number, view, poses)

    def _placing(self, joints: list[Joint]) -> Joint | None:
        """Return a joint with a touch whose place is known."""
        return next((joint for joint in joints if joint.one in self.solved.poses), None)

    def _follows(self, touch: Touch) -> bool:
        """Say whether the tracker has followed this object to an earlier touch."""
        return any(one.number == touch.number for one in self._tracked.values())

    def _by_tracker(self, touch: Touch) -> Iterator[tuple[int, Array]]:
        """Yield the touches of the same object, and the poses that carry them to this one, by the tracker."""
        for number, one in self._tracked.items():
            if one.number == touch.number:
                yield number, touch.motion @ inverse(one.motion)

    def _where(self, number: int, view: View, poses: dict[int, Array]) -> Iterator[Joint]:
        """Yield joints with touches that may overlap by poses near which they are carried to this one."""
        for one, pose in poses.items():
            if pose[2, 2] > STEEPEST and covered(self._key(one).view, view, pose) > LEAST_COVERED:
                joint = self._joined(one, number, view, pose)
                if joint is not None:
                    yield joint

    def _joined(
        self, one: int, number: int, view: View, start: Array, believed: Callable[[Agreement], bool] = agrees
    ) -> Joint | None:
        """Return what two touches have in common; None where it is not to be believed, or leaves a direction open."""
        key = self._key(one)
        found = register(key, view, start) if key.registrable else None
        if found is None:
            return None
        agreed, told = agreement(key, view, found), information(key, view, found)
        if not believed(agreed) or told.told.shape[1] < len(SCALE):
            return None
        covariance = told.covariance / SCALE[:, None] / SCALE
        common = agreed.overlap * key.view.area_mm2
        return Joint(one, number, found.pose, key.centre_mm, covariance, common, agreed.slope)

    def _found(self, number: int, view: View, among: set[int]) -> list[Joint]:
        """Return the joint of a touch that nobody knows, with one of the last touches, or of all; none: no joint."""
        near = self._searched(number, view, set(sorted(among)[-LAST:]), found_again)
        joint = near or self._searched(number, view, among, alike)
        return [joint] if joint is not None else []

    def _searched(
        self, number: int, view: View, among: set[int], believed: Callable[[Agreement], bool]
    ) -> Joint | None:
        """Return what a touch has in common with the one that it is likest to, of those `among`."""
        tried: list[tuple[float, int, Array]] = []
        for one in sorted(among):
            coarse = Keyframe(self._key(one).view, COARSE_POINTS)
            starts = guesses(coarse.view, view) + spins(coarse.view, view) if coarse.registrable else []
            for start in starts:
                found = register(coarse, view, start, most_steps=TRIED_STEPS)
                if found is not None:
                    tried.append((score(agreement(coarse, view, found)), one, found.pose))
        best = sorted(tried, key=lambda each: each[0])[:TRIED]
        joints = (self._joined(one, number, view, pose, believed) for _, one, pose in best)
        return next((joint for joint in joints if joint is not None), None)

    def _key(self, number: int) -> Keyframe:
        if number not in self._keys:
            self._keys[number] = Keyframe(view_of(self.views[number]))
        return self._keys[number]
