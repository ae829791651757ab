"""A real board: the assertions of the simulated one, as far as the host alone can see. Opt in by --hardware URL."""

import dataclasses
import time
from collections.abc import Iterator

import numpy as np
import pytest

from gellight.ring import protocol as p
from gellight.ring.board_link import RefusedError
from gellight.ring.enumerations import Dark, Policy, SyncMode
from gellight.ring.light_ring import LightRing, Step, chip_temperature_c, connect
from gellight.ring.transport import open_transport

pytestmark = pytest.mark.hardware
DIM = np.full((12, 3), 8, np.uint8)
OFF = np.zeros((12, 3), np.uint8)


@pytest.fixture
def ring(request: pytest.FixtureRequest) -> Iterator[LightRing]:
    with connect(request.config.getoption("--hardware")) as opened:
        yield opened


def test_the_board_passes_its_self_test(ring: LightRing) -> None:
    ring.blank()
    time.sleep(0.05)
    result = ring.self_test()
    assert result.failed == 0
    assert result.stack_free > 1024


def test_a_light_is_latched_when_its_event_says_so(ring: LightRing) -> None:
    event = ring.wait_for_light(ring.set_leds(DIM).light_id)
    assert event.latched_us - event.first_bit_us >= 30 * ring.hello.led_count + 50
    assert ring.status().dark == Dark.NOT_DARK


def test_steps_are_evenly_spaced(ring: LightRing) -> None:
    ring.load_sequence([DIM, OFF], [Step(group=0, dwell_us=20_000), Step(group=1, dwell_us=20_000)])
    ring.set_sync(SyncMode.FREE)
    ring.events.clear()
    ring.start()
    end = time.monotonic() + 2
    while time.monotonic() < end:
        ring.clock()
        time.sleep(0.05)
    ring.blank()
    lights = [e for e in ring.events if isinstance(e, p.LightEvent) and e.step != p.NO_STEP]
    gaps = np.diff([e.first_bit_us for e in lights])
    assert len(gaps) > 60
    assert np.abs(gaps - 20_000).max() <= 1
    assert ring.counters().late_steps == 0


def test_full_white_is_refused(ring: LightRing) -> None:
    ring.set_limits(450, Policy.REJECT)
    with pytest.raises(RefusedError, match="OVER_CURRENT"):
        ring.set_leds(np.full((12, 3), 255, np.uint8))


def test_a_silent_host_leaves_the_leds_dark(request: pytest.FixtureRequest, ring: LightRing) -> None:
    ring.close()
    transport = open_transport(request.config.getoption("--hardware"))
    with LightRing(transport, keep_alive_s=None) as silent:
        silent.set_leds(DIM)
        time.sleep(1.3)
        assert silent.status().dark == Dark.HOST_SILENT


def test_damaged_packets_are_counted(ring: LightRing) -> None:
    before = ring.counters()
    ring.transport.write(b"\x05rub\0bish\0")
    after = ring.counters()
    assert after.bad_framing + after.bad_crc > before.bad_framing + before.bad_crc


def test_the_configuration_is_kept_over_a_restart(request: pytest.FixtureRequest, ring: LightRing) -> None:
    ring.blank()
    time.sleep(0.05)
    before = ring.configuration()
    named = dataclasses.replace(before, name=b"hardware test".ljust(16, b"\0"))
    ring.configure(named, save=True)
    ring.reset()
    ring.close()
    time.sleep(2)
    with connect(request.config.getoption("--hardware")) as again:
        kept = again.configuration()
        again.configure(before, save=True)  # first: the board is somebody's, whatever the test finds
    assert kept == named


def test_the_chip_is_neither_frozen_nor_hot(ring: LightRing) -> None:
    celsius = chip_temperature_c(ring.status())
    assert celsius is not None
    assert -10 < celsius < 85
