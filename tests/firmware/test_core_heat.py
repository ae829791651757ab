"""The portable core on a virtual clock: the LEDs get dimmer while the chip beside them is hot."""

import pytest

from gellight.ring import protocol as p
from gellight.ring.enumerations import SyncMode
from gellight.ring.protocol import COOLER_C, DIMMING_US, HOTTEST_C
from tests.firmware.helpers.virtual_board import VirtualBoard
from tests.firmware.helpers.warming import HALVED, PATTERN, SETTLED_US, wait


def test_a_still_light_is_halved_step_by_step_and_comes_back(core: VirtualBoard) -> None:
    core.ok("SET_LEDS", p.SetLeds(PATTERN))
    assert wait(core, 3_000_000) == []
    core.warm(HOTTEST_C + 2)
    events = wait(core, 4 * DIMMING_US)
    assert [event.dimmed for event in events] == [1, 2, 3]
    assert [event.temperature > 10 * HOTTEST_C for event in events] == [True] * 3
    assert events[2].time_us - events[1].time_us >= DIMMING_US
    core.warm(HOTTEST_C - COOLER_C - 2)
    assert [event.dimmed for event in wait(core, 4 * DIMMING_US)] == [2, 1, 0]
    shown = [colours for _, _, colours in core.lights()[1:]]
    assert shown == [HALVED[k] for k in (0, 1, 2, 3, 2, 1, 0)]
    assert core.status().dimmed == 0


def test_between_the_two_limits_nothing_changes(core: VirtualBoard) -> None:
    core.warm(HOTTEST_C - 0.2)
    assert wait(core, SETTLED_US) == []
    core.warm(HOTTEST_C + 0.2)
    assert [event.dimmed for event in wait(core, 10_000_000)] == [1]
    core.warm(HOTTEST_C - COOLER_C + 0.2)
    assert wait(core, SETTLED_US) == []
    core.warm(HOTTEST_C - COOLER_C - 0.2)
    assert [event.dimmed for event in wait(core, SETTLED_US)] == [0]


def test_a_reading_that_strays_dims_nothing(core: VirtualBoard) -> None:
    """One wrong reading of the converter among right ones."""
    core.warm(HOTTEST_C - 2)
    wait(core, SETTLED_US)
    for _ in range(5):
        core.warm(HOTTEST_C + 20)
        core.advance(100_000)
        core.warm(HOTTEST_C - 2)
        assert wait(core, SETTLED_US) == []


def test_the_limit_is_that_of_the_configuration(core: VirtualBoard) -> None:
    before = core.ok("GET_CONFIG")
    assert isinstance(before, p.Configuration)
    core.warm(50)
    assert wait(core, SETTLED_US) == []
    core.ok("SET_CONFIG", p.Configuration(**(vars(before) | {"hottest_c": 45})))
    assert wait(core, SETTLED_US)[0].dimmed == 1


def hot(core: VirtualBoard) -> None:
    core.warm(HOTTEST_C + 3)
    wait(core, 8_000_000)
    assert core.status().dimmed == 1


def test_a_hot_board_says_what_it_makes_of_a_light(core: VirtualBoard) -> None:
    hot(core)
    reply = core.ok("SET_LEDS", p.SetLeds(PATTERN))
    assert isinstance(reply, p.LightReply)
    assert reply.scale == p.FULL_SCALE // 2
    assert reply.current_ma == -(-(12_000 + -(-101 * 20_000 // 255)) // 1000)
    core.advance(2_000)
    assert core.lights()[-1][2] == HALVED[1]
    assert core.status().current_ma == reply.current_ma
    core.ok("BLANK")
    core.ok("SET_GROUP", p.SetGroup(0, PATTERN))
    assert core.ok("SET_GROUP", p.SetGroup(0, PATTERN)).scale == p.FULL_SCALE // 2


@pytest.mark.parametrize("mode", [SyncMode.FREE, SyncMode.HOLD, SyncMode.EXT])
def test_every_sequence_is_dimmed(core: VirtualBoard, mode: SyncMode) -> None:
    """In HOLD and EXT also the light that stays until the host or the trigger wants the next one."""
    core.load_sequence(
        [PATTERN, PATTERN], [p.SetStep(k, k, 1, 20_000 if mode is SyncMode.FREE else 0, 0) for k in (0, 1)]
    )
    core.sync(mode)
    core.ok("START")
    core.advance(3_000)
    if mode is SyncMode.HOLD:
        core.ok("STEP")
    if mode is SyncMode.EXT:
        core.edge()
    core.advance(3_000)
    assert core.lights()[-1][2] == PATTERN
    late = core.ok("COUNTERS").late_steps
    core.warm(HOTTEST_C + 3)
    wait(core, 8_000_000)
    assert core.status().state == 1
    assert core.lights()[-1][2] == HALVED[1]
    if mode is SyncMode.EXT:
        core.edge()
        core.advance(3_000)
        assert core.status().step == 1
        assert core.lights()[-1][2] == HALVED[1]
    assert core.ok("COUNTERS").late_steps == late


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
    assert not any(core.lights()[-1][2])
    lights = len(core.lights())
    core.warm(20)
    wait(core, 30_000_000)
    assert len(core.lights()) == lights


def test_cold_is_no_heat(core: VirtualBoard) -> None:
    core.warm(-20)
    assert wait(core, SETTLED_US) == []
    assert core.status().temperature == -200
