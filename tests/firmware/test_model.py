"""The C core and the Python model get the same random stories and have to give the same answers and the same lights."""

import ctypes
import struct

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from gellight.ring import protocol as p
from gellight.ring.enumerations import SyncMode
from tests.firmware.helpers.core_model import BLACK, CoreModel
from tests.firmware.helpers.virtual_board import VirtualBoard

PAUSE_US = 1_700
levels = st.sampled_from([0, 1, 40, 155, 200, 255])
colours = st.one_of(
    levels.map(lambda value: bytes([value] * 36)),
    st.binary(min_size=36, max_size=36),
    st.lists(levels, min_size=36, max_size=36).map(bytes),
)
durations = st.sampled_from([0, 0, p.DWELL_MIN_US, 2501, 7001, 30_011, p.DWELL_MIN_US - 1, 60_000_001])
stories = st.lists(
    st.one_of(
        st.tuples(st.just("advance"), st.sampled_from([0, 1, 900, 5000, 20_000, 100_003])),
        st.tuples(st.just("SET_LEDS"), colours.map(p.SetLeds)),
        st.tuples(st.just("SET_GROUP"), st.builds(p.SetGroup, st.integers(0, 17), colours)),
        st.tuples(
            st.just("SET_STEP"),
            st.builds(p.SetStep, st.integers(0, 4), st.integers(0, 3), st.integers(0, 3), durations, durations),
        ),
        st.tuples(st.just("COMMIT"), st.tuples(st.integers(0, 5), st.integers(0, 3), st.booleans())),
        st.tuples(st.just("SET_SYNC"), st.sampled_from([0, 0, 1, 3]).map(lambda mode: p.SetSync(mode, 0, 1, 0, 0))),
        st.tuples(st.sampled_from(["START", "START", "STOP", "BLANK"]), st.just(p.Empty())),
    ),
    max_size=40,
)  # fmt: skip


def prepared(count: int) -> list[tuple[str, object]]:
    """A beginning that makes a sequence likely to run."""
    steps = [
        ("SET_STEP", p.SetStep(i, i % 3, 1 + i % 2, (p.DWELL_MIN_US, 2501, 7001)[i % 3], (0, p.DWELL_MIN_US, 0)[i % 3]))
        for i in range(count)
    ]
    groups = [("SET_GROUP", p.SetGroup(i, bytes([50 * (i + 1)] + [0] * 35))) for i in range(3)]
    return [*groups, *steps, ("COMMIT", (count, 0, False))]


@settings(max_examples=300, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.integers(0, 5), stories)
def test_core_and_model_agree(core_library: ctypes.CDLL, count: int, story: list[tuple[str, object]]) -> None:
    board = VirtualBoard(core_library)
    try:
        follow(board, CoreModel(board.now_us), [*(prepared(count) if count else []), *story])
    finally:
        board.close()


def test_the_beginning_of_a_story_lets_a_sequence_run(core: VirtualBoard) -> None:
    """Or the stories would agree about refusals only."""
    model = CoreModel(core.now_us)
    start = [("SET_SYNC", p.SetSync(SyncMode.FREE, 0, 1, 0, 0)), ("START", p.Empty()), ("advance", 100_003)]
    follow(core, model, [*prepared(5), *start])
    assert len(model.lights) > 20


def follow(board: VirtualBoard, model: CoreModel, story: list[tuple[str, object]]) -> None:
    seen = len(board.lights())
    for name, what in story:
        if name == "advance":
            board.advance(what)
            model.advance(what)
            continue
        if name == "COMMIT":
            if model.running:
                continue  # which pass a late commit joins depends on how far ahead the core has planned
            steps, loops, wrong = what
            what = p.Commit(model.table_crc(min(steps, 32)) ^ wrong, loops, steps)
        status, value, payload = board.ask(name, None if what == p.Empty() else what)
        expected = model.ask(name, what)
        assert (status, value) == expected[:2], name
        if status == 0 and expected[2]:
            current_ma, scale = expected[2]
            assert struct.unpack("<HH", payload[-4:]) == (current_ma, scale)
        if not (model.running and model.mode == SyncMode.FREE):
            board.advance(PAUSE_US)
            model.advance(PAUSE_US)
    board.ask("BLANK")
    model.ask("BLANK", p.Empty())
    board.advance(PAUSE_US)
    model.advance(PAUSE_US)
    lights = [(at, shown) for at, _, shown in board.lights()[seen:]]
    assert lights == model.lights
    assert lights[-1][1] == BLACK
