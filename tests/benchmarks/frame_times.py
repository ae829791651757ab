"""Time the frame path: `python -m tests.benchmarks.frame_times [--calibration BUNDLE] [--rounds N] [--threads N]`.

Its stages and forms, and against what is usual (PyTorch): all in one run on the same frames, in turn, so that a busy
machine slows all of them down. CPU is the processor time of the whole process: it also counts a second thread that a
linear-algebra library keeps busy. `--press IMAGE`, with `--untouched IMAGE` where that is not the gel of the bundle,
times a picture of a press too; `make bench` gives one.
"""

import argparse
import itertools
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import onnx
from numpy.typing import NDArray

from gellight.bundle.bundle import Bundle, load_bundle
from gellight.frame_path.pipeline import Form, Reconstructor
from gellight.frames.frames import CameraFrame
from gellight.frames.image_files import read_image
from gellight.photometric.lights_file import FILE_NAME as LIGHTS
from gellight.reconstruction.lens.lens_file import has_lens
from tests.helpers.analytic_surfaces import Surface, smooth_cap

_GREY_PER_SLOPE = np.array([[54.0, 0.0], [-27.0, 46.8], [-27.0, -46.8]])
_BALL_SHARE = 0.21
_STEEP_PX = 53
"""makes waves of 37 px, steep enough that one pixel in 28 goes through the network by itself"""
USUAL = "usual: PyTorch, 64-64-64"
"""the slopes alone, by a network of the usual width"""


@dataclass(frozen=True)
class Times:
    """The least over the rounds, ms."""

    cpu_ms: float
    wall_ms: float


@dataclass(frozen=True)
class FrameTimes:
    """The frame path on one scene in one size."""

    scene: str
    image_width_px: int
    image_height_px: int
    touched: float
    """share of the pixels in touched cells"""
    single: float
    """share of the pixels that the network was asked for one by one; 0 where NumPy computes"""
    computed_by: str
    stages: dict[str, Times]
    whole: Times
    others: dict[str, Times]
    """the other forms, and the usual network on rows of all pixels (difference, x and y stacked first)"""
    ratios: dict[str, float]
    """CPU of the others over that of the whole frame"""


def frame_times(
    bundle: Bundle,
    *,
    rounds: int = 15,
    threads: int = 1,
    press: NDArray[np.uint8] | None = None,
    untouched: NDArray[np.uint8] | None = None,
) -> list[FrameTimes]:
    """Time frames at rest, with 21 % of the view touched, with all of it, smooth and steep, and a picture of a press.

    The scenes are tinted by their slopes, as under three coloured lights. In the size of the bundle and in half of it
    along each axis, unless the bundle has a lens. threads: of the network. press: in the size of the bundle, or in any
    with a picture of the same gel untouched.
    """
    tasks = [(sized, scenes(sized)) for sized in ([bundle] if has_lens(bundle) else [bundle, halved(bundle)])]
    if press is not None:
        tasks.append((bundle if untouched is None else over(bundle, untouched), {"press": press}))
    times = []
    for sized, pictures in tasks:
        contest = _Contest(sized, threads)
        times += [contest.run(name, picture, rounds) for name, picture in pictures.items()]
    return times


def halved(bundle: Bundle) -> Bundle:
    """Return a bundle for every other pixel; good for times, not for depths."""
    return over(bundle, bundle.reference[::2, ::2])


def over(bundle: Bundle, reference: NDArray[Any]) -> Bundle:
    """Return a bundle with another (H, W, 3) reference image of any size; good for times, not for depths.

    Its network takes the picture's middle and corners for those of the bundle's: beyond what it learnt it bends more,
    and more pixels would be asked about one by one.
    """
    height, width = reference.shape[:2]
    size = {"image_width_px": width, "image_height_px": height}
    files = {name: content for name, content in bundle.files.items() if name != LIGHTS}  # which are of its own size
    shrink = bundle.image_shape[1] / width, bundle.image_shape[0] / height
    files[bundle.manifest.network] = _scaled_places(bundle.network, shrink)
    described = {**size, "light_by_depth": False}
    other = replace(bundle, manifest=bundle.manifest.model_copy(update=described), files=files)
    return other.with_reference(np.ascontiguousarray(reference, np.float32), frames=bundle.manifest.reference_frames)


def _scaled_places(network: bytes, factors: tuple[float, float]) -> bytes:
    """Return the network that multiplies x and y, the last of its five inputs, by the factors first."""
    model = onnx.load_from_string(network)
    layer = next(node for node in model.graph.node if node.op_type == "Gemm")
    first = next(weights for weights in model.graph.initializer if weights.name == layer.input[1])
    by_input = np.array([1, 1, 1, *factors], np.float32)
    if not any(option.name == "transB" and option.i for option in layer.attribute):
        by_input = by_input[:, None]
    scaled = onnx.numpy_helper.to_array(first) * by_input
    first.CopyFrom(onnx.numpy_helper.from_array(scaled, first.name))
    return model.SerializeToString()


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


def _timed(run: Callable[[], object]) -> tuple[float, float]:
    wall, cpu = time.perf_counter(), time.process_time()
    run()
    return time.process_time() - cpu, time.perf_counter() - wall


class _Contest:
    """Everything that is timed against each other, for images of one size."""

    def __init__(self, bundle: Bundle, threads: int) -> None:
        self._by_wall, self._by_cpu = (
            Reconstructor(bundle, threads=threads, clock=clock) for clock in (time.perf_counter, time.process_time)
        )
        self._forms = {
            f"form {form.value}": Reconstructor(bundle, threads=threads, form=form)
            for form in (Form.CELLS, Form.PIXELS)
        }
        self._usual = usual_network(threads)

    def run(self, scene: str, image: NDArray[np.uint8], rounds: int) -> FrameTimes:
        frame = CameraFrame(image=image, time_s=0.0, sequence=0)
        result = self._by_wall.reconstruct(frame)
        runs: dict[str, Callable[[], object]] = {"": lambda: self._by_wall.reconstruct(frame)}
        runs |= {name: lambda form=form: form.reconstruct(frame) for name, form in self._forms.items()}  # type: ignore[misc]
        runs[USUAL] = lambda: self._usual(result.difference)
        if (measures := result.measures) is not None:
            runs["confidence, beside"] = lambda: measures.confidence(image, result.gradient_map)
            runs["force, beside"] = lambda: measures.force(result.depth_mm)
        found = _in_turn(runs, rounds)
        whole = found.pop("")
        stages = self._stages(frame, rounds)
        height, width = image.shape[:2]
        return FrameTimes(
            scene=scene,
            image_width_px=width,
            image_height_px=height,
            touched=float(self._by_wall.touched(result.difference).mean()),
            single=self._by_wall.network_rows.pixels / (height * width),
            computed_by=str(self._by_wall.status()["computed_by"]),
            stages=stages,
            whole=whole,
            others=found,
            ratios={name: round(times.cpu_ms / whole.cpu_ms, 2) for name, times in found.items()},
        )

    def _stages(self, frame: CameraFrame, rounds: int) -> dict[str, Times]:
        cpu, wall = (
            [reconstructor.reconstruct(frame).stage_seconds for _ in range(rounds)]
            for reconstructor in (self._by_cpu, self._by_wall)
        )
        return {
            stage: Times(*(round(min(seconds[stage] for seconds in times) * 1e3, 3) for times in (cpu, wall)))
            for stage in cpu[0]
        }


def _in_turn(runs: dict[str, Callable[[], object]], rounds: int) -> dict[str, Times]:
    """Run all of them once in each round, and once before."""
    for run in runs.values():
        run()
    seconds = {name: np.empty((rounds, 2)) for name in runs}
    for turn in range(rounds):
        for name, run in runs.items():
            seconds[name][turn] = _timed(run)
    least = {name: times.min(axis=0) * 1e3 for name, times in seconds.items()}
    return {name: Times(cpu_ms=round(float(ms[0]), 3), wall_ms=round(float(ms[1]), 3)) for name, ms in least.items()}


def usual_network(threads: int) -> Callable[[NDArray[np.float32]], object]:
    """Return what the usual stacks do: the same rows through 5-64-64-64-2 in PyTorch."""
    import torch  # heavy, and nothing for those who want the scenes alone

    torch.set_num_threads(threads)
    layers = [part for a, b in itertools.pairwise((5, 64, 64, 64)) for part in (torch.nn.Linear(a, b), torch.nn.ReLU())]
    network = torch.nn.Sequential(*layers, torch.nn.Linear(64, 2))

    def run(difference: NDArray[np.float32]) -> object:
        with torch.no_grad():
            return network(torch.from_numpy(rows_of(difference))).numpy()

    return run


def rows_of(difference: NDArray[np.float32]) -> NDArray[np.float32]:
    """(H * W, 5) of all pixels: colour, x, y."""
    y, x = np.indices(difference.shape[:2], dtype=np.float32)
    return np.concatenate([difference.reshape(-1, 3), x.reshape(-1, 1), y.reshape(-1, 1)], axis=1)


def table(times: Sequence[FrameTimes]) -> str:
    lines = []
    for t in times:
        size = f"{t.image_width_px} x {t.image_height_px}"
        lines.append(
            f"{t.scene}, {size} px, {t.touched:.1%} touched, {t.single:.1%} pixel by pixel, {t.computed_by}; "
            "ms: CPU, wall"
        )
        for name, ms in [*t.stages.items(), ("whole frame", t.whole), *t.others.items()]:
            ratio = f"{t.ratios[name]:9.1f} x the whole frame" if name in t.ratios else ""
            lines.append(f"  {name:26}{ms.cpu_ms:9.2f}{ms.wall_ms:9.2f}{ratio}")
    return "\n".join(lines)


def picture(path: str) -> NDArray[np.uint8]:
    return read_image(Path(path))


def main(words: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser("python -m tests.benchmarks.frame_times")
    parser.add_argument("--calibration", default="synthetic", help="bundle whose network is timed")
    parser.add_argument("--rounds", type=int, default=15, help="frames and plain runs, in turn")
    parser.add_argument("--threads", type=int, default=1, help="of the networks")
    parser.add_argument("--press", type=picture, help="picture of a press, timed too")
    parser.add_argument("--untouched", type=picture, help="the same gel untouched, of any size")
    given = parser.parse_args(words)
    bundle = load_bundle(given.calibration)
    found = frame_times(
        bundle, rounds=given.rounds, threads=given.threads, press=given.press, untouched=given.untouched
    )
    print(table(found))


if __name__ == "__main__":
    main()
