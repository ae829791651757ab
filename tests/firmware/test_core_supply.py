"""The portable core on a virtual clock: the load switch of the LEDs is closed while they are lit, and before."""

import dataclasses
from collections.abc import Iterator

import pytest

from gellight.ring import protocol as p
from gellight.ring.enumerations import SyncMode
from tests.firmware.helpers.virtual_board import VirtualBoard

RED = bytes([200, 0, 0] + [0] * 33)
SWITCH = 6


@pytest.fixture
def switched(core: VirtualBoard) -> Iterator[VirtualBoard]:
    before = core.ok("GET_CONFIG")
    assert isinstance(before, p.Configuration)
    core.ok("SET_CONFIG", dataclasses.replace(before, switch_pin=SWITCH))
    core.ok("SAVE_CONFIG")
    board = VirtualBoard(core.library, core.flash())
    yield board
    board.close()


def test_it_is_open_until_the_first_light_and_again_in_the_dark(switched: VirtualBoard) -> None:
    assert not switched.powered
    asked_us = switched.now_us
    switched.ok("SET_LEDS", p.SetLeds(RED))
    assert switched.powered
    switched.advance(p.SUPPLY_US + 2_000)
    assert switched.lights()[-1][0] >= asked_us + p.SUPPLY_US
    assert switched.lights()[-1][2] == RED
    switched.ok("BLANK")
    assert switched.powered  # until the darkness has come through
    switched.advance(2_000)
    assert not switched.powered


def test_a_second_light_does_not_wait(switched: VirtualBoard) -> None:
    switched.ok("SET_LEDS", p.SetLeds(RED))
    switched.advance(p.SUPPLY_US + 2_000)
    asked_us = switched.now_us
    switched.ok("SET_LEDS", p.SetLeds(RED[::-1]))
    switched.advance(2_000)
    assert switched.lights()[-1][0] < asked_us + 100


@pytest.mark.parametrize("end", ["silent", "closed", "suspended"])
def test_it_opens_when_the_board_darkens_its_leds(switched: VirtualBoard, end: str) -> None:
    switched.ok("SET_LEDS", p.SetLeds(RED))
    switched.advance(p.SUPPLY_US + 2_000)
    if end == "silent":
        switched.advance(1_100_000)
    else:
        switched.link(False, 5 if end == "closed" else 6)
        switched.advance(2_000)
    assert not switched.powered


def test_a_sequence_keeps_it_closed_also_while_it_is_dark(switched: VirtualBoard) -> None:
    switched.load_sequence([RED], [p.SetStep(0, 0, 1, 5_000, 5_000)], loops=20)
    switched.sync(SyncMode.FREE)
    began_us = switched.now_us
    switched.ok("START")
    for _ in range(100):
        assert switched.powered
        switched.advance(1_000)
    assert switched.ok("COUNTERS").late_steps == 0
    assert next(light for light in switched.lights() if light[2] == RED)[0] >= began_us + p.SUPPLY_US
    switched.advance(200_000)
    assert not switched.powered


def test_a_trigger_lights_nothing_before_the_supply_has_risen(switched: VirtualBoard) -> None:
    switched.sync(SyncMode.EXT)
    switched.load_sequence([RED], [p.SetStep(0, 0, 1, 0, 0)])
    switched.ok("START")
    switched.advance(p.SUPPLY_US // 2)
    switched.edge()
    switched.advance(p.SUPPLY_US // 4)
    assert not any(switched.lights()[-1][2])
    switched.advance(p.SUPPLY_US)
    switched.edge()
    switched.advance(2_000)
    assert switched.lights()[-1][2] == RED
    assert switched.ok("COUNTERS").triggers_missed == 1


def test_without_a_switch_nothing_waits(core: VirtualBoard) -> None:
    asked_us = core.now_us
    core.ok("SET_LEDS", p.SetLeds(RED))
    core.advance(2_000)
    assert core.lights()[-1][0] < asked_us + 100
    assert not core.powered
