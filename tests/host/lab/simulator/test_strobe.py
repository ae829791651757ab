"""The strobe of the simulated camera, wired to the trigger pin of its emulated board."""

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
CHANGES, MOST_FRAMES = 12, 300


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


def test_each_strobe_moves_the_light_on_and_every_sure_frame_is_of_the_light_it_says() -> None:
    """How many frames are sure depends on the computer: a command takes the emulator 2 to 20 ms, busy or slow."""
    camera = Watched(open_camera("sim://?strobe=1&fps=10&programme=0"))
    shown: list[int] = []
    with SequencedCamera(camera, GROUPS, mode=LightMode.EXT) as sequenced:
        for _ in range(MOST_FRAMES):
            label = sequenced.read().label
            assert label is not None
            on = [group for group, colours in enumerate(GROUPS) if np.array_equal(camera.latched, colours)]
            shown += [group for group in on if group not in shown[-1:]]
            if label.state is LightState.CLEAN:
                assert [label.group] == on
            if len(shown) >= CHANGES:
                break
    assert shown == [(shown[0] + number) % 3 for number in range(CHANGES)]
    assert sequenced.counters.mixed == 0


def test_a_strobe_without_a_board_is_refused() -> None:
    with pytest.raises(InputError, match="a strobe needs the board"):
        open_camera("sim://?strobe=1&board=0")
