"""Step 4: ball presses. Each is noticed when it holds still, its circle found, shown, and taken unless dropped."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import BundleError, InputError
from gellight.calibration import ball_radius
from gellight.calibration.choices import LEAST_PRESSES
from gellight.calibration.circle import Circle, circle_of, drawn
from gellight.calibration.coverage import advice, coverage, coverage_picture
from gellight.calibration.live_error import LiveError
from gellight.calibration.sensing import Capture, Watcher, check_light, wait_free, wait_press
from gellight.calibration.session import Session
from gellight.frames.image_files import read_image
from gellight.training.presses import Ball

Floats = NDArray[np.float32]
_PATIENCE = 0.5
"""an automatic routine gives up when more than this share of its presses is refused"""


def ball_of(session: Session) -> Ball:
    """Return the ball as the camera sees it, now that the size of a pixel is known."""
    size = session.folder.steps["pixel_size"]["pixel_size_mm"]
    return Ball(radius_mm=session.options.ball_radius_mm, pixel_size_mm=size)


def collect_presses(session: Session) -> None:
    """Collect ball presses until there are enough, each kept at once."""
    _Collector(session).run()


class _Collector:
    """The presses of one routine."""

    def __init__(self, session: Session) -> None:
        self.session = session
        self.reference = session.folder.reference()
        self.ball = ball_of(session)
        self.watcher = Watcher(self.reference, session.folder.steps["reference"]["noise_grey"])
        self.live = LiveError(self.reference, self.ball)
        for record, press in zip(session.folder.presses, session.folder.listed("presses"), strict=True):
            self.live.add(record["number"], read_image(press.image), press)
        self.refused = 0
        self.enough = False
        self.wanted = session.options.presses + session.folder.extra_presses
        self.radius_mm: float | None = None

    def run(self) -> None:
        session = self.session
        self.tell()
        asked = len(session.folder.presses)
        with session.offering("next", "correct", "drop"):
            while not self.enough and len(session.folder.presses) < self.wanted:
                wait_free(session, self.watcher)
                if session.hand:
                    session.hand.ball(asked, self.ball.pixel_size_mm, session.camera.image_shape)
                    asked += 1
                capture = wait_press(session, self.watcher, self.attend)
                if capture is not None:
                    self.take(capture)
                if session.hand:
                    session.hand.lift()
            wait_free(session, self.watcher)
            self.attend()
        self.check_radius()
        if session.hand:
            self.drop_outliers()
        session.folder.finish("presses", self.figures())

    def attend(self) -> bool:
        """Do what the user asked for; True when they want no more presses."""
        asked = self.session.asked()
        if asked is None:
            return self.enough
        action, arguments = asked
        try:
            if action == "drop":
                self.drop(arguments)
            elif action == "correct":
                self.correct(arguments)
            elif action == "next":
                self.stop()
        except InputError as error:
            self.session.bulletin.post(problem=str(error))
        return self.enough

    def stop(self) -> None:
        count = len(self.session.folder.presses)
        if count < LEAST_PRESSES:
            raise InputError(f"{count} presses are too few: press at least {LEAST_PRESSES - count} more times")
        self.enough = True

    def take(self, capture: Capture) -> None:
        session = self.session
        try:
            check_light(capture.image, "the press")
            circle = circle_of(capture.image, self.reference, self.ball)
        except InputError as error:
            self.refused += 1
            session.bulletin.post(problem=str(error))
            if session.hand and self.refused > _PATIENCE * session.options.presses:
                raise
            return
        record = session.folder.add("presses", capture.image, circle.as_json())
        session.bulletin.post(problem="", press={**record, "state": "taken"})
        session.bulletin.show(press=drawn(capture.image, circle))
        self.live.add(record["number"], capture.image, session.folder.listed("presses")[-1])
        self.tell()
        if len(session.folder.presses) == ball_radius.LEAST_PRESSES:
            self.check_radius()

    def drop(self, arguments: dict[str, float]) -> None:
        number = int(arguments.get("number", self.last()["number"]))
        self.session.folder.drop("presses", number)
        self.live.drop(number)
        self.session.bulletin.post(press=None)
        self.tell()

    def correct(self, arguments: dict[str, float]) -> None:
        record = self.last()
        circle = Circle.checked(arguments, self.ball, self.session.camera.image_shape)
        record.update(circle.as_json())
        self.session.folder.save()
        press = self.session.folder.listed("presses")[-1]
        image = read_image(press.image)
        self.live.add(record["number"], image, press)
        self.session.bulletin.post(press={**record, "state": "corrected"})
        self.session.bulletin.show(press=drawn(image, circle))
        self.tell()

    def last(self) -> dict[str, Any]:
        if not self.session.folder.presses:
            raise InputError("there is no press yet to change")
        return self.session.folder.presses[-1]

    def drop_outliers(self) -> None:
        for number in self.live.outliers():
            self.session.folder.drop("presses", number)
            self.live.drop(number)
            self.refused += 1

    def check_radius(self) -> None:
        """Ask whether the ball is the one that was named, where the light tells its radius."""
        presses = self.session.folder.listed("presses")
        images = [read_image(press.image) for press in presses]
        self.radius_mm = ball_radius.likely_radius_mm(images, presses, self.reference, self.ball)
        named = self.session.options.ball_radius_mm
        if self.radius_mm is None or not ball_radius.is_another(self.radius_mm, named):
            return
        problem = (
            f"the ball was named as {named:g} mm in radius, but the light in its imprints fits a ball of about "
            f"{self.radius_mm:.1f} mm: measure the ball, and begin again with its radius"
        )
        if self.session.hand:
            raise BundleError(problem)
        self.session.questioned(problem)

    def tell(self) -> None:
        """Show how far it is, what is covered and what is missing."""
        session = self.session
        presses, wanted = session.folder.listed("presses"), self.wanted
        error = self.live.update()
        found = coverage(presses, self.ball, session.camera.image_shape)
        words = advice(found, len(presses), wanted, settled=self.live.settled())
        doubtful = self.live.outliers()
        session.bulletin.post(
            instruction=f"Press the ball of {session.options.ball_radius_mm:g} mm radius, from a "
            "light touch to 2 mm deep, at ever other places, up to the edges. Hold still until it is taken, then "
            "lift. A wrong circle can be corrected or dropped.",
            progress={"done": len(presses), "wanted": wanted, "unit": "presses"},
            advice=words + (f"; press {doubtful[0]} contradicts the others, drop it" if doubtful else ""),
            coverage={**found.as_json(), "held_out": [list(point) for point in self.live.history]},
        )
        session.bulletin.show(coverage=coverage_picture(found, session.camera.image_shape))
        if error is not None:
            session.bulletin.note("held_out", {"normal_error_deg": error, "presses": len(presses)})

    def figures(self) -> dict[str, Any]:
        session = self.session
        found = coverage(session.folder.listed("presses"), self.ball, session.camera.image_shape)
        return {
            "presses": len(session.folder.presses),
            "refused": self.refused,
            "coverage": found.as_json(),
            "held_out": [list(point) for point in self.live.history],
            "likely_radius_mm": self.radius_mm,
            "press_error_deg": {str(n): error for n, error in self.live.by_press.items()},
        }
