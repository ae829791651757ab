"""How often slip is told as it is: `python -m tests.benchmarks.slip [SEED]`.

Drags over the simulated gel, frame by frame and held at the end, in pictures with noise. A held object does not slip;
one that is moved slips as a whole where no part of the contact sticks, in part where less than half of it does.
"""

import sys
from collections import Counter, deque
from dataclasses import replace

import cv2
import numpy as np

from gellight.bundle.bundle import load_bundle
from gellight.frame_path.pipeline import Reconstructor
from gellight.frames.picture import PreparedCamera
from gellight.frames.shear import Slip
from gellight.reconstruction.following import ContactFollower
from gellight.reconstruction.shear.slip import SlipFollower
from tests.benchmarks.shear import Case, cases, opened, truth_of

DRAGS, REST, MOVING = 8, 5, 22
FRAME_S = 1 / 30
SETTLED = 2
"""frames within which a change of what happens is to be told"""


def told(case: Case, query: str) -> list[tuple[str, Slip]]:
    """Return what happens in each frame of a drag between two rests, and what is told."""
    camera, steps = opened(query)
    contacts, slips = ContactFollower(), SlipFollower()
    rows: list[tuple[str, Slip]] = []
    shares = np.clip(np.arange(-REST, MOVING + 2 * REST), 0, MOVING) / MOVING
    lately: deque[str] = deque(maxlen=SETTLED + 1)
    with PreparedCamera(camera, steps) as prepared:
        prepared.read()  # the dots at rest
        camera.stage.press(case.name, case.depth_mm, *case.place_mm)
        for number, share in enumerate(shares):
            moves = number > 0 and share > shares[number - 1]
            if moves:
                camera.stage.drag(*(float(share * one) for one in case.motion))
            taken = replace(prepared.read(), time_s=number * FRAME_S)
            slip = slips.follow(contacts.follow(RECONSTRUCTOR.reconstruct(taken))).slip
            assert slip is not None
            lately.append(happens(truth_of(camera).sticking_share) if moves else "held")
            rows.append((lately[-1] if len(set(lately)) == 1 else "changes", slip))
    return rows


def happens(sticking: float) -> str:
    """Name what happens in a contact that is moved."""
    return "full" if sticking == 0 else "partial" if sticking < 0.5 else "mostly sticks"


def main() -> None:
    """Print how often each state is told of what happens."""
    counts: Counter[tuple[str, str]] = Counter()
    for number, case in enumerate(cases(int(sys.argv[1]) if len(sys.argv) > 1 else 7, DRAGS, 1.6, 0.0)):
        rows = told(case, "dots=9x7")
        counts.update((truth, str(slip.state)) for truth, slip in rows)
        states = " ".join(f"{truth[0]}{slip.state[0]}" for truth, slip in rows)
        print(f"{number} {case.name} {case.depth_mm:.2f} mm, {np.hypot(*case.motion[:2]):.2f} mm: {states}", flush=True)
    for truth in ("held", "mostly sticks", "partial", "full"):
        print(f"{truth}: " + ", ".join(f"{state} {n}" for (what, state), n in sorted(counts.items()) if what == truth))


RECONSTRUCTOR = Reconstructor(load_bundle("synthetic"))

if __name__ == "__main__":
    cv2.setNumThreads(1)
    main()
