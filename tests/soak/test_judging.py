"""The judge of a soak notices everything that it is there for: each fault is planted."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from gellight.frames.frames import CameraFrame, LightLabel, LightState
from gellight.frames.pixel_grid import block_means
from gellight.lab.simulator.scene import Press
from tests.soak.hardware import Exposure
from tests.soak.judging import Holdings, Invariant, Judge, handle_growth, memory_growth_mb
from tests.soak.pressed_gel import ROWS, marked, place_px, read_number
from tests.soak.working import Work, judge_circle

GREY = np.full((120, 160, 3), 90, np.uint8)
GROUPS = np.zeros((2, 12, 3), np.uint8)
GROUPS[0, ::2], GROUPS[1, 1::2] = 200, 200


def exposure(number: int, *lights: np.ndarray) -> Exposure:
    return Exposure(number, number / 30, np.stack(lights or (GROUPS[0],)))


def judge_of(*exposures: Exposure) -> Judge:
    known = {each.number: each for each in exposures}
    return Judge(SimpleNamespace(exposure=known.get))  # type: ignore[arg-type]


def shown(number: int, **changes: object) -> CameraFrame:
    frame = CameraFrame(image=marked(GREY, number), time_s=number / 30, sequence=number)
    return replace(frame, **changes)


def broken(judge: Judge) -> list[Invariant]:
    return [violation.invariant for violation in judge.violations]


def see(judge: Judge, *frames: CameraFrame) -> list[Invariant]:
    for frame in frames:
        judge.frame(frame, light=GROUPS[0], groups=None)
    return broken(judge)


def test_sound_frames_are_sound() -> None:
    judge = judge_of(exposure(1), exposure(2))
    assert see(judge, shown(1), shown(2)) == []
    assert judge.newest_start_s == 2 / 30


@pytest.mark.parametrize(
    ("second", "invariant"),
    [
        (shown(2, sequence=1), Invariant.FRESH),
        (shown(1, sequence=2), Invariant.FRESH),
        (shown(2, time_s=2 / 30 + 0.004), Invariant.FRESH),
        (shown(9), Invariant.WHOLE),
        (shown(2, image=np.vstack([shown(1).image[:48], shown(2).image[48:]])), Invariant.WHOLE),
    ],
    ids=["number again", "picture again", "newer than it is", "never taken", "torn"],
)
def test_a_frame_that_is_not_what_it_says_is_noticed(second: CameraFrame, invariant: Invariant) -> None:
    judge = judge_of(exposure(1), exposure(2))
    assert see(judge, shown(1), second) == [invariant]
    assert judge.newest_start_s == 1 / 30, "it is no recovery"


@pytest.mark.parametrize("lights", [(GROUPS[1],), (GROUPS[0], 0 * GROUPS[0])], ids=["another light", "dark half way"])
def test_a_frame_under_another_light_is_noticed(lights: tuple[np.ndarray, ...]) -> None:
    assert see(judge_of(exposure(1, *lights)), shown(1)) == [Invariant.LIGHT]


def test_a_wrong_label_is_noticed() -> None:
    clean = LightLabel(state=LightState.CLEAN, group=0)
    judge = judge_of(exposure(1, GROUPS[0]), exposure(2, GROUPS[1]), exposure(3, *GROUPS))
    for number in range(1, 4):
        judge.frame(shown(number, label=clean), light=None, groups=GROUPS)
    assert broken(judge) == [Invariant.LABEL, Invariant.LABEL]
    assert judge.labels == 3
    assert judge.judged[Invariant.LABEL] == 3


def test_what_was_never_looked_at_is_named() -> None:
    judge = judge_of(exposure(1))
    assert judge.not_judged() == list(Invariant)
    see(judge, shown(1))
    assert set(Invariant) - set(judge.not_judged()) == {Invariant.WHOLE, Invariant.FRESH, Invariant.LIGHT}


@pytest.mark.parametrize("number", [0, 1, 77_777, 2**32 - 1])
def test_a_number_is_read_from_a_picture_that_looks_untouched(number: int) -> None:
    rows, columns = np.indices(GREY.shape[:2])
    slope = np.clip(GREY + (rows / 4 - columns / 5)[..., None], 0, 255).astype(np.uint8)
    noisy = slope + np.random.default_rng(1).integers(0, 3, slope.shape, np.uint8)
    for image in (GREY, 0 * GREY, noisy):
        assert read_number(marked(image, number)) == number
    seen, other = (block_means(marked(GREY, each).astype(np.float32), ROWS) for each in (number, 5))
    assert np.array_equal(seen, other), "who looks at blocks sees the same"


PRESS = Press("BALL", 1.0, 3.0, -2.0)


@pytest.mark.parametrize(("off_px", "held"), [(0.0, True), (3.0, False)])
def test_a_calibration_whose_circles_lie_beside_the_ball_is_noticed(off_px: float, held: bool) -> None:
    judge, work = judge_of(), Work()
    x, y = place_px(PRESS)
    judge_circle(judge, work, {"number": 1, "center_x_px": x, "center_y_px": y + off_px}, PRESS)
    assert broken(judge) == ([] if held else [Invariant.CALIBRATION])
    assert work.worst_circle_px == pytest.approx(off_px)


def holdings(*memory_mb: float) -> list[Holdings]:
    return [Holdings(float(k), mb, files=20, threads=("main", "zenoh"), children=2) for k, mb in enumerate(memory_mb)]


def test_a_leak_of_a_picture_a_frame_is_noticed_and_noise_is_not() -> None:
    noise = np.random.default_rng(0).normal(200, 1.0, 120)
    growth, allowed = memory_growth_mb(holdings(*noise))
    assert growth < allowed
    leak = 30 * 96 * 128 * 3 / 1e6  # MB in a second
    growth, allowed = memory_growth_mb(holdings(*(noise + leak * np.arange(120))))
    assert growth > allowed


def test_handles_that_stay_open_are_noticed() -> None:
    rests = holdings(*[200.0] * 5)
    assert handle_growth(rests) == {}
    assert handle_growth([*rests, replace(rests[0], files=21, children=3)]) == {"files": 1, "children": 1}
    left = replace(rests[0], threads=("main", "zenoh", "capture", "capture"))
    assert handle_growth([rests[0], replace(left, threads=("main", "capture")), left]) == {"thread capture": 1}


@pytest.mark.parametrize(
    ("poses", "held"),
    [([(0, 3, 5), (0, 3, 6), (1, 7, 7)], True), ([(0, 6, 5)], False), ([(1, 3, 5), (0, 3, 6)], False)],
    ids=["one object and the next", "of a frame to come", "an earlier object again"],
)
def test_a_pose_is_of_an_object_that_was_touched_before(poses: list[tuple[int, int, int]], held: bool) -> None:
    """Each is (object, frame of its first touch, frame)."""
    judge = judge_of()
    judge.pose(1, None)
    assert not judge.judged[Invariant.POSE], "a frame without one says nothing"
    for number, since, sequence in poses:
        judge.pose(sequence, SimpleNamespace(number=number, since_sequence=since))  # type: ignore[arg-type]
    assert broken(judge) == ([] if held else [Invariant.POSE])
    judge.begin_stream()
    judge.pose(0, SimpleNamespace(number=0, since_sequence=0))  # type: ignore[arg-type]
    assert len(broken(judge)) == (0 if held else 1)
