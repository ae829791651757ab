"""How far a map is right: `python -m tests.benchmarks.scan [NAME ...] [--kept-apart]`.

Ten presses of a flat part with a relief that is known, by the elastic layer, photographed with noise of 1 grey level
and reconstructed by GelNet; nothing of their places is given away. A row a part:

- how many presses were joined;
- rms of the map to the part where the gel reached it, beside the plane and paraboloid that no map knows, and beside the
  plane alone;
- what the map states: the rms of its errors, and how many pixels lie within twice that;
- seams: the rms difference of two presses where both reached the part;
- how much was reached of what was seen, and how much of that was truly touched, by the contact of the simulated gel;
- how far joined pairs are off: median and worst, along the part and turned;
- processor time of joining, solving and fusing.
"""

import argparse
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

from gellight_scan.contact_view import ContactView
from gellight_scan.fusion import Fused
from gellight_scan.pairs import Joint
from gellight_scan.scan import Scan
from gellight_scan.tracking.rigid import inverse, twist_of
from sim_reference.surface import Surface
from tests.helpers.reliefs import Plate, felt, places, press

HELD_OUT = ("field06", "field15")
"""kept apart: looked at once, when nothing is changed any more"""


@dataclass(frozen=True, kw_only=True)
class Part:
    rms_mm: float
    seed: int
    columns: int
    rows: int
    steps_mm: tuple[float, float]
    deep_mm: float
    """of the highest point, beyond first touch"""

    @property
    def plate(self) -> Plate:
        return Plate(self.rms_mm, self.seed, size_mm=(180.0, 80.0) if self.rows == 1 else (120.0, 90.0))

    @property
    def poses(self) -> list[np.ndarray]:
        return places(self.columns, self.rows, self.steps_mm, self.seed)


PARTS = {
    "cast06": Part(rms_mm=0.06, seed=1, columns=5, rows=2, steps_mm=(16, 14), deep_mm=0.4),
    "cast15": Part(rms_mm=0.15, seed=1, columns=5, rows=2, steps_mm=(16, 14), deep_mm=0.9),
    "strip06": Part(rms_mm=0.06, seed=2, columns=10, rows=1, steps_mm=(14, 0), deep_mm=0.4),
    "strip15": Part(rms_mm=0.15, seed=5, columns=10, rows=1, steps_mm=(14, 0), deep_mm=0.9),
    "field06": Part(rms_mm=0.06, seed=3, columns=4, rows=3, steps_mm=(17, 13), deep_mm=0.4),
    "field15": Part(rms_mm=0.15, seed=4, columns=4, rows=3, steps_mm=(17, 13), deep_mm=0.9),
}
TUNED_ON = tuple(name for name in PARTS if name not in HELD_OUT)


@lru_cache(maxsize=2)
def pressed(name: str) -> list[tuple[Surface, ContactView]]:
    """Return the true gel and what is felt of each press."""
    part = PARTS[name]
    surfaces = [press(part.plate, pose, part.deep_mm) for pose in part.poses]
    return [(surface, felt(surface, 1000 * part.seed + number)) for number, surface in enumerate(surfaces)]


def errors_mm(part: Part, fused: Fused, first: np.ndarray, *, curved: bool) -> np.ndarray:
    """Return by how much the (N,) heights of a map are off, beside a plane, and unless `curved` a paraboloid."""
    heights = fused.height_map
    rows, columns = np.nonzero(heights.reached)
    x, y = (origin + at * heights.pixel_mm for origin, at in zip(fused.origin_mm, (columns, rows), strict=True))
    off = heights.height_mm[rows, columns] - part.plate.seen(first, x, y)
    x, y = x - x.mean(), y - y.mean()
    form = np.stack([np.ones_like(x), x, y, *([] if curved else [x * x, x * y, y * y])], axis=1)
    return np.asarray(off - form @ np.linalg.lstsq(form, off, rcond=None)[0])


def place_errors(part: Part, joints: Sequence[Joint]) -> np.ndarray:
    """Return (K, 2) by how many mm and degrees each joint is off."""
    rows = []
    for joint in joints:
        true = part.poses[joint.other] @ inverse(part.poses[joint.one])
        off = twist_of(inverse(true) @ joint.pose, joint.centre_mm)
        rows.append((np.linalg.norm(off[:2]), np.degrees(abs(off[5]))))
    return np.array(rows)


def judge(name: str, folder: Path) -> str:
    part, presses = PARTS[name], pressed(name)
    begun = time.process_time()
    scan = Scan(folder / name)
    for _, view in presses:
        scan.add(view)
    spent = time.process_time() - begun
    solved, fused = scan.solved, scan.fused
    assert fused is not None
    off, plane = (errors_mm(part, fused, part.poses[0], curved=curved) for curved in (False, True))
    stated = fused.height_map.error_mm[fused.height_map.reached]
    right = [(surface.contact & view.reached).sum() / max(view.reached.sum(), 1) for surface, view in presses]
    apart = place_errors(part, scan.joints)
    return "  ".join(
        (
            f"{name:8s} joined {len(solved.poses)} of {len(presses)} by {len(scan.joints)} pairs",
            f"rms {1e3 * off.std():.1f} um ({1e3 * plane.std():.1f} beside a plane)",
            f"stated {1e3 * np.sqrt((stated**2).mean()):.1f}, within twice {np.mean(np.abs(off) < 2 * stated):.2f}",
            f"seams {1e3 * fused.seam_mm:.1f} um",
            f"reached {fused.height_map.reached.sum() / fused.seen.sum():.2f}, truly {np.mean(right):.3f}",
            f"places {1e3 * np.median(apart[:, 0]):.1f} um {np.median(apart[:, 1]):.3f} deg "
            f"({1e3 * apart[:, 0].max():.1f} {apart[:, 1].max():.3f})",
            f"{spent / len(presses):.1f} s a press",
        )
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(PARTS))
    parser.add_argument("--kept-apart", action="store_true", help="also the parts that nothing was tuned on")
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        for name in asked.names or (PARTS if asked.kept_apart else TUNED_ON):
            print(judge(name, Path(folder)), flush=True)


if __name__ == "__main__":
    main()
