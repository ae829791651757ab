"""Step 2: with LEDs. What is asked for is lit, when the board says so."""

import dataclasses
import time
from collections.abc import Callable

import numpy as np
import pytest

from gellight.ring import protocol as p
from gellight.ring.board_link import RefusedError
from gellight.ring.enumerations import Dark, SyncMode
from gellight.ring.light_ring import LightRing, Step

pytestmark = pytest.mark.hardware
COLOURS = {"red": 0, "green": 1, "blue": 2}


def test_a_light_is_latched_when_its_event_says_so(ring: LightRing, dim: np.ndarray) -> None:
    event = ring.wait_for_light(ring.set_leds(dim).light_id)
    assert event.latched_us - event.first_bit_us >= 30 * ring.led_count + 50
    assert ring.status().dark == Dark.NOT_DARK


def test_steps_are_evenly_spaced(ring: LightRing, dim: np.ndarray) -> None:
    ring.load_sequence([dim, np.zeros_like(dim)], [Step(group=k, dwell_us=20_000) for k in range(2)])
    ring.set_sync(SyncMode.FREE)
    ring.events.clear()
    ring.start()
    end_s = time.monotonic() + 2
    while time.monotonic() < end_s:
        ring.clock()
        time.sleep(0.05)
    ring.blank()
    lights = [e for e in ring.events if isinstance(e, p.LightEvent) and e.step != p.NO_STEP]
    gaps = np.diff([e.first_bit_us for e in lights])
    assert len(gaps) > 60
    assert np.abs(gaps - 20_000).max() <= 1
    assert ring.counters().late_steps == 0


def test_more_current_than_the_limit_is_refused(ring: LightRing, dim: np.ndarray) -> None:
    white = np.full_like(dim, 255)
    if ring.led_count >= 8:
        with pytest.raises(RefusedError, match="OVER_CURRENT"):
            ring.set_leds(white)


def test_damaged_packets_are_counted(ring: LightRing) -> None:
    before = ring.counters()
    ring.transport.write(b"\x05rub\0bish\0")
    after = ring.counters()
    assert after.bad_framing + after.bad_crc > before.bad_framing + before.bad_crc


def test_the_configuration_is_kept_over_a_restart(ring: LightRing, reopened: Callable[[], LightRing]) -> None:
    ring.blank()
    time.sleep(0.05)
    before = ring.configuration()
    named = dataclasses.replace(before, name=b"hardware test".ljust(16, b"\0"))
    ring.configure(named, save=True)
    ring.reset()
    ring.close()
    time.sleep(2)
    with reopened() as again:
        kept = again.configuration()
        again.configure(before, save=True)  # first: the board is somebody's, whatever the test finds
    assert kept == named


def test_every_led_is_where_and_what_it_should_be(ring: LightRing, ask: Callable[[str], str]) -> None:
    """By eye: LED 0 at azimuth 0, the others anticlockwise, in the colour that is named."""
    for led in range(ring.led_count):
        for name, channel in COLOURS.items():
            light = np.zeros((ring.led_count, 3), np.uint8)
            light[led, channel] = 60
            ring.light(light)
            assert ask(f"Is LED {led} {name}, and no other lit? [y/n]") == "y", (led, name)
