"""Worlds spread over processes do what they do in one."""

from functools import partial

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import SyncVectorEnv

from gellight.base.errors import InputError
from gellight.lab.touch import TouchSensor
from gellight.lab.touch.environments import PressAndTell
from gellight.lab.touch.environments.spread import SpreadVectorEnv

MAKE = partial(PressAndTell, sensor=partial(TouchSensor, size=16), observe=("depth", "wrench"), render_mode="rgb_array")


def test_two_processes_do_what_one_does_also_when_episodes_end() -> None:
    one, two = SyncVectorEnv([MAKE] * 4), SpreadVectorEnv([MAKE] * 4, processes=2)
    assert two.observation_space == one.observation_space
    assert two.action_space == one.action_space
    begun = [worlds.reset(seed=3) for worlds in (one, two)]
    np.testing.assert_equal(begun[1], begun[0])
    ended = 0
    for _ in range(6):
        action = one.action_space.sample()
        expected, found = one.step(action), two.step(action)
        np.testing.assert_equal(found, expected)
        ended += int(expected[2].sum())
    assert ended > 2
    np.testing.assert_equal(two.render(), one.render())
    processes = two.groups.processes
    two.close()
    assert not any(process.is_alive() for process in processes)


class Failing(gymnasium.Env[np.ndarray, np.ndarray]):
    """A world that tells something in its first step, and fails in the second."""

    observation_space = action_space = gymnasium.spaces.Box(-1, 1, (2,), np.float32)

    def __init__(self, number: int) -> None:
        self.number = number

    def reset(self, **_: object) -> tuple[np.ndarray, dict[str, object]]:
        self.steps = 0
        return np.zeros(2, np.float32), {"nested": {"number": self.number}} if self.number == 3 else {}

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, dict[str, object]]:
        self.steps += 1
        if self.steps == 2 and self.number == 1:
            raise InputError("world 1 failed")
        return action, float(self.number), False, False, {}


def test_what_one_world_tells_stands_at_its_place_and_its_error_arrives() -> None:
    worlds = SpreadVectorEnv([partial(Failing, number) for number in range(4)], processes=2)
    told = worlds.reset()[1]
    assert told["nested"]["number"].tolist() == [0, 0, 0, 3]
    assert told["_nested"].tolist() == told["nested"]["_number"].tolist() == [False, False, False, True]
    action = np.linspace(0, 1, 8, dtype=np.float32).reshape(4, 2)
    seen, reward, *_ = worlds.step(action)
    np.testing.assert_array_equal(seen, action)
    assert reward.tolist() == [0, 1, 2, 3]
    assert worlds.call("number") == (0, 1, 2, 3)
    with pytest.raises(InputError, match="world 1 failed"):
        worlds.step(action)
    worlds.close(terminate=True)


@pytest.mark.parametrize("processes", [0, 3, 5])
def test_groups_that_would_differ_are_refused(processes: int) -> None:
    with pytest.raises(InputError, match=f"4 worlds on {processes} processes"):
        SpreadVectorEnv([MAKE] * 4, processes=processes)


def test_seeds_for_other_worlds_are_refused() -> None:
    worlds = SpreadVectorEnv([partial(Failing, 0)] * 2, processes=1)
    with pytest.raises(InputError, match="3 seeds: give 2"):
        worlds.reset(seed=[1, 2, 3])
    worlds.close()
