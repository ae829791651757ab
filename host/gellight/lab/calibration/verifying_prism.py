"""A prism of known angle judges the draft beside the ball: flat faces and a sharp edge, which no ball shows."""

from gellight.base.errors import InputError
from gellight.lab.calibration.display import Progress
from gellight.lab.calibration.judging import Floats, Judge
from gellight.lab.calibration.records import Edge
from gellight.lab.calibration.run import CalibrationRun
from gellight.lab.calibration.sensing import Capture, check_light, detector_of, next_press, wait_free
from gellight.lab.report.pictures import depth_picture, difference_picture
from gellight.lab.simulator.virtual_hand import VirtualHand
from gellight.lab.training.labelling import find_prism
from gellight.lab.training.labelling.detection import drawn
from gellight.lab.training.prisms import prism_angle_rad


def check_prism(run: CalibrationRun, judge: Judge, angle_deg: float) -> None:
    """Collect fresh presses of the prism and judge each, until there are enough or the user goes on without.

    angle_deg: between each face and the gel at rest.
    """
    reference, detector, state = run.folder.reference(), detector_of(run), run.folder.state

    def press(hand: VirtualHand) -> None:
        number = len(state.prisms) + state.steps.refused_checks
        hand.prism(number, angle_deg, judge.ball.pixel_size_mm, run.camera.image_shape)

    with run.offering("next"):
        while len(state.prisms) < run.options.prism_presses and not state.steps.without_prism:
            _announce(run, angle_deg)
            with next_press(run, detector, press, run.skipped) as capture:
                if capture is None:
                    run.folder.go_without_prism()
                else:
                    _take(run, capture, reference, judge, angle_deg)
        wait_free(run, detector)
    _announce(run, angle_deg)


def _announce(run: CalibrationRun, angle_deg: float) -> None:
    run.display.update(
        instruction=f"Press the prism, whose faces are at {angle_deg:g} degrees to the gel: edge first, upright, at "
        "least 1 mm deep, each time at another place and turned another way. Its faces judge the calibration and are "
        "not trained on. Without it, go on.",
        progress=Progress(
            done=len(run.folder.state.prisms), wanted=run.options.prism_presses, unit="presses of the prism"
        ),
    )


def _take(run: CalibrationRun, capture: Capture, reference: Floats, judge: Judge, angle_deg: float) -> None:
    """Judge and keep one press; where no prism is found, or it says little, show the reason."""
    image = capture.frame.image  # one frame, as the running sensor sees it
    try:
        check_light(image, "the press")
        contact = find_prism(capture.image, reference, angle_rad=prism_angle_rad(angle_deg, "the prism"))
    except InputError as error:
        refused = run.folder.count_refused_check()
        run.refuse(error, tolerate=refused <= run.options.verifications)
        return
    felt, errors = judge.prism_errors(capture.frame, contact.press(run.folder.path))
    record = run.folder.add_prism(image, Edge.model_validate(contact, from_attributes=True), errors)
    run.display.update(problem="", press=record.shown())
    run.display.show(
        press=drawn(image, contact),
        difference=difference_picture(image - reference),
        verify=depth_picture(felt.depth_mm),
    )
