"""Many worlds on a few processes.

Gymnasium's AsyncVectorEnv gives each world a process of its own: sixteen on two cores throw each other out of the
cache, and each sends its own messages. Here each process steps a group of worlds, one after the other.
"""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import AsyncVectorEnv, AutoresetMode, SyncVectorEnv, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from gellight.base.errors import InputError

Array = NDArray[Any]
Tree = Any
"""an array, or a dictionary or tuple of trees, as Gymnasium's spaces are"""
TOLD = "worlds"


class SpreadVectorEnv(VectorEnv[Tree, Tree, Array]):
    """Steps as Gymnasium's SyncVectorEnv does, with the same results; an episode that ended begins anew next step."""

    def __init__(self, env_fns: Sequence[Callable[[], gymnasium.Env[Any, Any]]], *, processes: int) -> None:
        """Start the processes; env_fns make one world each. Raises InputError where the groups would not be equal."""
        count = len(env_fns)
        if not 1 <= processes <= count or count % processes:
            raise InputError(f"{count} worlds on {processes} processes: give as many worlds to each, one at least")
        size = count // processes
        parts = [tuple(env_fns[begin : begin + size]) for begin in range(0, count, size)]
        groups: list[Any] = [partial(_Group, part) for part in parts]  # which answer as environments do
        self.groups = AsyncVectorEnv(groups, autoreset_mode=AutoresetMode.DISABLED)
        self.num_envs, self._shape = count, (processes, size)
        self.metadata = {**self.groups.metadata, "autoreset_mode": AutoresetMode.NEXT_STEP}
        self.render_mode = self.groups.render_mode
        self.single_observation_space, self.single_action_space = (
            self.groups.get_attr(f"single_{kind}_space")[0] for kind in ("observation", "action")
        )
        self.observation_space, self.action_space = (
            batch_space(space, count) for space in (self.single_observation_space, self.single_action_space)
        )

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Tree, dict[str, Any]]:
        """Begin an episode in each world; seed: of the first world and so on upwards, or one for each."""
        first = range(seed, seed + self.num_envs) if isinstance(seed, int) else seed or [None] * self.num_envs
        if len(first) != self.num_envs:
            raise InputError(f"{len(first)} seeds: give {self.num_envs}, or one number")
        size = self._shape[1]
        seeds: list[Any] = [list(first[begin : begin + size]) for begin in range(0, self.num_envs, size)]
        seen, told = self.groups.reset(seed=seeds, options=options)
        return self._flat(seen), self._together(told)

    def step(self, actions: Tree) -> tuple[Tree, Array, Array, Array, dict[str, Any]]:
        """Take a step in each world."""
        grouped = _each(actions, lambda one: np.reshape(one, (*self._shape, *np.shape(one)[1:])))
        *results, told = self.groups.step(grouped)
        seen, reward, terminated, truncated = (self._flat(one) for one in results)
        return seen, reward, terminated, truncated, self._together(told)

    def render(self) -> tuple[Any, ...]:
        """Return the picture of each world."""
        return self.call("render")

    def call(self, name: str, *args: Any, **kwargs: Any) -> tuple[Any, ...]:
        """Return what a method or a property of each world gives."""
        return tuple(one for group in self.groups.call("call", name, *args, **kwargs) for one in group)

    def close_extras(self, **kwargs: Any) -> None:
        """End the processes."""
        self.groups.close(**kwargs)

    def _flat(self, tree: Tree) -> Tree:
        return _each(tree, lambda one: one.reshape(self.num_envs, *one.shape[2:]))

    def _together(self, told: dict[str, Any]) -> dict[str, Any]:
        return _concatenated([group for (group,) in told[TOLD]])


class _Group(SyncVectorEnv):
    """The worlds of a process, as one environment whose `info` is handed on whole."""

    def __init__(self, env_fns: Sequence[Callable[[], gymnasium.Env[Any, Any]]]) -> None:
        super().__init__(env_fns, copy=False)

    def reset(self, **kwargs: Any) -> Any:
        seen, told = super().reset(**kwargs)
        return seen, {TOLD: (told,)}

    def step(self, actions: Tree) -> Any:
        *results, told = super().step(actions)
        return *results, {TOLD: (told,)}

    def get_wrapper_attr(self, name: str) -> Any:
        return getattr(self, name)


def _each(tree: Tree, change: Callable[[Array], Array]) -> Tree:
    """Change each array of a tree."""
    if isinstance(tree, Mapping):
        return {key: _each(one, change) for key, one in tree.items()}
    return tuple(_each(one, change) for one in tree) if isinstance(tree, tuple) else change(tree)


def _concatenated(told: list[dict[str, Any]]) -> dict[str, Any]:
    """Join what groups tell; a group where no world told something gives zeros, and False in its mask."""
    joined: dict[str, Any] = {}
    for key in {key: None for group in told for key in group}:
        parts = [group.get(key) for group in told]
        known = next(part for part in parts if part is not None)
        if isinstance(known, dict):
            joined[key] = _concatenated([part or {} for part in parts])
        else:
            joined[key] = np.concatenate([np.zeros_like(known) if part is None else part for part in parts])
    return joined
