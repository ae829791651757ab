"""Setting and lighting a sensor: from the thread that reads it, and beside a daemon that reads it all the time."""

import itertools
import time
from collections.abc import Callable
from pathlib import Path
from unittest.mock import Mock

import numpy as np
import pytest

from gellight.base.errors import CameraError
from gellight.daemon.switched_camera import SensorState
from gellight.frame_path.pipeline import Reconstructor
from gellight.frames.camera import ReconnectingError
from gellight.frames.frames import CameraFrame
from gellight.opening import open_camera
from gellight.sensor.set_and_light import set_and_light
from tests.helpers.linear_sensor import linear_bundle
from tests.helpers.scripted_camera import LitCamera, ScriptedCamera, ScriptedControls
from tests.helpers.scripted_ring import ScriptedRing
from tests.helpers.sessions import session_of
from tests.helpers.waiting import eventually

GEOMETRY = {"image_width_px": 160, "image_height_px": 120, "pixel_size_mm": 4 * 0.0588}
URL = "sim://?programme=0&noise=0&fps=200"
RED, BLUE = np.zeros((2, 12, 3), np.uint8)
RED[:4, 0] = 255
BLUE[8:, 2] = 255


def test_frames_are_wholly_under_what_was_asked_also_while_a_daemon_reads_the_camera(tmp_path: Path) -> None:
    """The colours of 20 lights, changed as fast as it goes: no frame of the light before, and none that saw both."""
    camera = open_camera(URL, geometry=GEOMETRY)
    pure = {light: set_and_light(camera, {}, colours)[0].image for light, colours in (("red", RED), ("blue", BLUE))}
    with session_of(camera, Reconstructor(linear_bundle(tmp_path / "bundle", (120, 160)))) as daemon:
        for light, colours in itertools.islice(itertools.cycle((("red", RED), ("blue", BLUE))), 20):
            for frame in set_and_light(daemon.camera, {}, colours, frames=2):
                assert (frame.light == colours).all()
                # Pulsed light: where an exposure is not a whole number of pulses rows may differ by part of one.
                assert np.abs(frame.image.astype(int) - pure[light]).mean() < 1.0


def steps(ring: ScriptedRing | None, at: dict[int, Callable[[], object]] | None = None) -> ScriptedCamera:
    """A camera whose frames begin 1 s after they are asked for; `at` does something in the n-th `read`."""

    def picture(number: int) -> np.ndarray:
        (at or {}).get(number, lambda: None)()
        return np.zeros((4, 4, 3), np.uint8)

    return ScriptedCamera(picture, shape=(4, 4), ahead_s=1, ring=ring, controls=ScriptedControls())


def test_frames_are_let_pass_until_a_control_acts_and_a_ring_that_is_replaced_meanwhile_is_lit_too() -> None:
    camera = steps(ScriptedRing())
    (frame,) = set_and_light(camera, {"gain": 2.0}, RED)
    assert frame.sequence == 4 + 1
    (frame,) = set_and_light(camera, {"gain": 2.0}, RED)
    assert frame.sequence == 5 + 1
    second = ScriptedRing()
    camera = steps(ScriptedRing(), {1: lambda: setattr(camera, "ring", second)})
    (frame,) = set_and_light(camera, {}, RED)
    assert frame.sequence == 2
    assert [light.tolist() for light in second.shown] == [RED.tolist()]
    assert set_and_light(steps(None), {}, RED)[0].sequence == 1


def test_a_sensor_that_is_away_says_so_and_no_frame_of_another_light_is_returned_when_it_is_back() -> None:
    ring = ScriptedRing()
    camera = steps(
        None, {1: Mock(side_effect=ReconnectingError("it was unplugged")), 2: lambda: setattr(camera, "ring", ring)}
    )
    with pytest.raises(ReconnectingError):
        set_and_light(camera, {}, RED)
    (frame,) = set_and_light(camera, {}, RED)
    assert frame.sequence == 3
    assert [light.tolist() for light in ring.shown] == [RED.tolist()]


@pytest.mark.parametrize(("late", "given"), [(59, True), (60, False)])
def test_frames_that_began_before_their_light_are_waited_out_sixty_times(late: int, given: bool) -> None:
    camera = steps(None)
    camera.pictures = lambda number: CameraFrame(
        image=np.zeros((4, 4, 3), np.uint8), time_s=time.monotonic() + (-1 if number <= late else 1), sequence=number
    )
    if given:
        assert set_and_light(camera, {}, RED)[0].sequence == 60
        return
    with pytest.raises(CameraError):
        set_and_light(camera, {}, RED)


def test_a_light_that_the_board_took_away_is_in_no_frame_of_the_simulated_sensor(
    caplog: pytest.LogCaptureFixture,
) -> None:
    """As after the program was held up for more than a second: the board makes its LEDs dark, the ring lights them."""
    with open_camera(URL, geometry=GEOMETRY) as camera:
        (lit,) = set_and_light(camera, {}, RED)
        with camera.ring._lock:  # nothing is sent to the board
            eventually(lambda: not camera.ring.transport.timeline[-1].colours.any())
        frames = [camera.read() for _ in range(20)]
    assert "host silent); they are lit again" in caplog.text
    assert all(frame.image.mean() == pytest.approx(lit.image.mean(), rel=0.05) for frame in frames)


LIT = SensorState(controls={"gain": 2.0}, colours=np.full((12, 3), 9, np.uint8))


def test_where_it_cannot_be_taken_back_the_error_says_both() -> None:
    camera = LitCamera()
    camera.failures.reset("light 1", "light 2")
    with pytest.raises(CameraError, match=r"light failed; nor can camera and LEDs be set as before \(light failed\)"):
        LIT.apply(camera)
