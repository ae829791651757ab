"""Time the frame path: `python -m tests.benchmarks.frame_times [--calibration BUNDLE] [--rounds N]`, or `make bench`.

Stages, whole frames and the other forms, all in one run on the same frames, in turn, so that a busy machine slows all
of them down: the least processor time of the whole process over the rounds.
"""

import argparse
import time
from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

from gellight.bundle.bundle import Bundle, load_bundle
from gellight.frame_path.pipeline import Reconstructor
from gellight.frames.frames import CameraFrame
from tests.helpers.analytic_surfaces import Surface, smooth_cap

_GREY_PER_SLOPE = np.array([[54.0, 0.0], [-27.0, 46.8], [-27.0, -46.8]])
_BALL_SHARE = 0.21
_STEEP_PX = 53
"""makes waves of 37 px, steep enough that one pixel in 28 goes through the network by itself"""


def scenes(bundle: Bundle) -> dict[str, NDArray[np.uint8]]:
    """Return pictures that the sensor of a bundle could take, with its noise."""
    height, width = shape = bundle.image_shape
    # The mask is about 20 px wider than the cap.
    diameter = max(8.0, 2 * np.sqrt(_BALL_SHARE * height * width / np.pi) - 20)
    ball = smooth_cap(shape, diameter, (0.03 * width, 0.02 * height), height=diameter / 8)
    y, x = np.indices(shape) / np.array([height, width]).reshape(2, 1, 1)
    smooth, steep = (
        Surface(x, size * np.stack([np.cos(n * (9 * x + 5 * y)), np.sin(n * (4 * x - 7 * y))], axis=2))
        for n, size in ((1, 0.4), (width / _STEEP_PX, 0.8))
    )
    flat = Surface(x, np.zeros((*shape, 2)))
    named = {"at rest": flat, "ball": ball, "all touched, smooth": smooth, "all touched, steep": steep}
    return {name: _photograph(bundle, surface) for name, surface in named.items()}


def _photograph(bundle: Bundle, surface: Surface) -> NDArray[np.uint8]:
    noise = np.random.default_rng(0).normal(0, bundle.manifest.noise_grey, bundle.reference.shape)
    image = bundle.reference + surface.gradient_map @ _GREY_PER_SLOPE.T + noise
    return np.asarray(np.clip(np.round(image), 0, 255), np.uint8)


def least_ms(runs: dict[str, Callable[[], object]], rounds: int) -> dict[str, float]:
    """Return the least processor time of each, ms; all of them once in each round, and once before."""
    for run in runs.values():
        run()
    times: dict[str, list[float]] = {name: [] for name in runs}
    for _ in range(rounds):
        for name, run in runs.items():
            begun = time.process_time()
            run()
            times[name].append(time.process_time() - begun)
    return {name: min(spent) * 1e3 for name, spent in times.items()}


def lines(bundle: Bundle, scene: str, image: NDArray[np.uint8], rounds: int) -> Iterator[str]:
    """Yield the table of one scene."""
    path, plain = Reconstructor(bundle), Reconstructor(bundle, native=False)
    frame = CameraFrame(image=image, time_s=0.0, sequence=0)
    result = path.reconstruct(frame)
    runs: dict[str, Callable[[], object]] = {"whole frame": lambda: path.reconstruct(frame)}
    runs["NumPy, every touched pixel"] = lambda: plain.reconstruct(frame)
    if (measures := result.measures) is not None:
        runs["confidence, beside"] = lambda: measures.confidence(image, result.gradient_map)
        runs["force, beside"] = lambda: measures.force(result.depth_mm)
    found = least_ms(runs, rounds)
    stages = [path.reconstruct(frame).stage_seconds for _ in range(rounds)]
    touched = float(path.network.touched(result.difference).mean())
    single = path.network_rows.pixels / image[..., 0].size
    yield (
        f"{scene}, {image.shape[1]} x {image.shape[0]} px, {touched:.1%} touched, {single:.1%} pixel by pixel, "
        f"{path.status()['computed_by']}; ms of processor, and of the whole frame"
    )
    for stage in stages[0]:
        yield f"  {stage:26}{min(one[stage] for one in stages) * 1e3:9.2f}"
    for name, ms in found.items():
        yield f"  {name:26}{ms:9.2f}{ms / found['whole frame']:9.1f} x"


def main() -> None:
    parser = argparse.ArgumentParser("python -m tests.benchmarks.frame_times")
    parser.add_argument("--calibration", default="synthetic", help="bundle whose network is timed")
    parser.add_argument("--rounds", type=int, default=15, help="frames and plain runs, in turn")
    given = parser.parse_args()
    bundle = load_bundle(given.calibration)
    for scene, image in scenes(bundle).items():
        print("\n".join(lines(bundle, scene, image, given.rounds)), flush=True)


if __name__ == "__main__":
    main()
