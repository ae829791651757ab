"""No mixed frame is ever called clean: labels against the truth, in worlds that are drawn at random."""

import numpy as np
import pytest

from gellight.frames import LightLabel, LightState
from gellight.lighting.label import MIXED, UNKNOWN, label_of
from gellight.lighting.timeline import OTHER
from tests.host.lighting.light_world import World, compare

Counts = dict[tuple[str, str], int]
MIXED_FRAMES = 10_000


@pytest.fixture(scope="module")
def anything() -> Counts:
    """Any phase, exposure, readout, jitter, drops, PWM phase, clock, hold; lost events, torn lights, stalled clocks."""
    return compare(600, seed=11)


def total(counts: Counts, truth: str) -> int:
    return sum(count for (what, _), count in counts.items() if what == truth)


def test_of_ten_thousand_mixed_frames_none_is_called_clean(anything: Counts) -> None:
    assert total(anything, "mixed") >= MIXED_FRAMES
    assert anything.get(("mixed", "clean"), 0) == 0


def test_no_clean_frame_gets_the_wrong_group_or_is_called_mixed(anything: Counts) -> None:
    assert total(anything, "clean") > 5_000
    assert anything.get(("clean", "wrong group"), 0) == 0
    assert anything.get(("clean", "mixed"), 0) == 0


def test_frames_in_the_dark_have_no_group(anything: Counts) -> None:
    assert total(anything, "dark") > 0
    assert anything.get(("dark", "clean"), 0) == 0


def test_a_camera_as_it_is_used_gets_nine_of_ten_clean_frames() -> None:
    counts = compare(60, seed=12, typical=True)
    assert counts["clean", "clean"] > 0.88 * total(counts, "clean")
    assert counts.get(("mixed", "clean"), 0) == 0


def test_the_proof_would_fail_if_the_pulses_were_forgotten(monkeypatch: pytest.MonkeyPatch) -> None:
    """The truth is sharp enough to see a single pulse: without the settle time it finds mixed frames called clean."""
    draw = World._draw_camera

    def forgetful(world: World) -> None:
        draw(world)
        object.__setattr__(world.timing, "pulse_period_s", 0.0)

    monkeypatch.setattr(World, "_draw_camera", forgetful)
    assert compare(150, seed=11).get(("mixed", "clean"), 0) > 0


@pytest.mark.parametrize(
    ("rows", "seen", "state", "group"),
    [
        ([2, 2, 2], {2}, LightState.CLEAN, 2),
        ([2, 2, UNKNOWN], {2}, LightState.UNKNOWN, None),
        ([2, MIXED, 3], {2, 3}, LightState.MIXED, None),
        ([2, UNKNOWN, 3], set(), LightState.MIXED, None),
        ([UNKNOWN, UNKNOWN], {2, 3}, LightState.MIXED, None),
        ([OTHER, OTHER], {OTHER}, LightState.UNKNOWN, None),
        ([OTHER, 1], set(), LightState.MIXED, None),
    ],
)
def test_rows_sum_up_to_a_frame(rows: list[int], seen: set[int], state: LightState, group: int | None) -> None:
    assert label_of(np.array(rows), seen) == LightLabel(state=state, group=group)
