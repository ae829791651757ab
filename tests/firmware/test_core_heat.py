"""The portable core on a virtual clock: the LEDs get dimmer while the chip or the ring's NTC is hot."""

from collections.abc import Callable
from dataclasses import replace
from math import exp, log

import pytest

from gellight.ring import protocol as p
from gellight.ring.enumerations import SyncMode
from gellight.ring.protocol import COOLER_C, DIMMING_US, HOTTEST_C, NO_TEMPERATURE, RING_HOTTEST_C
from tests.firmware.helpers.virtual_board import VirtualBoard

SETTLED_US = 15_000_000
"""the smoothed temperature is within a hundredth of a degree, and the next dimming has come"""
PATTERN = bytes([200, 0, 1] + [0] * 33)
HALVED = [bytes([red, 0, 1] + [0] * 33) for red in (200, 100, 50, 25)]


def wait(core: VirtualBoard, duration_us: int) -> list[p.DimmedEvent]:
    """Let time pass, keep the light on, and return what the board said of its dimming."""
    found = []
    while duration_us > 0:
        core.ok("CLOCK", p.ClockRequest(0))
        core.advance(min(duration_us, 500_000))
        duration_us -= 500_000
        packets = [*core.packets, *core.collect()]
        core.packets.clear()
        found += [p.DimmedEvent.unpack(packet.payload) for packet in packets if packet.type == p.EVENTS["DIMMED"][0]]
    return found


MURATA = {-20: 68236.7, -10: 42506.2, 0: 27218.6, 10: 17925.5, 20: 12080.5, 25: 10000.0, 30: 8314.5, 40: 5833.6,
          50: 4160.9, 60: 3014.3, 70: 2227.5, 80: 1668.5, 100: 973.8}  # fmt: skip
"""ohm of an NCP18XH103 by degrees, from the maker's table"""
OPEN, SHORT = 4095, 0


def reading(ohm: float) -> int:
    """What the converter reads of the carrier's divider, 10 kohm to full scale."""
    return int(4096 * ohm / (ohm + 10e3))


def warm_ring(core: VirtualBoard, celsius: float) -> None:
    core.warm_ring(reading(10e3 * exp(3380 * (1 / (celsius + 273.15) - 1 / 298.15))))


Warm = Callable[[VirtualBoard, float], None]
heated = pytest.mark.parametrize(
    ("warm", "hottest_c", "field"),
    [(VirtualBoard.warm, HOTTEST_C, "temperature"), (warm_ring, RING_HOTTEST_C, "ring_temperature")],
    ids=["chip", "ring"],
)


@heated
def test_a_still_light_is_halved_step_by_step_and_comes_back(
    core: VirtualBoard, warm: Warm, hottest_c: int, field: str
) -> None:
    core.ok("SET_LEDS", p.SetLeds(PATTERN))
    warm(core, hottest_c - 2)
    assert wait(core, SETTLED_US) == []
    warm(core, hottest_c + 2)
    events = wait(core, 4 * DIMMING_US)
    assert [event.dimmed for event in events] == [1, 2, 3]
    assert [getattr(event, field) >= 10 * hottest_c for event in events] == [True] * 3
    assert getattr(events[2], field) / 10 == pytest.approx(hottest_c + 2, abs=0.3)
    assert events[2].time_us - events[1].time_us >= DIMMING_US
    warm(core, hottest_c - COOLER_C + 2)
    assert wait(core, 2 * DIMMING_US) == []
    warm(core, hottest_c - COOLER_C - 2)
    assert [event.dimmed for event in wait(core, 4 * DIMMING_US)] == [2, 1, 0]
    assert [colours for _, _, colours in core.lights()[1:]] == [HALVED[k] for k in (0, 1, 2, 3, 2, 1, 0)]
    assert core.status().dimmed == 0


@heated
def test_a_reading_that_strays_dims_nothing(core: VirtualBoard, warm: Warm, hottest_c: int, field: str) -> None:
    """One wrong reading of the converter among right ones."""
    warm(core, hottest_c - 3)
    wait(core, SETTLED_US)
    for _ in range(5):
        warm(core, hottest_c + 20)
        core.advance(100_000)
        warm(core, hottest_c - 3)
        assert wait(core, SETTLED_US) == []


def test_between_the_two_limits_nothing_changes(core: VirtualBoard) -> None:
    core.warm(HOTTEST_C - 0.2)
    assert wait(core, SETTLED_US) == []
    core.warm(HOTTEST_C + 0.2)
    assert [event.dimmed for event in wait(core, 10_000_000)] == [1]
    core.warm(HOTTEST_C - COOLER_C + 0.2)
    assert wait(core, SETTLED_US) == []
    core.warm(HOTTEST_C - COOLER_C - 0.2)
    assert [event.dimmed for event in wait(core, SETTLED_US)] == [0]


def test_the_limit_is_that_of_the_configuration(core: VirtualBoard) -> None:
    core.warm(50)
    assert wait(core, SETTLED_US) == []
    core.ok("SET_CONFIG", replace(core.ok("GET_CONFIG"), hottest_c=45))
    assert wait(core, SETTLED_US)[0].dimmed == 1


def hot(core: VirtualBoard) -> None:
    core.warm(HOTTEST_C + 3)
    wait(core, 8_000_000)
    assert core.status().dimmed == 1


def test_a_hot_board_says_what_it_makes_of_a_light(core: VirtualBoard) -> None:
    hot(core)
    reply = core.ok("SET_LEDS", p.SetLeds(PATTERN))
    assert reply.scale == p.FULL_SCALE // 2
    assert reply.current_ma == -(-(12_000 + -(-101 * 20_000 // 255)) // 1000)
    core.advance(2_000)
    assert core.light == HALVED[1]
    assert core.status().current_ma == reply.current_ma
    core.ok("BLANK")
    core.ok("SET_GROUP", p.SetGroup(0, PATTERN))
    assert core.ok("SET_GROUP", p.SetGroup(0, PATTERN)).scale == p.FULL_SCALE // 2


@pytest.mark.parametrize("mode", list(SyncMode))
def test_every_sequence_is_dimmed(core: VirtualBoard, mode: SyncMode) -> None:
    """In EXT also the light that stays until the trigger wants the next one."""
    core.sync(mode)
    core.load_sequence(
        [PATTERN, PATTERN], [p.SetStep(k, k, 1, 20_000 if mode is SyncMode.FREE else 0, 0) for k in (0, 1)]
    )
    core.ok("START")
    core.advance(3_000)
    if mode is SyncMode.EXT:
        core.edge()
    core.advance(3_000)
    assert core.light == PATTERN
    late = core.ok("COUNTERS").late_steps
    core.warm(HOTTEST_C + 3)
    wait(core, 8_000_000)
    assert core.status().state == 1
    assert core.light == HALVED[1]
    if mode is SyncMode.EXT:
        core.edge()
        core.advance(3_000)
        assert core.status().step == 1
        assert core.light == HALVED[1]
    assert core.ok("COUNTERS").late_steps == late


def test_a_step_that_is_dimmed_is_the_same_step_without_another_pulse(core: VirtualBoard) -> None:
    core.play([PATTERN], [p.SetStep(0, 0, 1, 0, 0)], mode=SyncMode.EXT)
    core.advance(3_000)
    core.edge()
    core.advance(3_000)
    core.warm(HOTTEST_C + 3)
    for _ in range(16):
        core.advance(500_000)
        core.ok("CLOCK", p.ClockRequest(0))
    events = [p.LightEvent.unpack(event.payload) for event in core.packets if event.type == p.EVENTS["LIGHT"][0]]
    assert [(event.step, event.group) for event in events] == [(0, 0)] * 2
    assert [colours for _, _, colours in core.lights()[1:]] == [HALVED[0], HALVED[1]]
    assert core.pulses()[1:] == [True, False]


def test_dark_stays_dark(core: VirtualBoard) -> None:
    lights = len(core.lights())
    hot(core)
    core.warm(20)
    wait(core, 30_000_000)
    assert len(core.lights()) == lights


def test_a_light_that_the_board_took_away_does_not_come_back_with_the_cool(core: VirtualBoard) -> None:
    core.ok("SET_LEDS", p.SetLeds(PATTERN))
    hot(core)
    core.advance(2_000_000)  # the host is silent
    assert not any(core.light)
    lights = len(core.lights())
    core.warm(20)
    wait(core, 30_000_000)
    assert len(core.lights()) == lights


def test_cold_is_no_heat(core: VirtualBoard) -> None:
    core.warm(-20)
    assert wait(core, SETTLED_US) == []
    assert core.status().temperature == -200


def ring_temperature(core: VirtualBoard) -> int:
    wait(core, 4_000_000)
    return core.status().ring_temperature


@pytest.mark.parametrize("celsius", MURATA)
def test_it_is_as_warm_as_the_makers_table_says(core: VirtualBoard, celsius: int) -> None:
    core.warm_ring(reading(MURATA[celsius]))
    assert ring_temperature(core) / 10 == pytest.approx(celsius, abs=1.0 if 0 <= celsius <= 80 else 2.5)


@pytest.mark.parametrize("counts", [101, 150, 500, 1011, 2047, 2048, 2049, 3000, 3700, 3989])
def test_the_integers_follow_the_beta_equation(core: VirtualBoard, counts: int) -> None:
    core.warm_ring(counts)
    kelvin = 1 / (1 / 298.15 + log(counts / (4096 - counts)) / 3380)
    assert ring_temperature(core) / 10 == pytest.approx(kelvin - 273.15, abs=0.15)


@pytest.mark.parametrize("counts", [SHORT, 100, 3990, OPEN, 0xFFFF])
def test_a_broken_or_short_one_is_unknown_and_dims_nothing(core: VirtualBoard, counts: int) -> None:
    core.warm_ring(counts)
    assert wait(core, SETTLED_US) == []
    assert (core.status().ring_temperature, core.status().dimmed) == (NO_TEMPERATURE, 0)


def test_a_board_without_one_says_unknown_and_lights(core: VirtualBoard) -> None:
    core.ok("SET_LEDS", p.SetLeds(PATTERN))
    assert wait(core, SETTLED_US) == []
    assert core.status().ring_temperature == NO_TEMPERATURE
    assert core.light == PATTERN


@pytest.mark.parametrize("lost", [SHORT, OPEN])
def test_one_that_is_lost_while_hot_keeps_the_leds_dimmed(core: VirtualBoard, lost: int) -> None:
    core.ok("SET_LEDS", p.SetLeds(PATTERN))
    warm_ring(core, RING_HOTTEST_C + 2)
    assert [event.dimmed for event in wait(core, 9_000_000)] == [1]
    core.warm_ring(lost)
    assert wait(core, 4 * DIMMING_US) == []
    assert (core.status().ring_temperature, core.status().dimmed) == (NO_TEMPERATURE, 1)
    warm_ring(core, 25)
    assert [event.dimmed for event in wait(core, 2 * DIMMING_US)] == [0]


def test_no_configuration_raises_the_limit_of_the_ring(core: VirtualBoard) -> None:
    core.ok("SET_CONFIG", replace(core.ok("GET_CONFIG"), hottest_c=85))
    warm_ring(core, RING_HOTTEST_C + 2)
    assert wait(core, 9_000_000)[0].dimmed == 1
