"""The portable core on a virtual clock: no command lets the LEDs draw more than was granted; the load switch."""

import dataclasses
import itertools

import pytest

from gellight.ring import protocol as p
from gellight.ring.enumerations import Status, SyncMode
from gellight.ring.wire import Packet, Record, encode
from tests.firmware.helpers.virtual_board import BLACK, RED, WHITE, VirtualBoard

FACTORY = p.Configuration(1000, 450, 1000, 20000, 300, 0, 0, b"GelLight".ljust(16, b"\0"))
ALL_RED = bytes([255, 0, 0] * 12)
LIGHTS = (BLACK, ALL_RED, bytes([255, 200, 0] * 12), WHITE)
LATCHED_US = 3_000


def true_ma(colours: bytes) -> float:
    """What WS2812B draw, whatever the board was told of them: 1 mA each, and 20 mA a colour."""
    return len(colours) / 3 + sum(colours) * 20 / 255


def edge_commands() -> list[tuple[str, Record]]:
    configurations = [
        p.Configuration(60_000, limit, quiescent, channel, 300, 0, external, FACTORY.name)
        for external, limit, channel, quiescent in itertools.product(
            (0, 1), (100, 450, 451, 2000), (1_000, 5_000, 12_000, 20_000), (0, 1_000)
        )
    ]
    return [
        *(("SET_CONFIG", configuration) for configuration in configurations),
        *(("SET_LEDS", p.SetLeds(colours)) for colours in LIGHTS),
    ]


def started(core: VirtualBoard, **fields: int) -> VirtualBoard:
    """A board that has started with these fields in its flash, put there as somebody does who means it."""
    wanted = dataclasses.replace(FACTORY, **fields)
    core.ok("SET_SUPPLY", p.SetSupply(p.SUPPLY_MAGIC, wanted.channel_ua, wanted.external_supply))
    core.ok("SET_CONFIG", wanted)
    core.ok("SAVE_CONFIG")
    return core.restarted()


@pytest.mark.parametrize("start", [{}, {"limit_ma": 100}, {"external_supply": 1, "limit_ma": 500}])
def test_no_two_commands_talk_the_limit_away(core: VirtualBoard, start: dict[str, int]) -> None:
    """Every sequence of two, and then white: on USB it would draw 732 mA."""
    commands = edge_commands()
    wire = [[encode(Packet(p.COMMANDS[name].code, number, record.pack())) for name, record in commands]
            for number in (201, 202)]  # fmt: skip
    white = encode(Packet(p.COMMANDS["SET_LEDS"].code, 203, WHITE))
    flash = started(core, **start).flash()
    for first, second in itertools.product(*wire):
        board = VirtualBoard(core.library, flash)
        for command in (first, second, white):
            board.receive(command)
            board.advance(LATCHED_US)
        drawn = [true_ma(colours) for _, _, colours in board.lights()]
        assert max(drawn) <= start.get("limit_ma", 450), (first, second)


def test_a_supply_of_their_own_takes_a_confirmation_and_a_start(core: VirtualBoard) -> None:
    supplied = dataclasses.replace(FACTORY, external_supply=1, limit_ma=1200)
    assert core.ask("SET_CONFIG", supplied)[:2] == (Status.OUT_OF_RANGE, 1)
    assert core.ask("SET_SUPPLY", p.SetSupply(1, 20_000, 1))[:2] == (Status.BAD_MAGIC, 1)
    core.ok("SET_SUPPLY", p.SetSupply(p.SUPPLY_MAGIC, 20_000, 1))
    core.ok("SET_CONFIG", supplied)
    assert core.ok("GET_CONFIG") == supplied
    core.ok("SAVE_CONFIG")
    assert core.ask("SET_LEDS", p.SetLeds(WHITE))[:2] == (Status.OVER_CURRENT, 732)
    again = core.restarted()
    assert again.ok("SET_LEDS", p.SetLeds(WHITE)).current_ma == 732
    again.ok("BLANK")
    again.advance(LATCHED_US)
    again.ok("SET_SUPPLY", p.SetSupply(p.SUPPLY_MAGIC, 20_000, 0))
    assert again.ok("GET_CONFIG") == FACTORY
    assert again.ask("SET_LEDS", p.SetLeds(WHITE))[0] == Status.OVER_CURRENT


@pytest.mark.parametrize(("external", "least"), [(0, p.CHANNEL_USB_UA), (1, p.CHANNEL_EXTERNAL_UA)])
def test_less_than_an_led_draws_takes_a_confirmation(core: VirtualBoard, external: int, least: int) -> None:
    board = started(core, external_supply=external)
    modest = dataclasses.replace(FACTORY, external_supply=external, channel_ua=least)
    board.ok("SET_CONFIG", modest)
    undercut = dataclasses.replace(modest, channel_ua=least - 1)
    assert board.ask("SET_CONFIG", undercut)[:2] == (Status.OUT_OF_RANGE, least - 1)
    least = p.CHANNEL_LEAST_UA
    confirmed = p.SetSupply(p.SUPPLY_MAGIC, least - 1, external)
    assert board.ask("SET_SUPPLY", confirmed)[:2] == (Status.OUT_OF_RANGE, least - 1)
    board.ok("SET_SUPPLY", dataclasses.replace(confirmed, channel_ua=least))
    small = dataclasses.replace(modest, channel_ua=least, name=b"small LEDs".ljust(16, b"\0"))
    board.ok("SET_CONFIG", small)
    assert board.ok("GET_CONFIG") == small


def test_what_is_granted_on_a_supply_is_not_on_usb(core: VirtualBoard) -> None:
    board = started(core, external_supply=1, channel_ua=12_000)
    assert board.ask("SET_CONFIG", dataclasses.replace(FACTORY, channel_ua=12_000))[:2] == (Status.OUT_OF_RANGE, 12_000)
    board.ok("SET_CONFIG", FACTORY)


def test_a_chip_may_not_get_hotter_than_at_the_start(core: VirtualBoard) -> None:
    core.ok("SET_CONFIG", dataclasses.replace(FACTORY, hottest_c=85))
    core.warm(70)
    lit_for(core, 10, ALL_RED)
    assert core.status().dimmed == 1


# ---- power and time ----


@pytest.fixture
def strong(core: VirtualBoard) -> VirtualBoard:
    return started(core, external_supply=1, limit_ma=2000)


def lit_for(core: VirtualBoard, seconds: float, colours: bytes) -> p.StatusReply:
    """Show a light for a time, and return what the board says then."""
    core.ok("SET_LEDS", p.SetLeds(colours))
    for _ in range(round(seconds * 2)):
        core.advance(500_000)
        core.ok("CLOCK", p.ClockRequest(0))
    return core.status()


def test_much_for_minutes_is_halved_and_comes_back_in_the_cool(strong: VirtualBoard) -> None:
    """732 mA reach a mean of 600 after 410 s * ln(732 / 132), 373 mA let it fall to 500 after 410 s * ln(227 / 127)."""
    assert lit_for(strong, 670, WHITE).dimmed == 0
    told = lit_for(strong, 60, WHITE)
    assert told.dimmed == 1
    assert 570 <= told.mean_ma <= 600
    assert lit_for(strong, 150, WHITE).dimmed == 1
    told = lit_for(strong, 100, WHITE)
    assert told.dimmed == 0
    assert told.current_ma == 732


def test_much_for_a_moment_is_no_matter(strong: VirtualBoard) -> None:
    for _ in range(20):
        told = lit_for(strong, 30, WHITE)
        strong.ok("BLANK")
        strong.advance(30_000_000)
    assert told.dimmed == 0
    assert 300 <= told.mean_ma <= 420


def test_a_sequence_counts_by_what_it_draws_in_the_mean(strong: VirtualBoard) -> None:
    """A quarter of the time; the readings fall on any part of it."""
    strong.load_sequence([WHITE], [p.SetStep(0, 0, 1, 25_000, 75_000)])
    strong.ok("SET_SYNC", p.SetSync(SyncMode.FREE, 0, 1, 0, 0))
    strong.ok("START")
    for _ in range(1000):
        strong.ok("CLOCK", p.ClockRequest(0))
        strong.advance(500_000)
    expected = (0.25 * 732 + 0.75 * 12) * (1 - 2.718 ** (-500 / 409.6))
    assert abs(strong.status().mean_ma - expected) < 0.03 * expected


def test_what_usb_gives_never_warms_the_housing_too_much() -> None:
    assert p.CURRENT_CAP_MA < p.HOUSING_MA * 5 / 6


@pytest.fixture
def switched(core: VirtualBoard) -> VirtualBoard:
    return started(core, switch_pin=6)


def test_it_is_open_until_the_first_light_and_again_in_the_dark(switched: VirtualBoard) -> None:
    assert not switched.powered
    asked_us = switched.now_us
    switched.ok("SET_LEDS", p.SetLeds(RED))
    assert switched.powered
    switched.advance(p.SUPPLY_US + 2_000)
    assert switched.lights()[-1][0] >= asked_us + p.SUPPLY_US
    assert switched.light == RED
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
    switched.play([RED], [p.SetStep(0, 0, 1, 0, 0)], mode=SyncMode.EXT)
    switched.advance(p.SUPPLY_US // 2)
    switched.edge()
    switched.advance(p.SUPPLY_US // 4)
    assert not any(switched.light)
    switched.advance(p.SUPPLY_US)
    switched.edge()
    switched.advance(2_000)
    assert switched.light == RED
    assert switched.ok("COUNTERS").triggers_missed == 1
