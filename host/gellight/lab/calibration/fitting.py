"""Step 5: the LEDs are measured, the network is trained in a child process, and both are kept as a draft bundle."""

import logging
from collections.abc import Sequence

import numpy as np

from gellight.base.errors import BundleError, InputError, TrainingError
from gellight.bundle.bundle import Bundle
from gellight.frames.picture import steps_in
from gellight.lab.calibration.choices import LEAST_PRESSES
from gellight.lab.calibration.display import Progress
from gellight.lab.calibration.pressing import ball_of
from gellight.lab.calibration.records import Fit, Preparation, UntouchedGel
from gellight.lab.calibration.run import CalibrationRun
from gellight.lab.calibration.sensing import detector_of, wait_free
from gellight.lab.optics.lights.adding import take_lights
from gellight.lab.optics.lights.ring_fit import fit_ring
from gellight.lab.training.child import RefusedTableError
from gellight.lab.training.judged_fit import fit_judged
from gellight.lab.training.presses import Press
from gellight.lab.training.training import Learning, Reference, rehearse
from gellight.lab.training.wrong_labels import contradicted_lines, sorted_out
from gellight.photometric.light_model import LightModel

logger = logging.getLogger(__name__)


def fit(run: CalibrationRun) -> None:
    """Measure the light of the LEDs, train on the presses and keep the draft.

    A like unit that is none is forgotten: where there are presses enough without it, they are learnt from alone. Raises
    TrainingError.
    """
    presses, least = run.folder.presses(), run.options.least_presses
    if len(presses) < least:
        raise InputError(f"{len(presses)} presses are too few to fit: at least {least} are needed")
    trainer = rehearse(run.options.training.trainer, check=run.check_stopped)
    lights = measure_lights(run)
    run.display.update(
        progress=Progress(),
        instruction=f"The network is being trained by {trainer}. Nothing is to be done.",
        actions=("abort",),
    )
    try:
        bundle = _draft(run, presses, lights)
    except RefusedTableError as error:
        if run.options.like is None:
            raise
        run.drop_like()
        if len(presses) < LEAST_PRESSES:
            raise TrainingError(
                f"{error}; go on, and press at least {LEAST_PRESSES - len(presses)} more times"
            ) from error
        logger.warning("%s: the presses of this unit alone are learnt from", error)
        run.display.update(problem=f"{error}: the presses of this unit alone are learnt from")
        bundle = _draft(run, presses, lights)
    run.folder.finish(Fit.model_validate({**bundle.metrics, "losses": bundle.metrics["training"]["losses"]}))


def _draft(run: CalibrationRun, presses: Sequence[Press], lights: LightModel | None) -> Bundle:
    def report(epoch: int, epochs: int, loss: float) -> None:
        run.display.update(progress=Progress(done=epoch, wanted=epochs, unit="epochs", loss=loss))

    taken, ball = run.folder.figures(UntouchedGel), ball_of(run)
    reference = Reference(image=run.folder.reference(), frames=taken.frames, noise_grey=taken.noise_grey)
    presses, contradicted = sorted_out(presses, reference, ball, check=run.check_stopped)
    for line in contradicted_lines(contradicted):
        logger.warning("%s", line)
    return fit_judged(
        presses,
        reference,
        ball,
        run.folder.draft,
        sensor=run.options.sensor,
        how=Learning(options=run.options.training, like=run.options.like, lights=lights),
        extra_files=run.camera.bundle_files,
        extra_metrics=contradicted,
        layer=run.layer,
        overwrite=True,
        progress=report,
        check=run.check_stopped,
    )


FRAMES = 8
"""averaged under each LED"""
ALIKE = 0.1
"""Radius and height of the ring by its light may differ from [geometry] by this share. Where LEDs are taken to stand a
quarter too low, shadows that are not there make deep walls twice as wrong as none that are found."""


def measure_lights(run: CalibrationRun) -> LightModel | None:
    """Return the light of each LED on the untouched gel; None where it would be of no use.

    That is without a ring; with a pin grid or a view, for shadows are sought in pictures as the camera takes them; and
    where the light does not fit the ring of [geometry], which the user is told.
    """
    steps = steps_in(run.camera.bundle_files)
    viewed = run.options.tools.pin_pitch_mm is not None or (steps is not None and steps.view is not None)
    if run.camera.ring is None or viewed:
        return None
    run.display.update(instruction="The light of each LED is measured. Touch nothing.")
    wait_free(run, detector_of(run))
    try:
        return _measured(run)
    except BundleError as error:
        problem = f"no light of single LEDs, so deep presses are felt less exactly: {error}"
        logger.warning(problem)
        run.display.update(problem=problem)
        return None


def _measured(run: CalibrationRun) -> LightModel:
    """Light the LEDs one by one; BundleError where that is not the light of the ring of [geometry]."""

    def taking(index: int, groups: int) -> None:
        run.check_stopped()
        run.display.update(progress=Progress(done=index, wanted=groups, unit="lights"))

    colours = np.array(run.folder.figures(Preparation).led, np.uint8)
    pixel_size_mm = 2 * (ball_of(run).pixel_size_mm,)
    model = take_lights(run.camera, run.options.ring, colours, pixel_size_mm, FRAMES, taking)
    told, found = model.ring, fit_ring(model, pixel_size_mm).ring
    if max(abs(found.ring_radius_mm / told.ring_radius_mm - 1), abs(found.height_mm / told.height_mm - 1)) > ALIKE:
        raise BundleError(
            f"it falls off as that of LEDs {found.height_mm:.1f} mm above the gel on a radius of "
            f"{found.ring_radius_mm:.1f} mm, [geometry] has {told.height_mm:.1f} and {told.ring_radius_mm:.1f} mm: "
            "correct camera_height_mm, mounting_height_mm and ring_radius_mm there, then `gellight calibrate lights`"
        )
    return model
