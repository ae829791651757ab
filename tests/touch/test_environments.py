"""Environments of Gymnasium: what its checker asks, the same bytes for a seed, tasks to be done; two in processes."""

from functools import partial
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AsyncVectorEnv, SyncVectorEnv

from gellight.base.errors import InputError
from gellight_touch import TouchSensor
from gellight_touch.environments import InsertPeg, Lift, PressAndTell, SlideToEdge
from sim_reference.geometry import SensorGeometry
from tests.benchmarks import touch_tasks

SMALL = SensorGeometry(image_width_px=64, image_height_px=48, pixel_size_mm=0.588)
COARSE = partial(TouchSensor, SMALL, size=72, extent_mm=72.0)
ALL = ("depth", "wrench", "contact", "picture")
MAKE = partial(PressAndTell, sensor=partial(TouchSensor, size=16), observe=("depth", "wrench"), render_mode="rgb_array")


def tell(**how: Any) -> PressAndTell:
    return PressAndTell(("BALL", "TSTEP", "WAVE"), sensor=COARSE, **how)


@pytest.mark.nightly
@pytest.mark.filterwarnings("error::UserWarning")
@pytest.mark.parametrize(
    ("name", "how"),
    [
        ("PressAndTell", {"sensor": COARSE, "observe": ALL}),
        ("SlideToEdge", {"sensor": COARSE, "observe": ALL}),
        ("InsertPeg", {"sensor": COARSE, "observe": ALL}),
        ("Lift", {}),
    ],
)
def test_the_checker_of_gymnasium_finds_nothing(name: str, how: dict[str, Any]) -> None:
    check_env(gymnasium.make(f"gellight/{name}-v0", render_mode="rgb_array", **how).unwrapped)


def test_they_can_be_made_by_name_and_side_by_side() -> None:
    assert isinstance(gymnasium.make("gellight/Lift-v0").unwrapped, Lift)
    for name in ("PressAndTell", "SlideToEdge", "InsertPeg"):
        several = gymnasium.make_vec(f"gellight/{name}-v0", num_envs=2, vectorization_mode="sync")
        seen, _ = several.reset(seed=3)
        assert seen["depth"].shape == (2, 32, 32)
        assert not np.array_equal(*seen["depth"])
        several.close()


MOVES = [np.array([1, 0.5, 0]), np.array([0.2, 0, 1])]


@pytest.mark.parametrize(("make", "actions"), [(tell, [0, 2, 1]), (SlideToEdge, MOVES), (InsertPeg, MOVES)])
def test_the_same_seed_and_actions_give_the_same_bytes(make: Any, actions: list[Any]) -> None:
    def bytes_of(env: Any, seed: int) -> bytes:
        seen = [env.reset(seed=seed)[0], *(env.step(action)[0] for action in actions)]
        return b"".join(part.tobytes() for one in seen for part in one.values())

    used, fresh = (make(observe=ALL, **({} if make is tell else {"sensor": COARSE})) for _ in range(2))
    bytes_of(used, 5)
    assert bytes_of(used, 1) == bytes_of(fresh, 1) != bytes_of(used, 2)


@pytest.mark.parametrize("name", touch_tasks.TASKS)
def test_touch_does_the_task_far_more_often(name: str) -> None:
    assert touch_tasks.share(name, touch=True, seeds=12) > 0.9
    assert touch_tasks.share(name, touch=False, seeds=12) < 0.6


def test_saying_that_the_edge_is_there_ends_the_episode() -> None:
    env = SlideToEdge(("wrench",))
    _, told = env.reset(seed=1)
    assert env.step(np.array([0, 0, 1.0]))[1:4] == (-1.0, True, False)
    env.reset(seed=1)
    way = np.array([np.cos(told["turn_rad"]), np.sin(told["turn_rad"]), 0])
    for _ in range(int(told["away_mm"] / 2)):
        assert env.step(way)[1:4] == (-0.01, False, False)
    left = env.step(way * (told["away_mm"] / 2 % 1))[4]["away_mm"]
    assert left == pytest.approx(0, abs=1e-6)
    assert env.step(np.array([0, 0, 1.0]))[1:3] == (1.0, True)


@pytest.mark.parametrize(("away_mm", "reward"), [(0.49, 1.0), (-0.49, 1.0), (0.51, -1.0), (-0.51, -1.0)])
def test_an_edge_half_a_millimetre_from_the_middle_is_there(away_mm: float, reward: float) -> None:
    env = SlideToEdge(("wrench",), sensor=COARSE)
    env.reset(seed=1)
    env._away_mm = away_mm
    assert env.step(np.array([0, 0, 0.1]))[1:3] == (reward, True)


def test_edges_begin_4_to_16_mm_away_and_within_30_degrees() -> None:
    env = SlideToEdge(("wrench",), sensor=COARSE)
    told = [env.reset(seed=seed)[1] for seed in range(60)]
    away, turned = (np.array([one[name] for one in told]) for name in ("away_mm", "turn_rad"))
    assert 4 < away.min() < 5
    assert 15 < away.max() < 16
    assert 28 < np.degrees(np.abs(turned)).max() < 30


@pytest.mark.parametrize("make", [SlideToEdge, InsertPeg])
def test_an_episode_has_thirty_steps(make: Any) -> None:
    env = make(("wrench",), sensor=COARSE)
    env.reset(seed=1)
    assert [env.step(np.zeros(3))[3] for _ in range(30)] == [False] * 29 + [True]


def test_nothing_is_moved_out_of_reach() -> None:
    press, peg = PressAndTell(("BALL", "TSTEP"), ("wrench",), sensor=COARSE), InsertPeg(("wrench",), sensor=COARSE)
    press.reset(seed=1)
    assert [press.step(0)[4]["place_mm"][0] for _ in range(7)][-1] == 8.0
    peg.reset(seed=1)
    hands = np.array([peg.step(np.array([1.0, -1.0, 0.0]))[0]["hand"] for _ in range(9)])
    assert hands[0, :2] == pytest.approx([1.0, np.radians(-4)])
    assert hands[-1, :2] == pytest.approx([8.0, np.radians(-20)])


def test_a_straight_peg_over_the_slot_goes_in_and_one_beside_it_tips_in_the_gels() -> None:
    env = InsertPeg(("depth",))
    for miss_mm in (0.0, 0.8, -0.8):
        seen, told = env.reset(seed=3)
        wanted = np.array([told["slot_mm"] - told["aside_mm"] + miss_mm, -told["tilt_rad"]])
        while np.abs(way := (wanted - seen["hand"][:2]) / [1.0, np.radians(4)]).max() > 1e-3:
            seen, *_ = env.step(np.array([*np.clip(way, -1, 1), 0]))
        before = touch_tasks.held(seen["depth"])[1]
        assert before == pytest.approx(told["tilt_rad"], abs=2e-3)
        seen, reward, done, _, told = env.step(np.array([0, 0, 1.0]))
        assert (done, told["inserted"]) == ((miss_mm == 0),) * 2
        if miss_mm:
            assert np.sign(touch_tasks.held(seen["depth"])[1] - before) == -np.sign(miss_mm)
            assert reward == -0.01
    assert [env.step(np.array([0, 0, 1.0]))[1:3] for _ in range(3)][-1] == (-1.0, True)


def test_telling_ends_the_episode_and_pressing_costs() -> None:
    env = tell()
    _, told = env.reset(seed=1)
    assert env.step(0)[1:4] == (-0.02, False, False)
    names = ("BALL", "TSTEP", "WAVE")
    assert env.step(4 + names.index(told["object"]))[1:4] == (1.0, True, False)
    env.reset(seed=1)
    assert env.step(4 + (names.index(told["object"]) + 1) % 3)[1] == -1.0


def test_a_press_moves_the_object_under_the_gel() -> None:
    env = PressAndTell(("BALL", "SCROWN"), ("wrench",), sensor=COARSE)
    seen, told = next(
        (found for seed in range(20) if (found := env.reset(seed=seed))[1]["object"] == "BALL"), (None, None)
    )
    assert seen["wrench"][1:] == pytest.approx(told["place_mm"], abs=0.1)
    moved, *_ = env.step(0)
    assert moved["wrench"][1] - seen["wrench"][1] == pytest.approx(2.0, abs=0.1)
    assert moved["wrench"][0] == pytest.approx(seen["wrench"][0], rel=0.2)


def lifted(env: Lift, grip_n: float) -> tuple[float, dict[str, Any]]:
    """Grip as hard as asked, then lift; return the sum of rewards and the last info."""
    _, info = env.reset(seed=4)
    total, ended = 0.0, False
    while not ended:
        closing = np.sign(grip_n - info["grip_n"]) if abs(grip_n - info["grip_n"]) > 0.3 else 0.0
        _, reward, done, cut, info = env.step(np.array([closing, 0.0 if closing else 1.0]))
        total, ended = total + reward, done or cut
    return total, info


def test_a_firm_grip_lifts_and_a_soft_one_does_not() -> None:
    firm, info = lifted(Lift(("wrench",)), 4.0)
    assert info["height_mm"] > 20
    assert info["sticks"]
    needed_n = info["mass_kg"] * 9.81 / 2 / info["friction"]
    soft, info = lifted(Lift(("wrench",)), 0.5 * needed_n)
    assert info["height_mm"] < 10
    assert firm > 2.5 > 0 > soft


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: PressAndTell(("BALL",)), "choose two or more of BALL"),
        (lambda: PressAndTell(observe=("smell",)), "choose of depth, wrench, contact, picture"),
        (lambda: Lift(()), "choose of depth"),
        (lambda: SlideToEdge(depth_size=0), "depth_size 0: give the points"),
        (lambda: PressAndTell().step(15), "action 15: give 0 to 14"),
        (lambda: PressAndTell().step(-1), "action -1: give 0 to 14"),
    ],
)
def test_what_cannot_be_observed_or_pressed_is_said(make: Any, says: str) -> None:
    with pytest.raises(InputError, match=says):
        make()


@pytest.mark.parametrize(("make", "size"), [(SlideToEdge, 3), (InsertPeg, 3), (Lift, 2)])
def test_an_action_that_is_no_number_is_refused(make: Any, size: int) -> None:
    environment = make()
    environment.reset(seed=0)
    for action in (np.array([0.0] * (size - 1) + [np.nan], np.float32), np.zeros(size - 1)):
        with pytest.raises(InputError, match=rf"action \[.*\]: give {size} finite numbers, -1 to 1"):
            environment.step(action)


def test_two_processes_do_what_one_does() -> None:
    one, two = SyncVectorEnv([MAKE] * 2), AsyncVectorEnv([MAKE] * 2)
    np.testing.assert_equal(two.reset(seed=3), one.reset(seed=3))
    for _ in range(3):
        action = one.action_space.sample()
        np.testing.assert_equal(two.step(action), one.step(action))
    two.close()
