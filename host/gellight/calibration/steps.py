"""The steps of a calibration in their order; what an earlier run finished is not done again."""

from gellight.bundle.bundle import Bundle
from gellight.calibration.fitting import fit
from gellight.calibration.pin_grid import collect_grid, straighten
from gellight.calibration.preparing import prepare, prepare_again
from gellight.calibration.pressing import collect_presses
from gellight.calibration.probing import measure_pixel_size
from gellight.calibration.session import Session
from gellight.calibration.untouched import compare_with_reference, take_reference
from gellight.calibration.verifying import verify


def run_steps(session: Session) -> Bundle | None:
    """Go through all steps and return the bundle that passed, None where the verdict was bad."""
    for step, first, again in (
        ("prepare", prepare, prepare_again),
        ("reference", take_reference, compare_with_reference),
        ("pixel_size", measure_pixel_size, None),
        ("lens", collect_grid, None),
        ("presses", collect_presses, None),
        ("fit", fit, None),
    ):
        if step not in session.display.steps:
            continue
        session.display.begin_step(step)
        if session.folder.done(step) is None:
            first(session)
        elif again:
            again(session)
        if figures := session.folder.done(step):
            session.display.add_figures(step, figures)
    straighten(session)
    session.display.begin_step("verify")
    return verify(session)
