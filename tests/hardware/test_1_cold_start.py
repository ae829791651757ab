"""Step 1: the board alone, just plugged in. It starts, says who it is, and finds itself in order."""

import time
from collections.abc import Callable

import pytest

from gellight.ring.enumerations import ResetReason
from gellight.ring.heat import chip_temperature_c
from gellight.ring.light_ring import LightRing

pytestmark = pytest.mark.hardware
STARTS = 5


def test_it_was_started_by_nothing_unusual(ring: LightRing) -> None:
    assert ring.hello.reset_reason in (ResetReason.POWER, ResetReason.COMMAND)
    assert ring.counters().dark_faults == 0


def test_it_passes_its_self_test(ring: LightRing) -> None:
    ring.blank()
    time.sleep(0.05)
    result = ring.self_test()
    assert result.failed == 0
    assert result.image_crc == ring.hello.image_crc
    assert result.stack_free > 1024


def test_the_chip_is_neither_frozen_nor_hot(ring: LightRing) -> None:
    celsius = chip_temperature_c(ring.status())
    assert celsius is not None
    assert -10 < celsius < 85


def test_it_starts_every_time(ring: LightRing, reopened: Callable[[], LightRing]) -> None:
    ring.reset()
    ring.close()
    for number in range(STARTS):
        time.sleep(2)
        with reopened() as again:
            assert again.hello.reset_reason == ResetReason.COMMAND
            assert again.status().time_us < 20e6
            if number < STARTS - 1:
                again.reset()
