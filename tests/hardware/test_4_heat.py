"""Step 4: above its limit of temperature the board dims the LEDs and says so."""

import dataclasses
import time
from collections.abc import Callable

import numpy as np
import pytest

from gellight.ring.heat import chip_temperature_c
from gellight.ring.light_ring import LightRing
from gellight.ring.protocol import DimmedEvent

pytestmark = pytest.mark.hardware
LOWEST_C, WARM_C, REACTS_S = 40, 45, 15.0


def test_a_warm_chip_dims_its_leds(ring: LightRing, dim: np.ndarray, ask: Callable[[str], str]) -> None:
    ring.light(None)
    time.sleep(0.05)
    before = ring.configuration()
    ring.configure(dataclasses.replace(before, hottest_c=LOWEST_C))  # until the next start
    try:
        while (chip_temperature_c(ring.status()) or 0.0) < WARM_C and not ring.status().dimmed:
            ask(f"The chip has {chip_temperature_c(ring.status())} °C: warm it above {WARM_C} °C, then press Enter.")
        ring.set_leds(dim)
        end_s = time.monotonic() + REACTS_S
        while not ring.status().dimmed and time.monotonic() < end_s:
            time.sleep(0.2)
        status = ring.status()
        assert status.dimmed >= 1
        assert any(isinstance(event, DimmedEvent) for event in ring.events)
        assert ring.set_leds(dim).scale == 0xFFFF >> ring.status().dimmed
    finally:
        ring.light(None)
        time.sleep(0.05)
        ring.configure(before)
