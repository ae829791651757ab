"""The strobe of the simulated camera, wired to the trigger pin of its emulated board."""

import time

import numpy as np
import pytest

from gellight.base.errors import InputError
from gellight.frames.camera import Camera
from gellight.frames.camera_wrapper import CameraWrapper
from gellight.frames.frames import CameraFrame, LightState
from gellight.opening import open_camera
from gellight.sensor.lighting.sequenced import LightMode, SequencedCamera
from tests.helpers.virtual_sensor import RING

GROUPS = [np.roll(RING, 4 * turn, axis=0) for turn in range(3)]


class Watched(CameraWrapper):
    """Keeps what the board had latched when the frame began."""

    def __init__(self, camera: Camera) -> None:
        super().__init__(camera)
        self.latched = np.zeros((12, 3), np.uint8)

    def read(self) -> CameraFrame:
        frame = self._camera.read()
        assert frame.light is not None
        self.latched = frame.light
        return frame


def test_every_sure_frame_is_of_the_light_it_says() -> None:
    camera = Watched(open_camera("sim://?strobe=1&fps=10&programme=0"))
    seen: list[int] = []
    with SequencedCamera(camera, GROUPS, mode=LightMode.EXT) as sequenced:
        until_s = time.monotonic() + 180  # a busy computer knows no light surely
        while len(seen) < 6 and time.monotonic() < until_s:
            label = sequenced.read().label
            assert label is not None
            if label.state is LightState.CLEAN:
                assert label.group is not None
                assert np.array_equal(camera.latched, GROUPS[label.group])
                seen.append(label.group)
    assert set(seen) == {0, 1, 2}
    assert sequenced.counters.mixed == 0


def test_a_strobe_without_a_board_is_refused() -> None:
    with pytest.raises(InputError, match="a strobe needs the board"):
        open_camera("sim://?strobe=1&board=0")
