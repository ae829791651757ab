"""Rules that do the tasks of `gellight_touch.environments` by touch, and rules that do their best without.

The rules without touch know all that the others know beforehand: where edge and slot are likely to be.
"""

from collections.abc import Callable
from typing import Any

import gymnasium
import numpy as np

from gellight_touch.environments import edge, peg

Rule = Callable[[dict[str, Any]], np.ndarray]
"""what to do after an observation; made anew for every episode"""
EDGE_SEEN = 0.1
"""slope beyond which the depth has an edge: a flat part has none, the edge 0.28"""
VIEW_MM = 11.0


def places_mm(count: int) -> np.ndarray:
    """Return where the points of a depth map lie that covers the grid, 72 x 72 points over 72 mm from its border on."""
    return ((np.arange(count) + 0.5) / count - 0.5) * 72.0 - 0.5


def edge_by_touch() -> Rule:
    def rule(seen: dict[str, Any]) -> np.ndarray:
        depth = seen["depth"]
        x, y = np.meshgrid(*[places_mm(len(depth))] * 2)
        down, right = np.gradient(depth)
        slope = np.where(np.hypot(x, y) < VIEW_MM, np.hypot(right, down), 0)
        if slope.max() < EDGE_SEEN:
            return np.array([1.0, 0.0, 0.0])
        weight = slope**2 / (slope**2).sum()
        normal = -np.array([(weight * right).sum(), (weight * down).sum()])
        normal /= np.linalg.norm(normal)
        away = float(np.array([(weight * x).sum(), (weight * y).sum()]) @ normal)
        if abs(away) < 0.25:
            return np.array([0.0, 0.0, 1.0])
        return np.array([*np.clip(away / edge.FASTEST_MM, -1, 1) * normal, 0.0])

    return rule


def edge_without() -> Rule:
    """Slide to the middle of where the edge may be."""
    left = iter([np.array([1.0, 0.0, 0.0])] * round(sum(edge.AWAY_MM) / 2 / edge.FASTEST_MM))
    return lambda seen: next(left, np.array([0.0, 0.0, 1.0]))


def peg_by_touch() -> Rule:
    """Straighten the peg over the slot and push; on the plate beside it, the gels tell to which side the peg tips."""
    tilted: list[float] = []
    wanted: list[np.ndarray] = []

    def rule(seen: dict[str, Any]) -> np.ndarray:
        aside_mm, tilt = held(seen["depth"])
        hand, pushed = seen["hand"][:2], seen["hand"][2] < peg.ABOVE_MM / 2
        if not wanted:
            wanted.append(hand - [aside_mm, tilt])
        elif pushed:
            side = np.sign(tilt - tilted[-1])
            wanted.append(wanted[-1] + [side * peg.SLOT_MM / 2, 0.0])
        way = (wanted[-1] - hand) / [peg.FARTHEST_MM, peg.FARTHEST_RAD]
        if not pushed and np.abs(way).max() < 0.01:
            tilted.append(tilt)
            return np.array([0.0, 0.0, 1.0])
        return np.array([*np.clip(way, -1, 1), 0.0])

    return rule


def held(depth: np.ndarray) -> tuple[float, float]:
    """Return how the peg lies in the gel: aside, mm, and its tilt as MuJoCo's joint has it."""
    at = places_mm(len(depth))
    inner = np.abs(at) < 12
    weight = np.clip(depth[inner], 0, None) ** 2
    slope, aside_mm = np.polyfit(at[inner], weight @ at / weight.sum(axis=1), 1)
    return float(aside_mm), float(-np.arctan(slope))


def peg_without() -> Rule:
    """Push at the likely place, then beside it to both sides."""
    places = iter([0.0, peg.SLOT_MM, -peg.SLOT_MM, 2 * peg.SLOT_MM])
    wanted = [next(places)]

    def rule(seen: dict[str, Any]) -> np.ndarray:
        pushed = seen["hand"][2] < peg.ABOVE_MM / 2
        if pushed:
            wanted.append(next(places))
        way = wanted[-1] - seen["hand"][0]
        push = not pushed and abs(way) < 0.01
        return np.array([0.0 if push else np.clip(way / peg.FARTHEST_MM, -1, 1), 0.0, float(push)])

    return rule


TASKS = {
    "SlideToEdge": (edge.SlideToEdge, edge_by_touch, edge_without),
    "InsertPeg": (peg.InsertPeg, peg_by_touch, peg_without),
}


def does(env: gymnasium.Env[Any, Any], rule: Rule, seed: int) -> bool:
    """Play an episode; return whether it ended with the reward of 1."""
    seen, _ = env.reset(seed=seed)
    while True:
        seen, reward, done, cut, _ = env.step(rule(seen))
        if done or cut:
            return bool(reward == 1.0)


def share(name: str, *, touch: bool, seeds: int = 50) -> float:
    """Return in what share of the episodes a rule does the task."""
    make, with_touch, without = TASKS[name]
    env = make()
    return float(np.mean([does(env, with_touch() if touch else without(), seed) for seed in range(seeds)]))
