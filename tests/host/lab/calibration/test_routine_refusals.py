"""What the calibration routine refuses: a hand in the way, a wrong press, a dead LED, a wrong ball, old pictures."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from gellight.base.errors import CameraError, GellightError
from gellight.frames.image_files import ImageCamera
from gellight.lab.calibration.routine import Routine
from gellight.lab.report.pictures import write_png
from gellight.lab.simulator.simulated_camera import SimulatedCamera
from gellight.lab.simulator.virtual_hand import VirtualHand
from gellight.opening import open_camera
from tests.helpers.calibration_routine import LIT, URL, camera, finished, options


class Clumsy(VirtualHand):
    """A hand that may forget to lift."""

    at_rest = False

    def lift(self) -> None:
        """Lift, or forget to."""
        if not self.at_rest:
            super().lift()


class Interrupted(VirtualHand):
    """A hand that presses the cylinder, and then something ends the routine."""

    end: Callable[[], object]

    def cylinder(self, number: int) -> None:
        """Press, and end it."""
        super().cylinder(number)
        self.end()


def jam() -> None:
    raise RuntimeError("the hand is stuck")


def swap_colours(hand: Clumsy, sensor: SimulatedCamera) -> None:
    """Let what is red look green."""
    sensor._response = sensor._scene.response = type(sensor._response)(
        exposure=sensor._response.exposure, crosstalk=((0, 1, 0), (1, 0, 0), (0, 0, 1))
    )


@pytest.mark.parametrize(
    ("disturb", "url", "told"),
    [
        (lambda hand, sensor: sensor.stage.press("CYLINDER", 0.5, 2.0, 1.0), URL, "something lies on it"),
        (lambda hand, sensor: setattr(hand, "at_rest", True), URL, "lift the tool"),
        (lambda hand, sensor: sensor._scene.led_gain.put(5, 0.0), LIT, "LED 5 stays dark"),
        (swap_colours, LIT, "shines in another colour: check the colour order"),
    ],
    ids=["a hand on the gel", "a tool that is never lifted", "a dead LED", "LEDs in another order"],
)
def test_what_disturbs_a_routine_ends_it_with_its_reason(
    disturb: Callable[[Clumsy, SimulatedCamera], None], url: str, told: str, tmp_path: Path
) -> None:
    with camera(url) as sensor:
        hand = Clumsy(sensor.stage)
        routine = Routine(sensor, options(tmp_path), tmp_path / "state", hand=hand)
        disturb(hand, sensor)
        snapshot = finished(routine)
    assert snapshot["step"] == "failed"
    assert isinstance(routine.error, GellightError)
    assert not (tmp_path / "bundle").exists()
    assert told in snapshot["problem"]


@pytest.mark.parametrize(
    ("way", "step"), [("abort", "aborted"), ("stop", "aborted"), ("camera", "failed"), ("hand", "failed")]
)
def test_however_a_routine_ends_nothing_stays_pressed_into_the_gel(way: str, step: str, tmp_path: Path) -> None:
    small = {"image_width_px": 160, "image_height_px": 120, "pixel_size_mm": 0.2352}
    with open_camera(URL, geometry=small) as sensor:
        hand = Interrupted(sensor.stage)
        routine = Routine(sensor, options(tmp_path), tmp_path / "state", hand=hand)
        ways = {"abort": lambda: routine.act("abort"), "stop": routine.stop, "camera": sensor.close, "hand": jam}
        hand.end = ways[way]
        assert finished(routine)["step"] == step
        assert sensor.stage.status()["object"] == ""


def test_recorded_pictures_cannot_be_calibrated_live(tmp_path: Path) -> None:
    write_png(tmp_path / "a.png", np.full((240, 320, 3), 120, np.uint8))
    routine = Routine(ImageCamera([tmp_path / "a.png"]), options(tmp_path), tmp_path / "state")
    routine.act("start")
    routine.join(200)
    assert isinstance(routine.error, CameraError)
    assert "a calibration needs a camera that goes on delivering" in str(routine.error)
