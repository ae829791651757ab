"""Step 5: the LEDs are measured, the network is trained in a child process, and both are kept as a draft bundle."""

import logging
from collections.abc import Sequence

from gellight.base.errors import InputError, TrainingError
from gellight.bundle.bundle import Bundle
from gellight.lab.calibration.choices import LEAST_PRESSES
from gellight.lab.calibration.display import Progress
from gellight.lab.calibration.lights import measure_lights
from gellight.lab.calibration.pressing import ball_of
from gellight.lab.calibration.records import Fit, UntouchedGel
from gellight.lab.calibration.run import CalibrationRun
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
    trainer = rehearse(check=run.check_stopped)
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
