"""Step 4: ball presses. A press that holds still is taken; its circle is found and shown, and can be corrected."""

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from gellight.base.errors import BundleError, InputError
from gellight.frames.image_files import read_image
from gellight.lab.calibration.coverage import advice, coverage
from gellight.lab.calibration.display import Picture, Progress
from gellight.lab.calibration.live_error import LiveError
from gellight.lab.calibration.records import BallPresses, Circle, PixelSize
from gellight.lab.calibration.run import CalibrationRun
from gellight.lab.calibration.sensing import check_light, detector_of, next_press, wait_free
from gellight.lab.calibration.state import PressRecord
from gellight.lab.report.pictures import difference_picture, with_circle
from gellight.lab.simulator.virtual_hand import VirtualHand
from gellight.lab.training.labelling.circle import find_circle
from gellight.lab.training.labelling.pixel_ratio import pixel_ratio
from gellight.lab.training.presses import Ball

_SHAPE_PRESSES = 8
"""after which it is first asked whether pixels are square"""
_PATIENCE = 0.5
"""an automatic routine gives up when more than this share of its presses is refused"""


def ball_of(run: CalibrationRun) -> Ball:
    """Return the ball as the camera sees it, now that the size of a pixel is known."""
    size_mm = run.folder.figures(PixelSize).pixel_size_mm
    radius_mm, height_mm = run.options.tools.ball_radius_mm, run.camera_height_mm
    return Ball(radius_mm=radius_mm, pixel_size_mm=size_mm, camera_height_mm=height_mm)


def collect_presses(run: CalibrationRun) -> None:
    """Collect ball presses until there are enough, each kept at once."""
    _Collector(run).collect()


class _Collector:
    """Collects the presses of one calibration."""

    def __init__(self, run: CalibrationRun) -> None:
        self.run = run
        self.reference = run.folder.reference()
        self.ball = ball_of(run)
        self.detector = detector_of(run)
        self.live = LiveError(self.reference, self.ball)
        for record in run.folder.state.presses:
            self.learn(record)
        self.refused = 0
        self.attempts = len(run.folder.state.presses)
        """of the virtual hand"""
        self.enough = False
        self.wanted = run.options.presses + run.folder.state.extra_presses

    def collect(self) -> None:
        run = self.run
        self.show_progress()
        with run.offering("next", "correct", "drop"):
            while not self.enough and len(run.folder.state.presses) < self.wanted:
                with next_press(run, self.detector, self.press_ball, self.attend) as capture:
                    if capture is not None:
                        self.take(capture.image)
            wait_free(run, self.detector)
            self.attend()
        self.check_pixels()
        if run.hand:
            self.drop_outliers()
        run.folder.finish(self.figures())

    def press_ball(self, hand: VirtualHand) -> None:
        hand.ball(self.attempts, self.ball.pixel_size_mm, self.run.camera.image_shape)
        self.attempts += 1

    def attend(self) -> bool:
        """Do what the user asked for; True when they want no more presses."""
        chosen = self.run.next_action()
        if chosen is None:
            return self.enough
        action, arguments = chosen
        try:
            if action == "drop":
                self.drop(arguments)
            elif action == "correct":
                self.correct(arguments)
            elif action == "next":
                self.stop()
        except InputError as error:
            self.run.display.update(problem=str(error))
        return self.enough

    def stop(self) -> None:
        count, least = len(self.run.folder.state.presses), self.run.options.least_presses
        if count < least:
            raise InputError(f"{count} presses are too few: press at least {least - count} more times")
        self.enough = True

    def take(self, image: Picture) -> None:
        run = self.run
        try:
            check_light(image, "the press")
            circle = circle_of(image, self.reference, self.ball)
        except InputError as error:
            self.refused += 1
            run.refuse(error, tolerate=self.refused <= _PATIENCE * run.options.presses)
            return
        record = run.folder.add_press(image, circle)
        self.learn(record)
        run.display.update(problem="", press=record.shown("taken"))
        self.show_press(image, circle)
        self.show_progress()
        count, until_um = len(run.folder.state.presses), run.options.until_um
        if count == _SHAPE_PRESSES:
            self.check_pixels()
        if until_um is not None and count >= run.options.least_presses and self.live.reached(until_um):
            self.enough = True

    def drop(self, arguments: dict[str, float]) -> None:
        self.forget(int(arguments.get("number", self.last().number)))
        self.run.display.update(press=None)
        self.show_progress()

    def correct(self, arguments: dict[str, float]) -> None:
        number = self.last().number
        circle = corrected_circle(arguments, self.ball, self.run.camera.image_shape)
        record = self.run.folder.correct_press(number, circle)
        image = self.learn(record)
        self.run.display.update(press=record.shown("corrected"))
        self.show_press(image, circle)
        self.show_progress()

    def show_press(self, image: Picture, circle: Circle) -> None:
        """Show a press, and its difference image, which shows the contact best; the page draws the circle on it."""
        difference = difference_picture(image - self.reference)
        self.run.display.show(press=with_circle(image, **dict(circle)), difference=difference)

    def last(self) -> PressRecord:
        if not self.run.folder.state.presses:
            raise InputError("there is no press yet to change")
        return self.run.folder.state.presses[-1]

    def learn(self, record: PressRecord) -> Picture:
        """Let the live error learn a press, or learn it again with another circle; returns its picture."""
        press = record.press(self.run.folder.path)
        image = read_image(press.image)
        self.live.add(record.number, image, press)
        return image

    def forget(self, number: int) -> None:
        self.run.folder.drop_press(number)
        self.live.drop(number)

    def drop_outliers(self) -> None:
        for number in self.live.outliers():
            self.forget(number)
            self.refused += 1

    def check_pixels(self) -> None:
        """Ask whether pixels are square."""
        shape = pixel_ratio(self.run.folder.presses(), self.reference, self.ball)
        problem = shape.remedy(self.run.camera.image_shape) if shape else ""
        if problem:
            if self.run.hand:
                raise BundleError(problem)
            self.run.wait_for_acceptance(problem)

    def show_progress(self) -> None:
        """Show how far it is, what is covered and what is missing."""
        run = self.run
        count, wanted = len(run.folder.state.presses), self.wanted
        self.live.update()
        figures = self.figures()
        words = advice(figures.coverage, count, wanted, settled=self.live.settled())
        if figures.held_out_um:
            words += f"; presses held out are felt to {figures.held_out_um:.0f} µm"
        doubtful = self.live.outliers()
        run.display.update(
            instruction=f"Press the ball of {run.options.tools.ball_radius_mm:g} mm radius, from a "
            "light touch to 2 mm deep, each time at another place, up to the edges. Hold still until it is taken, then "
            "lift. A wrong circle can be corrected or dropped.",
            progress=Progress(done=count, wanted=wanted, unit="presses"),
            advice=words + (f"; press {doubtful[0]} contradicts the others, drop it" if doubtful else ""),
        )
        run.display.add_figures(figures)

    def figures(self) -> BallPresses:
        presses = self.run.folder.presses()
        return BallPresses(
            presses=len(presses),
            refused=self.refused,
            coverage=coverage(presses, self.ball, self.run.camera.image_shape),
            held_out=tuple(self.live.history),
            held_out_um=self.live.depth_um[-1] if self.live.depth_um else None,
        )


LEAST_SHARE = 0.15
"""of the ball's radius: a smaller contact shows too few slopes"""


def circle_of(image: NDArray[np.uint8], reference: NDArray[np.float32], ball: Ball) -> Circle:
    """Find the contact circle of a (H, W, 3) picture; InputError says why a press is refused."""
    return Circle.model_validate(find_circle(image, reference, ball=ball), from_attributes=True)


def corrected_circle(numbers: dict[str, float], ball: Ball, image_shape: tuple[int, int]) -> Circle:
    """Return the user's circle; InputError unless this ball can have made it in a (H, W) picture."""
    try:
        circle = Circle.model_validate(numbers)
    except ValidationError as error:
        names = ", ".join(Circle.model_fields)
        raise InputError(f"a circle is {names}, not {numbers}: give three numbers in px") from error
    radius, share = circle.contact_radius_px, circle.contact_radius_px / ball.radius_px
    if share >= 1:
        raise InputError(
            f"the contact has a radius of {radius:.0f} px, the ball only {ball.radius_px:.0f} px: is it a ball of "
            f"{ball.radius_mm:g} mm radius?"
        )
    if share < LEAST_SHARE:
        raise InputError(f"the press is too shallow: its contact is {radius:.0f} px in radius; press deeper")
    x, y = circle.center_x_px, circle.center_y_px
    if not (0 <= x <= image_shape[1] - 1 and 0 <= y <= image_shape[0] - 1):
        raise InputError(f"the press at ({x:.0f}, {y:.0f}) px is off the picture: press nearer to the middle")
    return circle
