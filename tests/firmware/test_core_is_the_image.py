"""The compiled core, the board of `sim://`, and the image in the emulated chip: told one story, they say the same."""

import zlib
from dataclasses import dataclass, field
from random import Random
from typing import Any

import pytest

from gellight.lab.core_board.core import Core, packaged_library
from gellight.lab.core_board.simulated_board import UNIQUE_ID, thermistor_reading
from gellight.ring import protocol as p
from gellight.ring.enumerations import Edge, SyncMode
from gellight.ring.firmware.targets import committed_image
from gellight.ring.wire import LED_COUNT, Packet, Record, decode, encode
from tests.helpers.bench_board import BenchBoard

OPEN_US, BEGIN_US = 150_000, 200_000
REPLIES = {command.code | p.REPLY: command.reply for command in p.COMMANDS.values()}
EVENTS = dict(p.EVENTS.values())
GRID_MS = 20
"""durations of sequences are multiples of it; a sequence starts on it, and all else is said 10 ms beside it"""
ASIDE_MS = 10
KEEP_ALIVE_MS = 400
OF_THE_BOARD = {"board", "reset_reason", "capabilities", "image_crc"}
"""fields in which the two are not the same board"""
Said = tuple[int, int, dict[str, Any], dict[str, int]]
"""type, sequence, fields, and the times among them, us"""


class Story:
    """What a host does, and when, us on the clock of the board."""

    def __init__(self, seed: int) -> None:
        self.actions: list[tuple[int, str, Any]] = [(OPEN_US, "link", True)]
        self.random = Random(seed)
        self._at_ms, self._sequence = BEGIN_US // 1000, 0

    def do(self, what: str, value: Any = None) -> None:
        self.actions.append((self._at_ms * 1000, what, value))

    def wait(self, ms: int) -> None:
        self._at_ms += ms

    def send(self, name: str, record: Record = p.Empty()) -> None:  # noqa: B008 (it has no fields)
        """Send a command, and leave it time on the wire."""
        self._sequence = self._sequence + 1 & 0xFF
        self.do("send", encode(Packet(p.COMMANDS[name].code, self._sequence, record.pack())))
        self.wait(GRID_MS)

    def stay(self, ms: int) -> None:
        """Wait, and say now and then that the host is there."""
        end_ms = self._at_ms + ms
        while end_ms - self._at_ms > KEEP_ALIVE_MS:
            self.wait(KEEP_ALIVE_MS - GRID_MS)
            self.send("CLOCK", p.ClockRequest(self._at_ms))
        self.wait(end_ms - self._at_ms)

    def colours(self, most: int) -> bytes:
        return bytes(self.random.randrange(most) for _ in range(3 * LED_COUNT))

    # ---- what happens ----

    def still(self) -> None:
        for _ in range(3):
            self.send("SET_LEDS", p.SetLeds(self.colours(150)))
            self.stay(self.random.randrange(1, 5) * GRID_MS)
            self.send("STATUS")

    def too_bright(self) -> None:
        self.send("SET_LEDS", p.SetLeds(b"\xff" * 36))
        self.send("STATUS")
        self.send("BLANK")

    def load(self, mode: SyncMode, loops: int, **sync: int) -> None:
        groups = [self.colours(100) for _ in range(4)]
        steps = []
        for index in range(self.random.randrange(2, 7)):
            dwell_ms, blank_ms = self.random.randrange(1, 4) * GRID_MS, self.random.randrange(2) * GRID_MS
            held = mode != SyncMode.FREE
            steps.append(p.SetStep(index, self.random.randrange(4), self.random.randrange(1, 3),
                                   0 if held else dwell_ms * 1000, 0 if held else blank_ms * 1000))  # fmt: skip
        table = groups + [bytes(36)] * (p.GROUP_COUNT - 4)
        self.send(
            "SET_SYNC", p.SetSync(mode, **({"edge": Edge.RISING, "divider": 1, "delay_us": 0, "timeout_us": 0} | sync))
        )
        for index, group in enumerate(table):
            self.send("SET_GROUP", p.SetGroup(index, group))
        for step in steps:
            self.send("SET_STEP", step)
        crc = zlib.crc32(b"".join(table) + b"".join(step.pack() for step in steps))
        self.send("COMMIT", p.Commit(crc, loops, len(steps)))

    def start(self) -> None:
        self.wait(ASIDE_MS)
        self.send("START")
        self.wait(ASIDE_MS)

    def free(self, ms: int) -> None:
        self.load(SyncMode.FREE, 0)
        self.start()
        self.stay(ms // 2)
        self.send("STATUS")
        self.send("TRIM", p.Trim(self.random.choice([-2000, 2000]), 0))
        self.stay(ms // 2)
        self.send("STATUS")
        self.send("SET_LEDS", p.SetLeds(self.colours(50)))  # refused
        self.send("STOP")
        self.send("BLANK")

    def passes(self) -> None:
        self.load(SyncMode.FREE, 2)
        self.start()
        self.stay(2500)
        self.send("STATUS")

    def triggered(self) -> None:
        self.load(SyncMode.EXT, 0, divider=2, delay_us=1500, timeout_us=200_000)
        self.start()
        for _ in range(self.random.randrange(5, 20)):
            self.do("edge", True)
            self.wait(5)
            self.do("edge", False)
            self.wait(28)
            self.send("CLOCK", p.ClockRequest(self._at_ms))
        self.stay(300)
        self.send("STATUS")
        self.send("STOP")
        self.send("BLANK")

    def silence(self) -> None:
        self.send("SET_LEDS", p.SetLeds(self.colours(100)))
        self.wait(1300)
        self.send("HELLO")
        self.send("STATUS")

    def rubbish(self) -> None:
        self.do("send", bytes(self.random.randrange(256) for _ in range(30)) + b"\0")
        self.wait(GRID_MS)
        self.do("send", self.actions[-2][2])  # again, with the same number
        self.wait(GRID_MS)
        self.do("send", encode(Packet(0x7E, 3, b"?")))
        self.wait(GRID_MS)
        self.send("COUNTERS")

    def saved(self) -> None:
        self.send("BLANK")
        name = f"sensor {self._at_ms}".encode().ljust(16, b"\0")
        self.send("SET_CONFIG", p.Configuration(1000, 450, 1000, 20000, 300, 0, 0, name))
        self.send("SAVE_CONFIG")
        self.stay(200)
        self.send("GET_CONFIG")

    def plugged(self) -> None:
        self.send("SET_LEDS", p.SetLeds(self.colours(100)))
        self.do("link", False)
        self.wait(100)
        self.do("link", True)
        self.wait(50)
        self.send("HELLO")
        self.send("STATUS")

    def everything(self, ms: int) -> None:
        """Do all of it once, with a sequence of about so long."""
        for part in (self.still, self.too_bright, lambda: self.free(ms), self.triggered, self.silence,
                     self.rubbish, self.saved, self.plugged, self.passes):  # fmt: skip
            part()


@dataclass
class Account:
    replies: list[Said] = field(default_factory=list)
    events: list[Said] = field(default_factory=list)
    lights: list[tuple[float, bytes]] = field(default_factory=list)
    """when they were latched, us on the clock of the board, and their colours"""
    faults: list[str] = field(default_factory=list)

    def hear(self, data: bytes) -> None:
        for stuffed in data.split(b"\0")[:-1]:
            packet = decode(stuffed)
            reply = bool(packet.type & p.REPLY)
            (self.replies if reply else self.events).append((packet.type, packet.sequence, *_fields(packet, reply)))


def _fields(packet: Packet, reply: bool) -> tuple[dict[str, Any], dict[str, int]]:
    fields: dict[str, Any] = {"status": packet.payload[:5]} if reply else {}
    times: dict[str, int] = {}
    if reply and packet.payload[0]:
        return fields, times
    record: type[Record] = REPLIES[packet.type] if reply else EVENTS[packet.type]
    read = record.unpack(packet.payload[5:] if reply else packet.payload)
    for name, scalar, _ in read._layout():
        time = scalar.code == "Q" and name != "host_us"
        if name not in OF_THE_BOARD:
            (times if time else fields)[name] = getattr(read, name)
    return fields, times


def told_to_the_image(story: Story) -> Account:
    """Tell it to the image on the emulated chip, whose cable takes its time."""
    account, board = Account(), BenchBoard(committed_image(), unique_id=UNIQUE_ID)
    board.run_until(lambda: board.host.configured, OPEN_US)
    heard = bytearray()

    def run_to(at_us: float) -> None:
        board.run(max(at_us + board.timer_began_us - board.now_us, 0.0))
        heard.extend(board.host.received)
        board.host.received.clear()

    does = {
        "link": lambda opened: board.host.open() if opened else board.host.close(),
        "send": board.host.send, "edge": board.set_trigger, "ring": board.set_ring_temperature,
    }  # fmt: skip
    for at_us, what, value in story.actions:
        run_to(at_us)
        does[what](value)
    run_to(story.actions[-1][0] + 100_000)
    account.hear(bytes(heard))
    began_us = board.timer_began_us
    account.lights = [
        (light.time_us - began_us, light.colours.tobytes()) for light in map(board.timeline.__getitem__, _kept(board))
    ]
    account.faults = board.faults
    return account


def _kept(board: BenchBoard) -> range:
    return range(board.timeline._forgotten, len(board.timeline))


def told_to_the_core(story: Story, chip: int) -> Account:
    """Tell it to the compiled core, whose chip is as warm (0.1 degrees Celsius) as the other one."""
    account, core, seen = Account(), Core(packaged_library()), 0
    core.call("identify", UNIQUE_ID)
    core.call("warm", chip)
    heard = bytearray()
    does = {
        "link": core.link, "send": core.receive, "edge": lambda rises: core.edge(falling=not rises),
        "ring": lambda celsius: core.call("warm_ring", thermistor_reading(celsius)),
    }  # fmt: skip
    for at_us, what, value in [*story.actions, (story.actions[-1][0] + 100_000, "send", b"")]:
        core.advance(at_us - core.now_us)
        does[what](value)
        heard.extend(core.take_output())
        for light in core.latched(seen):
            account.lights.append((light.latched_us, light.rgb(LED_COUNT).tobytes()))
            seen += 1
    account.hear(bytes(heard))
    return account


WIRE_US = 1_500
"""what is said reaches the image with the next frame of the USB, a millisecond long, and is then read and answered"""

TICK_US = 10_000
"""as often a board looks at the clock for what it does by itself, and the two do not at the same moments"""
READ_US = 100_000
"""as often it reads its thermometers, at a tick"""
BY_ITSELF = {
    p.EVENTS["DARK"][0]: TICK_US, p.EVENTS["DIMMED"][0]: READ_US + TICK_US,
}  # fmt: skip
"""what a board says without being asked, and by how much two boards differ in when"""


def test_every_reply_event_and_light_of_the_core_is_that_of_the_image() -> None:
    story = Story(seed=1)
    story.everything(600)
    image = told_to_the_image(story)
    core = told_to_the_core(story, chip_of(image))
    assert image.faults == []
    watched = [(times["time_us"], BY_ITSELF[code]) for code, _, _, times in image.events if code in BY_ITSELF]

    def late_us(when_us: float) -> float:
        return WIRE_US + max((late for at_us, late in watched if abs(when_us - at_us) < 2 * TICK_US), default=0)

    for theirs, ours in ((image.replies, core.replies), (image.events, core.events)):
        for said, again in zip(theirs, ours, strict=True):
            assert said[:2] == again[:2]
            assert but_for_the_mean(said) == but_for_the_mean(again)
            assert again[2].get("mean_ma", 0) == pytest.approx(said[2].get("mean_ma", 0), abs=1)
            for name, time_us in said[3].items():
                assert again[3][name] == pytest.approx(time_us, abs=late_us(time_us)), said
    assert [colours for _, colours in core.lights] == [colours for _, colours in image.lights]
    for (at_us, _), (image_us, _) in zip(core.lights, image.lights, strict=True):
        assert at_us == pytest.approx(image_us, abs=late_us(image_us))
    assert len(image.lights) > 50


def but_for_the_mean(said: Said) -> dict[str, object]:
    """Leave out the mean current of minutes, in whole mA: the charge of a light is counted at the next tick."""
    return {name: value for name, value in said[2].items() if name != "mean_ma"}


def chip_of(account: Account) -> int:
    return next(fields["temperature"] for _, _, fields, _ in account.replies if "temperature" in fields)
