"""Learn by PPO to tell objects apart, with touch and without; give a file name for the curve: `learn.py learnt.svg`.

`pip install . ./host/gellight_touch stable-baselines3`, from a clone. Without touch the agent knows only that something
touches. Judged on 200 presses that nobody learnt from.
"""

import argparse
from functools import partial
from pathlib import Path

import gymnasium
import matplotlib
import numpy as np
import torch
from matplotlib import pyplot
from stable_baselines3 import PPO
from stable_baselines3.common.env_util import make_vec_env

from gellight_touch.environments import PressAndTell

BLOCK = 4096
JUDGED = range(10_000, 10_200)
"""seeds of the presses that judge"""
MOST_PRESSES = 5


def objects(touch: bool) -> gymnasium.Env:
    """Return the task, with its observation as a row of numbers."""
    env = gymnasium.wrappers.FlattenObservation(PressAndTell(observe=("depth",) if touch else ("contact",)))
    scale = 4.0 if touch else 1.0  # depth is .5 mm at most: networks like numbers near 1
    return gymnasium.wrappers.TransformObservation(env, lambda seen: np.float32(scale * seen), env.observation_space)


def told_right(model: PPO, touch: bool) -> float:
    """Return in what share of the presses the object is told."""
    env, right = objects(touch), 0
    for seed in JUDGED:
        seen, _ = env.reset(seed=seed)
        for _ in range(MOST_PRESSES):
            action, _ = model.predict(seen, deterministic=True)
            seen, reward, done, _, _ = env.step(int(action))
            if done:
                right += reward == 1
                break
    return right / len(JUDGED)


def learn(touch: bool, seed: int, presses: int) -> tuple[list[float], list[float]]:
    """Return the curve: thousands of presses, and the share that is told right after each block of them."""
    worlds = make_vec_env(partial(objects, touch), n_envs=16, seed=seed)
    model = PPO("MlpPolicy", worlds, n_steps=64, batch_size=256, n_epochs=8, learning_rate=7e-4, ent_coef=0.02,
                gamma=0.9, policy_kwargs={"net_arch": [128, 128]}, seed=seed)  # fmt: skip
    name = f"{'with touch' if touch else 'without'}, seed {seed}"
    seen, shares = [0.0], [told_right(model, touch)]
    while model.num_timesteps < presses:
        model.learn(min(BLOCK, presses), reset_num_timesteps=False)
        seen.append(model.num_timesteps / 1000)
        shares.append(told_right(model, touch))
        print(f"{name}: {model.num_timesteps} presses, {shares[-1]:.0%} right", flush=True)
    return seen, shares


parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("curve", nargs="?", type=Path)
parser.add_argument("--seeds", type=int, default=3)
parser.add_argument("--presses", type=int, default=24_576)
options = parser.parse_args()
torch.set_num_threads(1)
matplotlib.use("svg")
for touch in (True, False):
    for seed in range(options.seeds):
        seen, shares = learn(touch, seed, options.presses)
        name, line = ("with touch", "-") if touch else ("without", "--")
        pyplot.plot(seen, shares, line, color=f"C{seed}", label=f"{name}, seed {seed}")
if options.curve:
    pyplot.axhline(1 / 11, color="grey", linestyle=":", label="guess")
    pyplot.title("Which of eleven objects is pressed")
    pyplot.xlabel("thousand presses learnt from")
    pyplot.ylabel("told right")
    pyplot.legend()
    pyplot.savefig(options.curve)
