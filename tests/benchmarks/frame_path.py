"""The frame path against the network as the usual stacks run it: `python -m tests.benchmarks.frame_path`.

PyTorch, 5-64-64-64-2, on the difference image and the position of every pixel, stacked by NumPy; slopes alone, without
depth, in turn with whole frames on the same pictures, one thread each; least CPU time of the rounds.
"""

import itertools
import time
from collections.abc import Callable
from functools import partial

import numpy as np
import torch

from gellight.bundle.bundle import load_bundle
from gellight.frames.frames import CameraFrame
from gellight.lab.evaluation.frame_bench import halved, scenes
from gellight.reconstruction.pipeline import Reconstructor

ROUNDS = 9


def usual_stack(reference: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
    height, width = reference.shape[:2]
    sizes = (5, 64, 64, 64)
    layers = [part for a, b in itertools.pairwise(sizes) for part in (torch.nn.Linear(a, b), torch.nn.ReLU())]
    network = torch.nn.Sequential(*layers, torch.nn.Linear(64, 2))

    def run(image: np.ndarray) -> np.ndarray:
        difference = image.astype(np.float32) - reference
        x, y = np.meshgrid(np.arange(width, dtype=np.float32), np.arange(height, dtype=np.float32))
        rows = np.concatenate([difference.reshape(-1, 3), x.reshape(-1, 1), y.reshape(-1, 1)], axis=1)
        with torch.no_grad():
            return network(torch.from_numpy(rows)).numpy().reshape(height, width, 2)

    return run


def cpu_ms(run: Callable[[], object]) -> float:
    start = time.process_time()
    run()
    return (time.process_time() - start) * 1e3


def compare(ours: Callable[[], object], theirs: Callable[[], object]) -> str:
    times = [(cpu_ms(ours), cpu_ms(theirs)) for _ in range(ROUNDS)]
    frame, slopes = np.min(times, axis=0)
    return f"frame {frame:7.2f} ms, slopes by PyTorch {slopes:7.2f} ms: {slopes / frame:.1f} x"


def main() -> None:
    torch.set_num_threads(1)
    bundle = load_bundle("synthetic")
    for sized in (bundle, halved(bundle)):
        reconstructor, usual = Reconstructor(sized), usual_stack(sized.reference)
        height, width = sized.image_shape
        for name, image in scenes(sized).items():
            frame = CameraFrame(image=image, time_s=0.0, sequence=0)
            found = compare(partial(reconstructor.reconstruct, frame), partial(usual, image))
            print(f"{width} x {height}, {name:20} {found}", flush=True)


if __name__ == "__main__":
    main()
