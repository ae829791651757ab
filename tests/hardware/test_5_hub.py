"""Step 5: at a hub, with the camera on it too."""

import time
from collections.abc import Callable

import numpy as np
import pytest

from gellight.opening import open_camera
from gellight.ring.light_ring import LightRing
from tests.helpers.streaming import stream

pytestmark = pytest.mark.hardware
PLUGGED, AT_MOST_S = 5, 2.0


def test_it_is_there_each_time_it_is_plugged_into_a_busy_hub(
    ask: Callable[[str], str], reopened: Callable[[], LightRing]
) -> None:
    """Silicon B0 and B1 needs the workaround of RP2040-E5 here; something else at the hub has to be talking."""
    for number in range(PLUGGED):
        ask(f"{number + 1} of {PLUGGED}: unplug the board from the hub. Press Enter and plug it in within a second.")
        begun_s = time.monotonic()
        with reopened() as ring:
            took_s = time.monotonic() - begun_s
            ring.clock()
        assert took_s < AT_MOST_S + 1.0


def test_a_minute_beside_the_camera_loses_nothing(ask: Callable[[str], str]) -> None:
    ask("Board and camera at one hub, the camera's lens open. Press Enter.")
    with open_camera("auto") as camera:
        ring = camera.ring
        assert ring is not None
        colours = np.full((ring.led_count, 3), 8, np.uint8)
        ring.light(colours)
        first = camera.read().sequence
        end_s = time.monotonic() + 60
        while time.monotonic() < end_s:
            stream(ring, 1.0)
            last = camera.read().sequence
        assert last > first
