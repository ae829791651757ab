"""Episodes as WebDataset shards, a folder each: `python episodes.py OUT 100`; it goes on where it was interrupted."""

import sys
from pathlib import Path

import gymnasium

from gellight.lab.report.pictures import encode_png
from gellight.recording.shard_files import write_shards
from gellight_touch.episode import tactile_frames

TASK = "gellight_touch.environments:gellight/SlideToEdge-v0"


def episode(folder: Path, seed: int) -> str:
    """Slide over a part under random actions, and write what was felt; the same seed gives the same bytes."""
    env = gymnasium.make(TASK).unwrapped
    env.reset(seed=seed)
    env.action_space.seed(seed)
    touches, actions, ended = [], [], False
    while not ended:
        touches.append(env.observing.felt)
        actions.append(env.action_space.sample())
        _, _, terminated, truncated, _ = env.step(actions[-1])
        ended = terminated or truncated
    frames = tactile_frames(env.observing.sensor, touches, fps=10)
    count = write_shards(frames, folder, task="slide to an edge", png=encode_png, actions=actions)
    return f"{folder.name}: {count} frames"


if __name__ == "__main__":
    out, count = Path(sys.argv[1]).resolve(), int(sys.argv[2])
    out.mkdir(parents=True, exist_ok=True)
    folders = [out / f"{seed:06}" for seed in range(count)]
    print(*(episode(folder, seed) for seed, folder in enumerate(folders) if not folder.exists()), sep="\n")
