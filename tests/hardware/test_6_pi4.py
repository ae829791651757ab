"""Step 6: a Raspberry Pi 4, whose USB controller makes RP2040-E15 visible."""

import time
from collections.abc import Callable

import numpy as np
import pytest

from gellight.base.errors import BoardError
from gellight.ring.enumerations import SyncMode
from gellight.ring.light_ring import LightRing, Step
from tests.helpers.streaming import stream

pytestmark = pytest.mark.hardware
MINUTES, AT_MOST_S = 10, 12.0


def run_for(ring: LightRing, seconds: float) -> None:
    dim = np.full((ring.led_count, 3), 8, np.uint8)
    ring.load_sequence([dim, np.zeros_like(dim)], [Step(group=k, dwell_us=5_000) for k in range(2)])
    ring.set_sync(SyncMode.FREE)
    ring.start()
    stream(ring, seconds)
    ring.blank()


@pytest.mark.timeout(60 * MINUTES + 120)
def test_ten_minutes_lose_nothing(ring: LightRing, reopened: Callable[[], LightRing]) -> None:
    try:
        run_for(ring, 60.0 * MINUTES)
    except BoardError as error:
        lost_s = time.monotonic()
        ring.transport.close()
        with reopened():
            took_s = time.monotonic() - lost_s
        how = "by itself" if took_s < AT_MOST_S else f"after {took_s:.1f} s"
        pytest.fail(f"the board was lost ({error}) and came back {how}: RP2040-E15 is met, its recovery works")
