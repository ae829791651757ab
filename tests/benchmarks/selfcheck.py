"""The host against the reference simulator, press by press: `python -m tests.benchmarks.selfcheck`.

The ball and the ten objects are pressed into the simulated sensor; depth, normals and picture are compared. The exit
status is 1 where a comparison is out of its bounds. With `bounds` each object is pressed to each depth of a grid at
three places; printed are the worst errors, as `tests/helpers/selfcheck.py` holds them.
"""

import sys
from collections.abc import Iterator, Sequence
from itertools import groupby, product

from gellight.bundle.bundle import load_bundle
from gellight.frame_path.pipeline import Reconstructor
from gellight.lab.simulator.simulated_camera import open_simulated
from sim_reference.objects import OBJECT_NAMES
from tests.helpers.selfcheck import KINDS, SelfCheck, SelfCheckResult

Press = tuple[str, float, float, float]
"""object, depth, x, y in mm"""

COLUMNS = *KINDS, "shape_error_mm", "indentation_mm"
CHECKED: tuple[Press, ...] = (
    ("BALL", 1.0, 0.0, 0.0),
    ("BALL", 1.0, -9.0, 4.0),
    ("BALL", 1.0, 8.0, -6.0),
    ("BALL", 0.5, 5.0, 5.0),
    *((name, 0.8, 0.0, 0.0) for name in ("TSTEP", "SCROWN", "BALLVEX", "BALLCAVE", "WAVE")),
    *((name, 0.8, 0.0, 0.0) for name in ("SINWAVE", "BSWAVE", "PCONVEX", "CCONVEX", "QUCAVE")),
)
GRID: tuple[Press, ...] = tuple(
    (name, depth, x, y)
    for name, depth, (x, y) in product(
        OBJECT_NAMES, (0.4, 0.8, 1.2, 1.6, 2.0), ((0.0, 0.0), (-10.0, 6.0), (10.0, -6.0))
    )
)


def main() -> int:
    """Press, print a row of figures each, and return the exit status."""
    if sys.argv[1:] == ["bounds"]:
        for (name, depth), found in groupby(compared(GRID), key=lambda pressed: pressed[0][:2]):
            results = [result for _, result in found]
            print(name, depth, [round(max(getattr(one, kind) for one in results), 4) for kind in KINDS], flush=True)
        return 0
    passed = True
    print(" ".join(["press".ljust(26), *(kind.rjust(18) for kind in COLUMNS)]))
    for (name, depth, x, y), result in compared(CHECKED):
        passed &= result.passed
        numbers = [f"{getattr(result, kind):18.4f}" for kind in COLUMNS]
        judged = "ok" if result.passed else "OUT OF BOUNDS"
        print(" ".join([f"{name} {depth:g} mm at ({x:g}, {y:g})".ljust(26), *numbers, judged]), flush=True)
    return 0 if passed else 1


def compared(presses: Sequence[Press]) -> Iterator[tuple[Press, SelfCheckResult]]:
    """Make presses, one frame each, and compare them."""
    bundle = load_bundle("synthetic")
    reconstructor = Reconstructor(bundle)
    with open_simulated("sim://") as camera:
        judge = SelfCheck(camera, bundle.pixel_size_mm)
        for press in presses:
            camera.stage.press(*press)
            yield press, judge.compare(reconstructor.reconstruct(camera.read()))


if __name__ == "__main__":
    sys.exit(main())
