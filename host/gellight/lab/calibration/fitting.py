"""Step 5: the network is trained on the ball presses, in a child process, and kept as a draft of the bundle."""

from gellight.base.errors import InputError
from gellight.lab.calibration.choices import LEAST_PRESSES
from gellight.lab.calibration.display import Progress
from gellight.lab.calibration.pressing import ball_of
from gellight.lab.calibration.records import Fit, UntouchedGel
from gellight.lab.calibration.run import CalibrationRun
from gellight.lab.training.judged_fit import fit_judged
from gellight.lab.training.rehearsal import rehearse
from gellight.lab.training.training import Learning, Reference


def fit(run: CalibrationRun) -> None:
    """Train on the presses and keep the draft."""
    presses = run.folder.presses()
    if len(presses) < LEAST_PRESSES:
        raise InputError(f"{len(presses)} presses are too few to fit: at least {LEAST_PRESSES} are needed")
    trainer = rehearse(run.options.training.trainer, check=run.check_stopped)
    run.display.update(
        instruction=f"The network is being trained by {trainer}. Nothing is to be done.", actions=("abort",)
    )

    def report(epoch: int, epochs: int, loss: float) -> None:
        run.display.update(progress=Progress(done=epoch, wanted=epochs, unit="epochs", loss=loss))

    taken = run.folder.figures(UntouchedGel)
    bundle = fit_judged(
        presses,
        Reference(image=run.folder.reference(), frames=taken.frames, noise_grey=taken.noise_grey),
        ball_of(run),
        run.folder.draft,
        sensor=run.options.sensor,
        how=Learning(options=run.options.training),
        extra_files=run.camera.bundle_files,
        overwrite=True,
        progress=report,
        check=run.check_stopped,
    )
    run.folder.finish(Fit.model_validate({**bundle.metrics, "losses": bundle.metrics["training"]["losses"]}))
