"""A setting that is refused is taken back; where that fails too, the error says both."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from gellight.base.errors import CameraError
from gellight.daemon.setting import Setting
from gellight.ring.board_link import RefusedError
from gellight.ring.enumerations import Status

LIT = np.full((12, 3), 9, np.uint8)


class RefusingCamera:
    """Refuses the first `times` settings as a board does."""

    def __init__(self, times: int) -> None:
        self.times, self.adopted = times, []
        self.controls, self.ring = None, SimpleNamespace(still=None)

    def adopt(self, controls: dict[str, float], colours: np.ndarray | None) -> None:
        if self.times:
            self.times -= 1
            raise RefusedError("SET_LEDS", Status.OVER_CURRENT, 700)
        self.adopted.append(colours)


def test_a_refused_light_is_taken_back() -> None:
    camera: Any = RefusingCamera(times=1)
    with pytest.raises(RefusedError, match=r"the board refused SET_LEDS: OVER_CURRENT \(700\)"):
        Setting(controls={}, colours=LIT).apply(camera)
    assert camera.adopted == [None], "dark, as before"


def test_where_it_cannot_be_taken_back_the_error_says_both() -> None:
    camera: Any = RefusingCamera(times=2)
    with pytest.raises(CameraError, match=r"OVER_CURRENT .*; nor can camera and LEDs be set as before \(the board ref"):
        Setting(controls={}, colours=LIT).apply(camera)
