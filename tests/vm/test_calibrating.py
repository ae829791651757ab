"""The guided routine on the real drivers: camera set, LEDs checked, pixel measured, circles found."""

import time

import numpy as np
import pytest

from tests.virtual_usb.device import VirtualSensor
from tests.vm.machine.bench import Bench
from tests.vm.machine.qemu import Call, Guest

PIXEL_MM = 0.0588 * 640 / 320
MIDDLE_PX = np.array([159.5, 119.5])
CYLINDER = [(0.0, 0.0), (3.0, -2.0)]
BALL = [(5.0, 3.0)]
"""places, mm from the middle of the view; one of the ball: to fit its circle takes minutes on the emulated processor"""
DEPTH_MM = 1.2
PRESSES = len(BALL)


def serve(call: Call, sensor: VirtualSensor) -> list[str]:
    """Press and lift whenever the routine asks for it; return every problem that it told."""
    stage = sensor.camera.stage
    assert stage is not None
    problems, taken = [], {"pixel_size": 0, "presses": 0}
    while (due := call.next_event("due")) is not None:
        problems += [due["problem"]] if due["problem"] else []
        if due["action"] == "lift":
            stage.release()
        elif due["action"] == "press":
            places = CYLINDER if due["step"] == "pixel_size" else BALL
            x, y = places[taken[due["step"]] % len(places)]
            taken[due["step"]] += 1
            stage.press("CYLINDER" if places is CYLINDER else "BALL", 0.3 if places is CYLINDER else DEPTH_MM, x, y)
    return problems


@pytest.mark.timeout(900)
def test_the_routine_measures_a_sensor_behind_usb(guest: Guest, bench: Bench) -> None:
    bench.plug("fine", 0)
    call = guest.start("calibrating:calibrate", url="auto", folder="/tmp/calibration", presses=PRESSES, limit_s=600)
    problems = serve(call, bench.sensors["fine"])
    found = call.result()
    print(problems, found["figures"])
    assert (found["step"], found["mode"]) == ("aborted", "MJPG 320x240 at 30 fps"), found["problem"]
    assert found["figures"]["pixel_size"]["pixel_size_mm"] == pytest.approx(PIXEL_MM, rel=0.01)
    assert found["figures"]["reference"]["noise_grey"] > found["figures"]["reference"]["pixel_noise_grey"]
    assert [led["led"] for led in found["figures"]["prepare"]["lights"]["leds"]] == list(range(12))
    assert len(found["circles"]) == PRESSES
    for circle, place in zip(found["circles"], BALL, strict=True):
        centre = np.array([circle["center_x_px"], circle["center_y_px"]])
        assert np.abs(MIDDLE_PX + np.array(place) / PIXEL_MM - centre).max() < 0.5
    board = bench.sensors["fine"].board
    assert not board.light_at(board.virtual_us(time.monotonic())).any(), "the LEDs are dark when the routine has ended"
