"""The portable core on a virtual clock: commands, sequences, safety, configuration, faults."""

import zlib

import pytest

from gellight.ring import protocol as p
from gellight.ring.enumerations import Dark, Status, SyncMode
from gellight.ring.wire import Packet, encode
from tests.firmware.helpers.virtual_board import BLACK, BLUE, GREEN, RED, VirtualBoard

WIRE_US, LATCH_US = 360, 300
TWO_STEPS = [p.SetStep(0, 0, 1, 10_000, 0), p.SetStep(1, 1, 1, 10_000, 0)]
BY_EDGES = [p.SetStep(0, 0, 1, 0, 0), p.SetStep(1, 1, 1, 0, 0)]


def keep_alive(core: VirtualBoard, duration_us: int) -> None:
    while duration_us > 0:
        core.advance(min(duration_us, 500_000))
        core.ok("CLOCK", p.ClockRequest(0))
        duration_us -= 500_000


# ---- life ----


def test_the_first_light_is_darkness(core: VirtualBoard) -> None:
    assert core.lights()[0] == (0, WIRE_US + LATCH_US, BLACK)


def test_hello_names_the_schema(core: VirtualBoard) -> None:
    hello = core.ok("HELLO")
    assert hello.schema_crc == p.schema_crc()
    assert (hello.led_count, hello.group_count, hello.step_count) == (12, 16, 32)


def test_the_clock_answers_with_both_times(core: VirtualBoard) -> None:
    core.advance(1234)
    reply = core.ok("CLOCK", p.ClockRequest(2**64 - 1))
    assert reply.host_us == 2**64 - 1
    assert reply.received_us == reply.sent_us == core.now_us


def test_colours_reach_the_leds_and_an_event_says_when(core: VirtualBoard) -> None:
    reply = core.ok("SET_LEDS", p.SetLeds(bytes(range(36))))
    start = core.now_us
    core.advance(1000)
    assert core.lights()[-1] == (start, start + WIRE_US + LATCH_US, bytes(range(36)))
    events = [p.LightEvent.unpack(packet.payload) for packet in core.collect() if packet.type == 0x40]
    assert [(e.light_id, e.first_bit_us) for e in events] == [(reply.light_id, start)]


# ---- requests ----


def test_a_repeated_request_is_answered_but_not_executed_again(core: VirtualBoard) -> None:
    first = core.ask("SET_LEDS", p.SetLeds(RED), sequence=9)
    assert core.ask("SET_LEDS", p.SetLeds(RED), sequence=9) == first
    assert core.ok("COUNTERS").repeated == 1
    assert core.ask("SET_LEDS", p.SetLeds(RED), sequence=10) != first


def test_hello_never_comes_from_the_cache(core: VirtualBoard) -> None:
    core.ask("HELLO", sequence=1)
    core.ask("HELLO", sequence=1)
    assert core.ok("COUNTERS").repeated == 0


@pytest.mark.parametrize(
    ("name", "record", "expected", "value"),
    [
        ("SET_GROUP", p.SetGroup(16, BLACK), Status.OUT_OF_RANGE, 16),
        ("SET_STEP", p.SetStep(32, 0, 1, 0, 0), Status.OUT_OF_RANGE, 32),
        ("SET_STEP", p.SetStep(0, 16, 1, 0, 0), Status.OUT_OF_RANGE, 16),
        ("SET_STEP", p.SetStep(0, 0, 0, 0, 0), Status.OUT_OF_RANGE, 0),
        ("SET_STEP", p.SetStep(0, 0, 1, 999, 0), Status.OUT_OF_RANGE, 999),
        ("SET_STEP", p.SetStep(0, 0, 1, 0, 60_000_001), Status.OUT_OF_RANGE, 60_000_001),
        ("SET_SYNC", p.SetSync(3, 0, 1, 0, 0), Status.OUT_OF_RANGE, 3),
        ("SET_SYNC", p.SetSync(0, 0, 0, 0, 0), Status.OUT_OF_RANGE, 0),
        ("COMMIT", p.Commit(0, 0, 0), Status.OUT_OF_RANGE, 0),
        ("COMMIT", p.Commit(0, 0, 33), Status.OUT_OF_RANGE, 33),
        ("RESET", p.Magic(1), Status.BAD_MAGIC, 1),
        ("BOOTLOADER", p.Magic(0), Status.BAD_MAGIC, 0),
        ("STOP", None, Status.NOT_RUNNING, 0),
        ("START", None, Status.NOT_RUNNING, 0),
        ("TRIM", p.Trim(0, 0), Status.NOT_RUNNING, 0),
    ],
)
def test_what_cannot_be_is_refused_with_its_value(
    core: VirtualBoard, name: str, record: p.Record | None, expected: Status, value: int
) -> None:
    got, said, _ = core.ask(name, record)
    assert (got, said) == (expected, value)
    assert core.ok("COUNTERS").refused == 1


def test_unknown_commands_and_wrong_lengths_are_counted(core: VirtualBoard) -> None:
    core.receive(encode(Packet(0x3F, 1, b"")))
    core.receive(encode(Packet(p.COMMANDS["SET_LEDS"].code, 2, b"short")))
    answers = core.collect()
    assert [(a.payload[0], a.payload[1]) for a in answers] == [(Status.UNKNOWN_COMMAND, 0x3F), (Status.BAD_LENGTH, 5)]
    counted = core.ok("COUNTERS")
    assert (counted.unknown_command, counted.bad_length) == (1, 1)


def test_a_commit_with_another_table_is_noticed(core: VirtualBoard) -> None:
    core.ok("SET_STEP", p.SetStep(0, 0, 1, 5000, 0))
    status_, value, _ = core.ask("COMMIT", p.Commit(12345, 0, 1))
    assert status_ == Status.CHECKSUM
    assert value == zlib.crc32(BLACK * 16 + p.SetStep(0, 0, 1, 5000, 0).pack())


# ---- current ----


def test_the_paper_ring_fits_the_limit(core: VirtualBoard) -> None:
    one_colour_each = b"".join(bytes([255 * (i // 4 == c) for c in range(3)]) for i in range(12))
    reply = core.ok("SET_LEDS", p.SetLeds(one_colour_each))
    assert reply.current_ma == 252


# ---- sequences ----


def test_free_steps_fall_on_their_microsecond(core: VirtualBoard) -> None:
    core.play([RED, GREEN], [p.SetStep(0, 0, 2, 3000, 2500), p.SetStep(1, 1, 1, 5000, 0)], loops=2)
    start = core.now_us + 2000
    core.advance(60_000)
    pass_ = [(0, RED), (3000, BLACK), (5500, RED), (8500, BLACK), (11_000, GREEN)]
    expected = [(start + at + 16_000 * k, colours) for k in range(2) for at, colours in pass_]
    expected.append((start + 32_000, BLACK))
    assert [(at, colours) for at, _, colours in core.lights()[1:]] == expected
    assert core.status().dark == Dark.SEQUENCE_ENDED
    assert core.ok("COUNTERS").late_steps == 0


def test_trim_shifts_once_and_stretches_without_drift(core: VirtualBoard) -> None:
    core.play([RED, GREEN], TWO_STEPS)
    start = core.now_us + 2000
    core.ok("TRIM", p.Trim(250, round(3.3e-5 * 2**32)))
    for _ in range(10):
        core.advance(200_000)
        core.ok("CLOCK", p.ClockRequest(0))
    times = [at for at, _, _ in core.lights()[1:]]
    assert times[0] in (start, start + 250)  # the first step may have been planned before the trim came
    for k, at in enumerate(times[1:], start=1):
        assert abs(at - (start + 250 + k * 10_000.33)) <= 2
    assert len(times) > 190


@pytest.mark.parametrize("phases", [(700, 300), (1000, 0), (60_000_000, 1), (-60_000_000, -1), (0, -(2**31))])
def test_trims_within_a_step_add_up_to_a_minute(core: VirtualBoard, phases: tuple[int, int]) -> None:
    core.play([RED], [p.SetStep(0, 0, 1, 100_000, 0)])
    core.advance(50_000)
    taken = [core.ask("TRIM", p.Trim(phase, 0))[0] for phase in phases]
    assert taken == [Status.OK, Status.OK if sum(phases) == 1000 else Status.OUT_OF_RANGE]
    if sum(phases) == 1000:
        core.advance(300_000)
        times = [at for at, _, _ in core.lights()[1:]]
        assert times[-1] - times[0] == (len(times) - 1) * 100_000 + 1000


def test_the_trigger_lights_after_its_delay_at_every_nth_edge(core: VirtualBoard) -> None:
    steps = [p.SetStep(k, k, 1, 2000, 0) for k in range(2)]
    core.play([RED, GREEN], steps, mode=SyncMode.EXT, divider=2, delay_us=750)
    edges = []
    for number in range(8):
        core.advance(10_000)
        core.edge()
        core.edge(falling=True)  # the other edge does not count
        if number % 2:
            edges.append(core.now_us)
    core.advance(10_000)
    lit = [(at, colours) for at, _, colours in core.lights()[1:] if colours != BLACK]
    assert lit == [(edge + 750, (RED, GREEN)[k % 2]) for k, edge in enumerate(edges)]
    assert core.ok("COUNTERS").triggers == 4
    assert core.ok("COUNTERS").triggers_missed == 0


def test_without_a_trigger_the_ring_is_dark_until_the_next_one(core: VirtualBoard) -> None:
    core.play([RED, GREEN], BY_EDGES, mode=SyncMode.EXT, timeout_us=50_000)
    core.edge()
    core.advance(40_000)
    assert core.light == RED
    core.advance(40_000)
    assert core.light == BLACK
    assert core.ok("COUNTERS").trigger_timeouts == 1
    assert core.status().dark == Dark.TRIGGER_MISSED
    core.edge()
    core.advance(2000)
    assert core.light == GREEN


@pytest.mark.parametrize("divider", [1, 2])
@pytest.mark.parametrize("reads", range(1, 8))
def test_an_edge_at_any_look_at_the_clock_is_no_timeout(core: VirtualBoard, reads: int, divider: int) -> None:
    """Whether it lights the next step or is only the first of two."""
    core.play([RED, GREEN], BY_EDGES, mode=SyncMode.EXT, divider=divider, timeout_us=50_000, delay_us=300)
    for _ in range(divider):
        core.edge()
    core.advance(20_000)
    core.edge_after_reads(reads)
    core.advance(30_000)
    core.edge_after_reads(0)
    assert core.light == (GREEN if divider == 1 else RED)
    assert core.ok("COUNTERS").trigger_timeouts == 0


def test_a_commit_while_running_waits_for_the_end_of_the_pass(core: VirtualBoard) -> None:
    core.play([RED, GREEN], [*TWO_STEPS, p.SetStep(2, 0, 1, 10_000, 0)])
    core.advance(3000)
    core.load_sequence([BLUE], [p.SetStep(0, 0, 1, 5000, 0)])
    core.advance(40_000)
    assert [colours for _, _, colours in core.lights()[1:6]] == [RED, GREEN, RED, BLUE, BLUE]


def test_a_light_is_refused_while_a_sequence_runs(core: VirtualBoard) -> None:
    core.play([RED], [p.SetStep(0, 0, 1, 10_000, 0)])
    for name, record in (("SET_LEDS", p.SetLeds(RED)), ("START", None), ("SAVE_CONFIG", None),
                         ("SELFTEST", None)):  # fmt: skip
        assert core.ask(name, record)[0] == Status.BUSY


def test_stop_leaves_the_light_and_blank_takes_it(core: VirtualBoard) -> None:
    core.play([RED], [p.SetStep(0, 0, 1, 10_000, 0)])
    core.advance(5000)
    core.ok("STOP")
    core.advance(100_000)
    assert core.light == RED
    core.ok("BLANK")
    core.advance(2000)
    assert core.light == BLACK


# ---- safety ----


def test_a_silent_host_leaves_the_leds_dark_after_a_second(core: VirtualBoard) -> None:
    core.ok("SET_LEDS", p.SetLeds(RED))
    heard = core.now_us
    core.advance(990_000)
    assert core.light == RED
    core.advance(3_000_000)
    at, _, colours = core.lights()[-1]
    assert colours == BLACK
    assert 1_000_000 < at - heard <= 1_010_000
    assert core.ok("COUNTERS").dark_faults == 1
    assert any(packet.type == 0x41 for packet in core.packets)


def test_a_sequence_dies_with_its_host(core: VirtualBoard) -> None:
    core.play([RED, GREEN], TWO_STEPS)
    keep_alive(core, 3_000_000)
    assert core.status().state == 1
    core.advance(1_100_000)
    count = len(core.lights())
    core.advance(1_000_000)
    assert len(core.lights()) == count
    assert core.light == BLACK


@pytest.mark.parametrize("reason", [Dark.PORT_CLOSED, Dark.SUSPENDED])
def test_a_closed_port_darkens_at_once(core: VirtualBoard, reason: Dark) -> None:
    core.ok("SET_LEDS", p.SetLeds(RED))
    core.advance(5000)
    core.link(False, reason)
    core.advance(700)
    assert core.light == BLACK
    core.link(True)
    assert core.status().dark == reason


def test_rubbish_is_counted_and_the_next_packet_is_heard(core: VirtualBoard) -> None:
    good = encode(Packet(p.COMMANDS["STATUS"].code, 1, b""))
    core.receive(b"\x05\x01\0" + b"\x01" * 300 + b"\0" + bytes([good[0], good[1] ^ 1]) + good[2:] + good)
    assert len(core.collect()) == 1
    counted = core.ok("COUNTERS")
    assert (counted.bad_framing, counted.oversize, counted.bad_crc) == (1, 1, 1)


def test_a_deaf_host_costs_replies_but_nothing_hangs(core: VirtualBoard) -> None:
    core.faults(room=0)
    for sequence in range(100):
        core.receive(encode(Packet(p.COMMANDS["SET_LEDS"].code, sequence, RED)))
        core.advance(1000)
    core.faults()
    counted = core.ok("COUNTERS")
    assert counted.replies_dropped == 100
    assert counted.events_dropped >= 90


def test_a_backlog_of_events_leaves_room_for_a_reply(core: VirtualBoard) -> None:
    """The host takes nothing for a while: events are dropped, the reply that it waits for is not."""
    core.play([RED], [p.SetStep(0, 0, 1, p.DWELL_MIN_US, 0)])
    core.faults(room=1000)
    core.advance(2_000_000)
    assert core.ask("CLOCK", p.ClockRequest(0))[0] == Status.OK
    core.faults()
    counted = core.ok("COUNTERS")
    assert counted.events_dropped > 100
    assert counted.replies_dropped == 0
