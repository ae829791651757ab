"""The host against the reference simulator, press by press: `python -m tests.benchmarks.selfcheck`.

The ball and the ten objects are pressed into the simulated sensor; depth, normals and picture are compared. The exit
status is 1 where a comparison is out of its bounds.
"""

import sys

from gellight.bundle.bundle import load_bundle
from gellight.frame_path.pipeline import Reconstructor
from gellight.lab.simulator.simulated_camera import open_simulated
from tests.helpers.selfcheck import SelfCheck, SelfCheckResult

COLUMNS = (
    ("depth_error_mm", "depth mm"),
    ("shape_error_mm", "shape mm"),
    ("normal_error_deg", "normal deg"),
    ("contact_normal_error_deg", "in contact"),
    ("integral_error_mm", "integral mm"),
    ("picture_error_grey", "picture grey"),
    ("indentation_mm", "felt mm"),
    ("true_indentation_mm", "true mm"),
)
VERDICTS = {"passed": "ok", "failed": "OUT OF BOUNDS", "not judged": "not judged"}
CHECKED_PRESSES = (
    ("BALL", 1.0, 0.0, 0.0),
    ("BALL", 1.0, -9.0, 4.0),
    ("BALL", 1.0, 8.0, -6.0),
    ("BALL", 0.5, 5.0, 5.0),
    *((name, 0.8, 0.0, 0.0) for name in ("TSTEP", "SCROWN", "BALLVEX", "BALLCAVE", "WAVE")),
    *((name, 0.8, 0.0, 0.0) for name in ("SINWAVE", "BSWAVE", "PCONVEX", "CCONVEX", "QUCAVE")),
)
"""object, depth, x, y in mm"""


def main() -> int:
    """Press, print a row of figures each, and return the exit status."""
    bundle, passed = load_bundle("synthetic"), True
    reconstructor = Reconstructor(bundle)
    print(" ".join(["press".ljust(26), *(title.rjust(12) for _, title in COLUMNS)]))
    with open_simulated("sim://") as camera:
        judge = SelfCheck(camera, bundle.pixel_size_mm)
        for name, depth, x, y in CHECKED_PRESSES:
            camera.stage.press(name, depth, x, y)
            result = judge.compare(reconstructor.reconstruct(camera.read()))
            passed &= result.passed
            print(line(f"{name} {depth:g} mm at ({x:g}, {y:g})", result), flush=True)
    return 0 if passed else 1


def line(name: str, result: SelfCheckResult) -> str:
    """Return one row of the table."""
    numbers = [f"{getattr(result, field):12.4f}" for field, _ in COLUMNS]
    return " ".join([name.ljust(26), *numbers, VERDICTS[result.verdict]])


if __name__ == "__main__":
    sys.exit(main())
