"""A setting that is refused is taken back; where that fails too, the error says both."""

import numpy as np
import pytest

from gellight.base.errors import BoardError, CameraError
from gellight.daemon.switched_camera import SensorState
from tests.helpers.scripted_camera import LitCamera

LIT = SensorState(controls={"gain": 2.0}, colours=np.full((12, 3), 9, np.uint8))


def test_a_refused_light_is_taken_back() -> None:
    camera = LitCamera()
    before = camera.setting()
    camera.failures.reset("light 1")
    with pytest.raises(BoardError, match=r"^light failed$"):
        LIT.apply(camera)
    assert camera.setting() == before, "dark, as before"


def test_where_it_cannot_be_taken_back_the_error_says_both() -> None:
    camera = LitCamera()
    camera.failures.reset("light 1", "light 2")
    with pytest.raises(CameraError, match=r"light failed; nor can camera and LEDs be set as before \(light failed\)"):
        LIT.apply(camera)
