"""Episodes as HDF5 files: `python episodes.py OUT 100`; it goes on where it was interrupted."""

import sys
from pathlib import Path

import gymnasium

from gellight.recording.array_files import write_arrays
from gellight_touch.episode import tactile_frames

TASK = "gellight_touch.environments:gellight/SlideToEdge-v0"


def episode(file: Path, seed: int) -> str:
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
    count = write_arrays(frames, file, task="slide to an edge", actions=actions)
    return f"{file.name}: {count} frames"


if __name__ == "__main__":
    out, count = Path(sys.argv[1]).resolve(), int(sys.argv[2])
    out.mkdir(parents=True, exist_ok=True)
    files = [out / f"{seed:06}.h5" for seed in range(count)]
    print(*(episode(file, seed) for seed, file in enumerate(files) if not file.exists()), sep="\n")
