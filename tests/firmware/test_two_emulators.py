"""The committed image in two emulators of different authors: every packet and every bit to the LEDs is the same.

The second is rp2040js, with flash, boot ROM, USB host and LED decoder of its own in `tests/firmware/second_emulator`.
The boot ROM of the chip is not ours to hand on: its functions are written anew in both.
"""

import base64
import dataclasses
import json
import subprocess
from dataclasses import dataclass, field
from typing import Any

import pytest

from gellight.lab.core_board.simulated_board import thermistor_ohm
from gellight.ring import protocol as p
from gellight.ring.firmware.targets import committed_image
from gellight.ring.wire import Packet, Record, decode, encode
from tests.firmware.emulator.analog import THERMISTOR_PIN, Divider
from tests.firmware.emulator.busy_bus import B1
from tests.firmware.emulator.chip import UNIQUE_ID
from tests.helpers.bench_board import BenchBoard, NotingDecoder
from tests.helpers.places import CHECKOUT

FOLDER = CHECKOUT / "tests/firmware/second_emulator"
Action = tuple[str, Any] | tuple[str]
REPLIES = {command.code | p.REPLY: command.reply for command in p.COMMANDS.values()}
EVENTS = dict(p.EVENTS.values())
NOT_MODELLED = ("clkDivRestart not implemented", "USB Unimplemented peripheral", "0x7c", "0x80")
"""what rp2040js says of registers that it does not know"""


@dataclass
class Account:
    packets: list[tuple[float, Packet]] = field(default_factory=list)
    """with the time when they came, on the board's clock, us"""
    lights: list[str] = field(default_factory=list)
    """the bits that the LEDs were sent"""
    pulses: list[list[list[float]]] = field(default_factory=list)
    """shortest and longest high and low time of zeros, then of ones, ns"""
    descriptors: dict[str, str] = field(default_factory=dict)
    faults: list[str] = field(default_factory=list)

    def said(self) -> list[tuple[int, int, dict[str, Any]]]:
        """Return type, sequence and fields of each packet; times of the board's clock count from its arrival."""
        return [(packet.type, packet.sequence, _fields(at_us, packet)) for at_us, packet in self.packets]


def _fields(at_us: float, packet: Packet) -> dict[str, Any]:
    reply = packet.type in REPLIES
    fields: dict[str, Any] = {"status": packet.payload[:5]} if reply else {}
    if reply and packet.payload[0]:
        return fields
    record: type[Record] = REPLIES[packet.type] if reply else EVENTS[packet.type]
    read = record.unpack(packet.payload[5:] if reply else packet.payload)
    for name, scalar, _ in read._layout():
        value = getattr(read, name)
        fields[name] = at_us - value if scalar.code == "Q" and name != "host_us" else value
    return fields


def command(name: str, number: int, record: Record = p.Empty()) -> Action:  # noqa: B008 (it has no fields)
    return "send", encode(Packet(p.COMMANDS[name].code, number, record.pack())).hex()


class RecordingDecoder(NotingDecoder):
    """Keeps the bits of every frame."""

    account: Account

    def _latch(self) -> None:
        super()._latch()
        bits = [("1" if bit.high_ns > 500 else "0", bit) for bit in self.bits]
        spans = []
        for value in "01":
            spans.append([bit.high_ns for name, bit in bits if name == value])
            spans.append([bit.low_ns for name, bit in bits if name == value and bit.low_ns is not None])
        self.account.lights.append("".join(name for name, _ in bits))
        self.account.pulses.append([[min(span), max(span)] if span else [] for span in spans])


class RecordedBoard(BenchBoard):
    """The first emulator, with an account of what it shows."""

    decoder = RecordingDecoder
    waveform: RecordingDecoder


def first_emulator(image: bytes, story: list[Action]) -> Account:
    """Tell the story to the emulator of the package."""
    account = Account()
    RecordingDecoder.account = account
    board = RecordedBoard(image, revision=B1)
    for name, *values in story:
        _act(board, account, name, values)
    account.descriptors = {name: value.hex() for name, value in board.host.descriptors.items()}
    account.faults = board.faults
    return account


def _act(board: RecordedBoard, account: Account, name: str, values: list[Any]) -> None:
    if name == "open":
        board.run_until(lambda: board.host.configured, 200_000)
        board.host.open()
        _run(board, account, 5_000)
    elif name == "send":
        board.host.send(bytes.fromhex(values[0]))
    elif name == "run":
        _run(board, account, values[0])
    elif name == "ntc":
        board.dividers[THERMISTOR_PIN] = Divider(to_ground=values[0])
    elif name == "power":
        board.power_off()
        board.power_on()
    else:
        {"suspend": board.suspend, "resume": board.resume}[name]()


def _run(board: RecordedBoard, account: Account, duration_us: float) -> None:
    end_us = board.now_us + duration_us
    while board.run_until(lambda: 0 in board.host.received, end_us - board.now_us):
        stuffed, _, rest = bytes(board.host.received).partition(b"\0")
        board.host.received[:] = rest
        account.packets.append((board.now_us - board.timer_began_us, decode(stuffed)))


def second_emulator(image: bytes, story: list[Action]) -> Account:
    assert (FOLDER / "node_modules").is_dir(), "rp2040js is missing: make tools"
    told = {"flash": base64.b64encode(image).decode(), "uniqueId": UNIQUE_ID.hex(), "actions": story}
    done = subprocess.run(["node", str(FOLDER / "main.mjs")], input=json.dumps(told), capture_output=True, text=True,
                          check=True, timeout=300)  # fmt: skip
    came = json.loads(done.stdout)
    account = Account(descriptors=came["descriptors"])
    account.faults = [text for text in came["faults"] if not any(name in text for name in NOT_MODELLED)]
    for entry in came["log"]:
        if "packet" in entry:
            account.packets.append((entry["chip_us"], decode(bytes.fromhex(entry["packet"])[:-1])))
        elif "bits" in entry:
            account.lights.append(entry["bits"])
            account.pulses.append(entry["pulses"])
    return account


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
