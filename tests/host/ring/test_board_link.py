"""Requests, replies and events on a link that loses some: deadlines, versions, and who may speak meanwhile."""

import threading
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest

from gellight.base.errors import BoardError
from gellight.ring import board_link
from gellight.ring import protocol as p
from gellight.ring.enumerations import Dark
from gellight.ring.light_ring import LightRing
from gellight.ring.wire import Packet, Record, decode, encode, u8

HELLO = p.HelloReply(*p.VERSION, p.schema_crc(), 1, 0, 0, 1, 0, bytes(8), 0, 12, 16, 32, 128, p.TICK_HZ, 0)
STATUS, CLOCK, LIGHT = (
    record.unpack(bytes(record.codec().size)) for record in (p.StatusReply, p.ClockReply, p.LightEvent)
)


def packet(code: int, sequence: int, record: Record, *, reply: bool = True) -> bytes:
    return encode(Packet(code, sequence, (bytes(5) if reply else b"") + record.pack()))


class ScriptedBoard:
    """A transport to a board that answers HELLO, and every other request as `answer` says."""

    url = "scripted"

    def __init__(self, answer: Callable[[Packet], bytes], hello: p.HelloReply = HELLO) -> None:
        self._answer, self._hello = answer, hello
        self.requests: list[Packet] = []
        self.pending: deque[bytes] = deque()
        self.closed = False
        self._arrived = threading.Condition()

    def write(self, data: bytes) -> None:
        for stuffed in filter(None, data.split(b"\0")):
            request = decode(stuffed)
            self.requests.append(request)
            hello = request.type == p.COMMANDS["HELLO"].code
            self.put(packet(0x81, request.sequence, self._hello) if hello else self._answer(request))

    def put(self, data: bytes) -> None:
        with self._arrived:
            self.pending.append(data)
            self._arrived.notify()

    def read(self, timeout_s: float) -> bytes:
        with self._arrived:
            self._arrived.wait_for(lambda: self.pending, timeout_s)
            return self.pending.popleft() if self.pending else b""

    def close(self) -> None:
        self.closed = True


def empty(request: Packet) -> bytes:
    return packet(request.type | p.REPLY, request.sequence, p.Empty())


def test_a_lost_reply_is_asked_for_four_times_while_events_come(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each event used to start the wait anew, so that a request whose reply was lost never ended."""
    passed_s = 0.0

    class Telling(ScriptedBoard):
        def read(self, timeout_s: float) -> bytes:
            nonlocal passed_s
            passed_s += min(0.01, timeout_s)
            assert passed_s < 5, "still waiting"
            return super().read(0) or packet(p.EVENTS["LIGHT"][0], 0, LIGHT, reply=False)

    monkeypatch.setattr(board_link, "time", SimpleNamespace(monotonic=lambda: passed_s))
    transport = Telling(lambda _: b"")
    ring = LightRing(transport, keep_alive_s=None)
    begin_s = passed_s
    with pytest.raises(BoardError, match=r"did not answer STATUS in 4 attempts of 0\.25 s"):
        ring.status()
    assert passed_s - begin_s == pytest.approx(1.0, abs=0.05)
    assert [request.type for request in transport.requests].count(p.COMMANDS["STATUS"].code) == 4
    assert len(ring.events) > 90


def test_a_reply_that_arrived_while_the_program_was_held_up_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    times_s = iter([0.0, 0.0, 0.0, *range(100, 200)])
    monkeypatch.setattr(board_link, "time", SimpleNamespace(monotonic=lambda: float(next(times_s))))
    ring = LightRing(ScriptedBoard(empty), keep_alive_s=None)
    ring.stop()
    assert ring.retries == 0


def test_others_speak_while_one_waits_for_its_light() -> None:
    """The board is kept alive meanwhile: here the light is only latched once the clock was asked for."""
    latched = replace(LIGHT, light_id=7)

    def answer(request: Packet) -> bytes:
        if request.type == p.COMMANDS["CLOCK"].code:
            reply = packet(request.type | p.REPLY, request.sequence, CLOCK)
            return reply + packet(p.EVENTS["LIGHT"][0], 0, latched, reply=False)
        return empty(request)

    ring = LightRing(ScriptedBoard(answer), keep_alive_s=None)
    found: list[p.LightEvent] = []
    waiting = threading.Thread(target=lambda: found.append(ring.wait_for_light(7, 30.0)))
    waiting.start()
    ring.clock()
    waiting.join()
    assert found == [latched]


@pytest.mark.parametrize("minor", [p.VERSION[1] + 1, 0])
def test_another_minor_version_or_build_is_no_reason_to_flash(minor: int) -> None:
    hello = p.HelloReply(p.VERSION[0], minor, 0x12345678, *list(vars(HELLO).values())[3:])
    with LightRing(ScriptedBoard(empty, hello), keep_alive_s=None) as ring:
        assert ring.hello.protocol_minor == minor


@pytest.mark.parametrize(("by", "words"), [(1, "too new.*update GelLight"), (-1, "too old.*gellight firmware flash")])
def test_another_major_version_is_refused(by: int, words: str) -> None:
    hello = p.HelloReply(p.VERSION[0] + by, *list(vars(HELLO).values())[1:])
    transport = ScriptedBoard(empty, hello)
    with pytest.raises(BoardError, match=words):
        LightRing(transport, keep_alive_s=None)
    assert transport.closed


@dataclass(frozen=True)
class Grown(Record):
    """Two fields, and two that later minor versions have added."""

    first: u8
    second: u8
    third: u8 = 30
    fourth: u8 = 40


@pytest.mark.parametrize(
    ("payload", "read"), [(b"\1\2", Grown(1, 2)), (b"\1\2\3", Grown(1, 2, 3)), (b"\1\2\3\4\5\6", Grown(1, 2, 3, 4))]
)
def test_fields_of_other_minor_versions_are_ignored_or_take_their_default(payload: bytes, read: Grown) -> None:
    assert Grown.unpack(payload) == read


def test_a_reply_without_a_field_that_always_was_there_is_refused() -> None:
    with pytest.raises(BoardError, match="has 4 bytes, the board sent 1"):
        Grown.unpack(b"\1")
    with pytest.raises(BoardError, match="gellight firmware flash"):
        p.Trim.unpack(b"12345")


def test_the_ring_forgets_a_light_that_was_never_latched() -> None:
    def answer(request: Packet) -> bytes:
        if request.type == p.COMMANDS["SET_LEDS"].code:
            return packet(request.type | p.REPLY, request.sequence, p.LightReply(9, 20, p.FULL_SCALE))
        if request.type == p.COMMANDS["STATUS"].code:
            return packet(request.type | p.REPLY, request.sequence, replace(STATUS, light_id=8))
        return empty(request)

    ring = LightRing(ScriptedBoard(answer), keep_alive_s=None)
    with pytest.raises(BoardError, match=r"light 9 was not latched within 0\.1 s"):
        ring.light(np.zeros((12, 3), np.uint8), timeout_s=0.1)


class ForgettingBoard(ScriptedBoard):
    """Latches every light at once; its event of the dark gets lost, and with `mute` those of its lights."""

    def __init__(self, *, mute: bool = False) -> None:
        super().__init__(self._say)
        self.dark, self.lights, self._mute = Dark.NOT_DARK, 0, mute

    def _say(self, request: Packet) -> bytes:
        names = {command.code: name for name, command in p.COMMANDS.items()}
        status = replace(STATUS, dark=self.dark, light_id=self.lights)
        records: dict[str, Record] = {"CLOCK": CLOCK, "STATUS": status}
        if names[request.type] != "SET_LEDS":
            return packet(request.type | p.REPLY, request.sequence, records.get(names[request.type], p.Empty()))
        self.lights, self.dark = self.lights + 1, Dark.NOT_DARK
        latched = replace(LIGHT, light_id=self.lights)
        reply = p.LightReply(light_id=self.lights, current_ma=100, scale=p.FULL_SCALE)
        told = b"" if self._mute else packet(p.EVENTS["LIGHT"][0], 0, latched, reply=False)
        return packet(request.type | p.REPLY, request.sequence, reply) + told


def test_a_sequence_that_begins_before_a_dark_light_is_lit_again_is_not_taken_for_dark() -> None:
    """Frames were waited for until the sensor was opened anew, as long as the board told of no other light."""
    board = ForgettingBoard()
    ring = LightRing(board, keep_alive_s=None)
    ring.light(np.full((12, 3), 50, np.uint8))
    board.put(packet(p.EVENTS["DARK"][0], 0, p.DarkEvent(0, 0, Dark.HOST_SILENT), reply=False))
    ring.clock()
    assert ring.lit_since_s() == np.inf
    ring.start()
    ring._light_again()
    assert np.isfinite(ring.lit_since_s())
    assert board.lights == 1, "the still light is not shown in the midst of the sequence"


def test_a_light_whose_event_was_lost_is_known_by_the_status_while_it_shines() -> None:
    board = ForgettingBoard(mute=True)
    ring = LightRing(board, keep_alive_s=None)
    assert ring.light(np.full((12, 3), 50, np.uint8)) == 1
    assert np.isfinite(ring.lit_since_s())
    ring = LightRing(board, keep_alive_s=None)
    ring.status = lambda: replace(STATUS, dark=Dark.FAULT, light_id=board.lights)  # type: ignore[method-assign]
    with pytest.raises(BoardError, match=r"light 2 was not latched within"):
        ring.light(np.full((12, 3), 50, np.uint8), timeout_s=1.1)
    assert ring.lit_s == -np.inf


@pytest.mark.parametrize("lost_by", ["silence", "damage"])
def test_a_dark_board_whose_event_was_lost_is_found_out_and_lit_again(lost_by: str) -> None:
    """A board heard nothing for a second, ended its light, and answered just when the host tried for the last time."""
    board = ForgettingBoard()
    ring = LightRing(board, keep_alive_s=None)
    ring.light(np.full((12, 3), 50, np.uint8))
    assert np.isfinite(ring.lit_since_s())
    board.dark = Dark.HOST_SILENT
    if lost_by == "damage":
        board.put(b"\x05rubbish\0")
        ring.clock()
    else:
        ring._heard_s -= 2
    assert ring.lit_since_s() == np.inf
    assert [event.dark for event in ring.events if isinstance(event, p.DarkEvent)] == [Dark.HOST_SILENT]
    ring._light_again()
    assert (board.lights, np.isfinite(ring.lit_since_s())) == (2, True)
