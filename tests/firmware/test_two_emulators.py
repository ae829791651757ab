"""The committed image in two emulators of different authors: every packet and every bit to the LEDs is the same."""

import dataclasses
from typing import Any

import pytest

from gellight.lab.core_board.simulated_board import thermistor_ohm
from gellight.ring import protocol as p
from tests.firmware.helpers.two_emulators import Account, Action, command, first_emulator, second_emulator

pytestmark = pytest.mark.nightly
LIT = p.SetLeds(bytes(i * 7 % 97 for i in range(36)))
NAMED = p.Configuration(900, 400, 1000, 20000, 300, 0, 0, b"two judges".ljust(16, b"\0"))
CLOCK_US = 1_000.0
"""by which times on the board's clock may differ: the processors do not take the same cycles"""
PULSE_NS = 1e9 / 120e6
STORY: list[Action] = [
    ("open",),
    *(action for number, (name, record, wait_us) in enumerate((
        ("HELLO", p.Empty(), 3_000), ("GET_CONFIG", p.Empty(), 3_000), ("CLOCK", p.ClockRequest(77), 3_000),
        ("SET_LEDS", LIT, 4_000), ("STATUS", p.Empty(), 3_000), ("SET_LEDS", p.SetLeds(b"\xff" * 36), 4_000),
        ("BLANK", p.Empty(), 4_000), ("SET_CONFIG", NAMED, 4_000), ("SAVE_CONFIG", p.Empty(), 90_000),
        ("SET_CONFIG", dataclasses.replace(NAMED, limit_ma=300), 4_000), ("SAVE_CONFIG", p.Empty(), 10_000),
        ("SELFTEST", p.Empty(), 90_000), ("SET_LEDS", LIT, 4_000),
    ), 1) for action in (command(name, number, record), ("run", wait_us))),
    ("suspend",), ("run", 8_000), ("resume",), ("run", 5_000), command("COUNTERS", 30), ("run", 4_000),
    ("power",), ("open",), command("GET_CONFIG", 31), ("run", 4_000), command("SET_LEDS", 32, LIT), ("run", 4_000),
    ("ntc", thermistor_ohm(25)), ("run", 450_000), command("STATUS", 33), ("ntc", thermistor_ohm(90)),
    *(action for number in (34, 35) for action in (("run", 700_000), command("CLOCK", number, p.ClockRequest(1)))),
    command("STATUS", 36), ("run", 4_000), ("ntc", 1.0), ("run", 400_000), command("STATUS", 37), ("run", 4_000),
]  # fmt: skip


@pytest.fixture(scope="module")
def accounts() -> tuple[Account, Account]:
    from gellight.ring.firmware.targets import committed_image

    image = committed_image()
    return first_emulator(image, STORY), second_emulator(image, STORY)


def test_neither_finds_a_fault(accounts: tuple[Account, Account]) -> None:
    assert [account.faults for account in accounts] == [[], []]


def test_the_device_describes_itself_in_the_same_bytes(accounts: tuple[Account, Account]) -> None:
    first, second = (account.descriptors for account in accounts)
    assert first
    assert {name: second[name] for name in first} == first


def test_every_packet_is_the_same(accounts: tuple[Account, Account]) -> None:
    first, second = (account.said() for account in accounts)
    assert [(code, number) for code, number, _ in first] == [(code, number) for code, number, _ in second]
    assert len(first) >= 20
    for (_, _, ours), (_, _, theirs) in zip(first, second, strict=True):
        assert _but_times(ours) == _but_times(theirs)
        times = [(ours[name], theirs[name]) for name in ours if isinstance(ours[name], float)]
        assert all(abs(a - b) <= CLOCK_US for a, b in times), (ours, theirs)


def _but_times(fields: dict[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in fields.items() if not isinstance(value, float)}


def test_every_bit_to_the_leds_is_the_same(accounts: tuple[Account, Account]) -> None:
    first, second = accounts
    assert first.lights == second.lights
    assert len(set(first.lights)) >= 2
    assert "1" not in first.lights[0]
    for ours, theirs in zip(first.pulses, second.pulses, strict=True):
        for a, b in zip(ours, theirs, strict=True):
            assert a == pytest.approx(b, abs=PULSE_NS)


def test_the_story_has_what_it_is_told_for(accounts: tuple[Account, Account]) -> None:
    """Lit, refused, saved, dark in a suspend, the saved settings after the power was off; a ring warm, hot and lost."""
    for account in accounts:
        replies = {number: fields for code, number, fields in account.said() if code & p.REPLY}
        assert replies[6]["status"][0] != 0
        assert replies[9]["status"][0] == replies[11]["status"][0] == 0
        assert replies[12]["failed"] == 0
        assert [replies[number]["ring_temperature"] for number in (5, 37)] == [p.NO_TEMPERATURE] * 2
        assert replies[33]["ring_temperature"] == pytest.approx(250, abs=3)
        assert 10 * p.RING_HOTTEST_C < replies[36]["ring_temperature"] < 900
        assert replies[36]["dimmed"] == 1
        assert (replies[31]["limit_ma"], replies[31]["name"]) == (300, NAMED.name)
        lit = [number for number, bits in enumerate(account.lights) if "1" in bits]
        assert any("1" not in bits for bits in account.lights[lit[1] + 1 : lit[-1]])
