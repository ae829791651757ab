"""Step 8: the camera's strobe at the trigger pin, through resistor and clamp."""

import os
import time

import numpy as np
import pytest

from gellight.ring.enumerations import SyncMode
from gellight.ring.light_ring import LightRing, Step

pytestmark = pytest.mark.hardware
SECONDS = 10.0


def test_every_strobe_is_counted_and_lights_a_step(ring: LightRing, dim: np.ndarray) -> None:
    rate_hz = float(os.environ.get("GELLIGHT_TRIGGER_HZ", "0"))
    if not rate_hz:
        pytest.skip("needs real hardware: a strobe, whose rate is given as GELLIGHT_TRIGGER_HZ")
    ring.set_sync(SyncMode.EXT)
    ring.load_sequence([dim, dim // 2], [Step(group=k, dwell_us=0) for k in range(2)])
    before = ring.counters()
    ring.start()
    end_s = time.monotonic() + SECONDS
    while time.monotonic() < end_s:
        ring.clock()
        time.sleep(0.05)
    ring.stop()
    after = ring.counters()
    assert abs(after.triggers - before.triggers - rate_hz * SECONDS) <= 0.01 * rate_hz * SECONDS + 2
    assert after.triggers_missed - before.triggers_missed <= 1
    assert after.lights - before.lights >= after.triggers - before.triggers - 2
