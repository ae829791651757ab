"""What another unit's presses are worth to the guided routine: `python -m tests.benchmarks.like_units`.

One simulated unit is calibrated by the virtual hand. Then others, whose LEDs are another draw, or dimmer as well, are
calibrated with 2, 5, 10 ball presses, without and with that one's bundle (`--like`). The same presses are taken both
times; six fresh ones judge. Printed are the depth in contact and the normals in contact against the simulator's truth,
how unlike the first unit's answers are, and why a calibration failed.
"""

import shutil
import tempfile
from dataclasses import dataclass
from pathlib import Path

from gellight.bundle.bundle import Bundle, load_bundle
from gellight.bundle.limits import Limits
from gellight.lab.calibration.choices import RoutineOptions
from gellight.lab.calibration.folder import Folder
from gellight.lab.calibration.routine import Routine
from gellight.lab.calibration.state import state_in
from gellight.lab.simulator.virtual_hand import hand_of
from gellight.opening import open_camera

FIRST = "sim://?fps=500&seed=11&led_spread=0.1"
OTHERS = {
    "LEDs of another draw": "sim://?fps=500&seed=12&led_spread=0.1",
    "dimmer by 30 %": "sim://?fps=500&seed=13&led_spread=0.1&dim=0.3",
}
COUNTS = (2, 5, 10)
ANY = Limits(depth_mm=10.0, normal_deg=90.0)
"""every calibration passes, for what fails is measured too"""


@dataclass(frozen=True, kw_only=True)
class AnyNumber(RoutineOptions):
    """A calibration of however few presses."""

    @property
    def least_presses(self) -> int:
        """One."""
        return 1


def calibrated(url: str, out: Path, presses: int, like: Bundle | None = None) -> Routine:
    """Calibrate a unit by the virtual hand, or go on with what lies beside `out`."""
    options = AnyNumber(out=out, presses=presses, like=like, limits=ANY)
    with open_camera(url) as camera:
        routine = Routine(camera, options, out.with_suffix(".state"), hand=hand_of(camera, seed=0))
        routine.act("start")
        routine.join()
    return routine


def begin_again(begun: Path, state: Path, presses: int) -> None:
    """Copy a calibration as it stood when it had this number of presses."""
    shutil.copytree(begun, state)
    kept = state_in(state)
    steps = kept.steps.model_copy(update=dict.fromkeys(("presses", "fit", "verify")))
    again = {"steps": steps, "presses": kept.presses[:presses], "checks": [], "finished": False}
    Folder(state, kept.model_copy(update=again)).save()


def told(routine: Routine) -> str:
    """Return the errors of a calibration, or why there are none."""
    steps = routine.display.figures
    if routine.error or steps.verify is None or steps.fit is None:
        return f"{routine.error}"
    found, unlike = steps.verify, (steps.fit.training.model_extra or {}).get("unlikeness")
    known = "" if unlike is None else f", unlike by {unlike:.0%}"
    return f"{1000 * found.known_depth_mm:.0f} µm, {found.true_contact_normal_deg:.2f} deg{known}"


def main() -> None:
    """Print a line for each unit and number of presses."""
    place = Path(tempfile.mkdtemp(prefix="gellight-like-"))
    calibrated(FIRST, place / "first", 20)
    first = load_bundle(place / "first")
    for number, (name, url) in enumerate(OTHERS.items()):
        begun = place / f"{number}"
        calibrated(url, begun, max(COUNTS))
        for count in COUNTS:
            for like in (None, first):
                out = place / f"{number}-{count}{'-like' if like else ''}"
                begin_again(begun.with_suffix(".state"), out.with_suffix(".state"), count)
                routine = calibrated(url, out, count, like)
                print(f"{name}, {count} presses, {'with' if like else 'without'}: {told(routine)}", flush=True)


if __name__ == "__main__":
    main()
