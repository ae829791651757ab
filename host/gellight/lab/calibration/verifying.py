"""Step 6: fresh presses judge the draft; only what passes is written."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import InputError, printable
from gellight.bundle.bundle import REPORT, Bundle, Description, load_bundle, write_bundle
from gellight.bundle.limits import Limits
from gellight.frame_path.pipeline import Reconstructor
from gellight.frames.frames import CameraFrame, TactileFrame
from gellight.frames.image_files import read_image
from gellight.lab.calibration.display import Progress
from gellight.lab.calibration.preparing import led_settings
from gellight.lab.calibration.pressing import ball_of, circle_of
from gellight.lab.calibration.records import (
    CheckErrors,
    Circle,
    PixelSize,
    Preparation,
    Verdict,
    Verification,
)
from gellight.lab.calibration.report import Example, page
from gellight.lab.calibration.run import CalibrationRun
from gellight.lab.calibration.sensing import Capture, check_light, detector_of, next_press, wait_free
from gellight.lab.calibration.state import CheckRecord
from gellight.lab.report.pictures import depth_picture, difference_picture, with_circle
from gellight.lab.simulator.virtual_hand import VirtualHand
from gellight.lab.training.presses import Ball, Press
from gellight.lab.training.validation import ALIKE, press_error
from gellight.reconstruction.errors import surface_errors
from gellight.reconstruction.force import Layer

Floats = NDArray[np.float32]


@dataclass(frozen=True)
class Judge:
    """What every fresh press is held against."""

    reconstructor: Reconstructor
    ball: Ball
    layer: Layer | None
    """the soft gel, where known"""

    def errors(self, frame: CameraFrame, press: Press) -> tuple[TactileFrame, CheckErrors]:
        """Return what is felt of a press of the ball, and its errors."""
        felt = self.reconstructor.reconstruct(frame)
        error = press_error(press, self.ball, felt, self.layer)
        true = surface_errors(felt, frame.truth) if frame.truth else None
        return felt, CheckErrors(
            depth_mm=error.depth_mae_mm,
            normal_deg=error.mean_deg,
            indentation_mm=felt.contact.indentation_mm,
            felt_over_expected=error.indentation.share if error.indentation else None,
            true_depth_mm=true.contact_depth_mm if true else None,
            true_normal_deg=true.normal_deg if true else None,
        )


MORE_PRESSES = 12
"""asked for after a bad verdict, beside those there are"""


def verify(run: CalibrationRun) -> Bundle | None:
    """Collect fresh presses, judge the draft by them, and write the bundle if it passes."""
    draft = load_bundle(run.folder.draft)
    # A draft that another version began may have a lens; circles are those of the picture.
    judge = Judge(Reconstructor(draft, undistorted=False), ball_of(run), run.layer)
    reference, detector = run.folder.reference(), detector_of(run)

    def press(hand: VirtualHand) -> None:
        number = len(run.folder.state.checks) + run.folder.state.steps.refused_checks
        hand.check(number, judge.ball.pixel_size_mm, run.camera.image_shape)

    while len(run.folder.state.checks) < run.options.verifications:
        _announce(run)
        with next_press(run, detector, press) as capture:
            assert capture is not None
            _take(run, capture, reference, judge)
    wait_free(run, detector)
    _announce(run)
    return _conclude(run, draft, judge)


def _announce(run: CalibrationRun) -> None:
    run.display.update(
        instruction="Press the ball at fresh places, its whole contact in the picture: these presses judge the "
        "calibration and are not trained on.",
        progress=Progress(done=len(run.folder.state.checks), wanted=run.options.verifications, unit="presses"),
    )


def _take(run: CalibrationRun, capture: Capture, reference: Floats, judge: Judge) -> None:
    image = capture.frame.image  # one frame, as the running sensor sees it
    try:
        check_light(image, "the press")
        circle = circle_of(capture.image, reference, judge.ball)
        _check_whole(circle, image.shape)
    except InputError as error:
        refused = run.folder.count_refused_check()
        run.refuse(error, tolerate=refused <= run.options.verifications)
        return
    felt, errors = judge.errors(capture.frame, Press(image=run.folder.path, **dict(circle)))
    record = run.folder.add_check(image, circle, errors)
    run.display.update(problem="", press=record.shown("checked"))
    difference = difference_picture(image - reference)
    run.display.show(
        press=with_circle(image, **dict(circle)), difference=difference, verify=depth_picture(felt.depth_mm)
    )


def _check_whole(circle: Circle, shape: tuple[int, ...]) -> None:
    x, y = circle.center_x_px, circle.center_y_px
    if min(x, y, shape[1] - 1 - x, shape[0] - 1 - y) < circle.contact_radius_px:
        raise InputError(f"the contact at ({x:.0f}, {y:.0f}) px leaves the picture: press nearer to the middle")


def _conclude(run: CalibrationRun, draft: Bundle, judge: Judge) -> Bundle | None:
    figures = summary(run.folder.state.checks)
    verdict = verdict_on(figures, run.options.limits)
    run.display.add_figures(figures)
    run.display.update(verdict=verdict, instruction=verdict.text)
    if not verdict.passed:
        run.folder.want_more(MORE_PRESSES)
        return None
    report = page(run, verdict, figures, _example(run, judge))
    bundle = _write(run, draft, figures, report)
    run.folder.finish(figures)
    run.folder.close()
    run.display.update(bundle=str(run.options.out))
    return bundle


def summary(checks: list[CheckRecord]) -> Verification:
    """Return the means over the fresh presses of the ball."""
    each = [check.figures.as_json() for check in checks]
    return Verification(presses=len(checks), **{name: float(np.mean([one[name] for one in each])) for name in each[0]})


def verdict_on(figures: Verification, limits: Limits) -> Verdict:
    """Judge the mean errors: each depth error that is known, and the normals."""
    depth_mm = max(figures.depth_mm, figures.known_depth_mm)
    passed = depth_mm <= limits.depth_mm and figures.normal_deg <= limits.normal_deg
    text = f"Passed. {_words(figures)}."
    if not passed:
        text = (
            f"Not passed. {_words(figures)}; wanted are {1000 * limits.depth_mm:.0f} µm and {limits.normal_deg:g} "
            "degrees. Nothing was replaced. Press more, and check the radius of the ball."
        )
    depth_um, ball_deg = round(1000 * figures.known_depth_mm, 1), round(figures.normal_deg, 2)
    return Verdict(passed=passed, depth_um=depth_um, normal_deg=ball_deg, text=text)


def _words(figures: Verification) -> str:
    shape = f"{1000 * figures.depth_mm:.0f} µm with the mean error of each press taken off"
    depth = f"shape of the depth off by {shape}, since a contact circle does not say how deep its rim lies"
    if figures.true_depth_mm is not None:
        depth = f"depth off by {1000 * figures.true_depth_mm:.0f} µm on average in contact ({shape})"
    found = f"{figures.presses} fresh presses: {depth}; normals off by {figures.normal_deg:.2f} degrees on average"
    share = figures.felt_over_expected
    if share is None:
        return found
    found += f"; felt {share:.2f} times as deep as contact mechanics expect of the circles"
    return found if abs(share - 1) <= ALIKE else f"{found}: check the thickness of the gel, the ball and the reference"


def _example(run: CalibrationRun, judge: Judge) -> Example:
    """The fresh press with the median depth error, reconstructed again."""
    checks = sorted(run.folder.state.checks, key=lambda check: check.figures.known_depth_mm)
    press = checks[len(checks) // 2].press(run.folder.path)
    image = read_image(press.image)
    frame = CameraFrame(image=image, time_s=0.0, sequence=0, source=printable(press.image))
    return Example(image, press, judge.reconstructor.reconstruct(frame), judge.ball)


def _write(run: CalibrationRun, draft: Bundle, figures: Verification, report: str) -> Bundle:
    """Write the draft as the bundle, with all that it holds and all that was measured since."""
    prepared = run.folder.figures(Preparation)
    measured = {
        "verification": figures.as_json(),
        "pixel_size": run.folder.figures(PixelSize).as_json(),
        "prepare": prepared.as_json(),
    }
    kept = draft.manifest.model_dump(include=set(Description.__annotations__))
    return write_bundle(
        run.options.out,
        reference=draft.reference,
        network=draft.network,
        network_name=draft.manifest.network,
        metrics={**draft.metrics, **measured},
        extra_files={**draft.files, REPORT: report.encode()},
        overwrite=run.options.overwrite,
        **{
            **kept,
            "name": run.folder.state.name,
            "gel_thickness_mm": run.gel_thickness_mm,
            "led": led_settings(prepared.led),
            "camera": prepared.camera,
        },
    )
