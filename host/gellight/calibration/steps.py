"""The steps of a calibration in their order; what an earlier run finished is not done again."""

from gellight.bundle.bundle import Bundle
from gellight.calibration.fitting import fit
from gellight.calibration.pin_grid import collect_grid, straighten
from gellight.calibration.preparing import prepare, prepare_again
from gellight.calibration.pressing import collect_presses
from gellight.calibration.probing import measure_pixel_size
from gellight.calibration.run import CalibrationRun
from gellight.calibration.untouched import compare_with_reference, take_reference
from gellight.calibration.verifying import verify


def run_steps(run: CalibrationRun) -> Bundle | None:
    """Go through all steps and return the bundle that passed, None where the verdict was bad."""
    for step, first, again in (
        ("prepare", prepare, prepare_again),
        ("reference", take_reference, compare_with_reference),
        ("pixel_size", measure_pixel_size, None),
        ("lens", collect_grid, None),
        ("presses", collect_presses, None),
        ("fit", fit, None),
    ):
        if step not in run.display.steps:
            continue
        run.display.begin_step(step)
        if run.folder.done(step) is None:
            first(run)
        elif again:
            again(run)
        if figures := run.folder.done(step):
            run.display.add_figures(step, figures)
    straighten(run)
    run.display.begin_step("verify")
    return verify(run)
