"""A GPU against the processor, in one run: `python -m tests.benchmarks.gpu [cuda|torch]`.

It needs torch, NumPy, SciPy and ONNX Runtime, not the host. First the bounds: surfaces and pictures of the device
against those of NumPy. Then the times of simulated presses, of GelNet and of a training. `torch` runs the same batches
on the processor.
"""

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import sys
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

import numpy as np
import onnxruntime
import torch
from numpy.typing import NDArray

from gelnet.batches import NoGpuError, Ring, contact_pressures, device_of, name_of
from gelnet.export import to_onnx
from gelnet.pressed import SPACING_MM, Presses, Wanted
from gelnet.recipes import RECIPES
from gelnet.synthetic import Options, simulated_sensor, table_of_presses
from gelnet.table import Table
from gelnet.trainers import make_trainer
from gelnet.training import normal_error_deg, train
from sim_reference.camera import CameraResponse, digitise, exposure_for, linear_grey
from sim_reference.deformation import grid
from sim_reference.geometry import SensorGeometry
from sim_reference.imaging import ring_irradiance, ring_light
from sim_reference.objects import OBJECT_NAMES, object_height
from sim_reference.surface import GRID_SIZE, Surface, press_object, sample, untouched

GEOMETRY = SensorGeometry()
LIGHT = ring_light(GEOMETRY)
PIXELS = GEOMETRY.image_height_px * GEOMETRY.image_width_px
SEEDS = (0, 1, 2)


def drawn(count: int, seed: int) -> list[Wanted]:
    """Presses of all objects, no two of the same depth."""
    random = np.random.default_rng(seed)
    depths = random.permutation(np.linspace(0.2, 1.0, count)).tolist()
    places = random.uniform(-6, 6, (count, 2)).tolist()
    return [(OBJECT_NAMES[i % len(OBJECT_NAMES)], depths[i], *places[i]) for i in range(count)]


def reference(press: Wanted) -> tuple[Surface, NDArray[np.float32]]:
    """The surface and (H, W, 3) irradiance by NumPy."""
    name, depth, x, y = press
    surface = sample(press_object(name, depth, GEOMETRY), GEOMETRY, x, y).single_precision()
    return surface, ring_irradiance(surface, GEOMETRY, LIGHT)


def bounds(presses: Presses, count: int) -> None:
    """Print how far the device is from NumPy."""
    untouched_light = ring_irradiance(untouched(GEOMETRY), GEOMETRY, LIGHT)
    response = CameraResponse(exposure=exposure_for(untouched_light, CameraResponse(), 200.0))
    wanted, worst, changed = drawn(count, seed=1), np.zeros(4), 0
    for press, made in zip(wanted, presses.seen(wanted, LIGHT[None]), strict=True):
        surface, irradiance = reference(press)
        greys = [linear_grey(each, response).astype(np.float32) for each in (irradiance, made[0][0])]
        noisy = [digitise(grey, 1.0, np.random.default_rng(3)) for grey in greys]
        changed += int((noisy[0] != noisy[1]).sum())
        off = (1e3 * (made[1] - surface.depth_mm), made[2] - surface.gradient_map, made[3] ^ surface.contact,
               greys[0] - greys[1])  # fmt: skip
        worst = np.maximum(worst, [np.abs(each).max() for each in off])
    print(f"{count} presses of {len(OBJECT_NAMES)} objects against NumPy, at most: depth {worst[0]:.2g} um, slope "
          f"{worst[1]:.2g}, contact {worst[2]:.0f}, grey before noise {worst[3]:.2g}; with the same noise, rounded, "
          f"{changed} of {3 * PIXELS * count} values differ")  # fmt: skip


def time_presses(device: torch.device, by: str, cores: int) -> None:
    """Print milliseconds a press: NumPy, then the device by batches."""
    wanted = drawn(64 if by == "cuda" else 8, seed=2)
    alone = 1e3 * best(lambda: [reference(press) for press in wanted[:8]], 1) / 8
    with ProcessPoolExecutor(cores, get_context("spawn")) as pool:
        list(pool.map(reference, wanted[:1] * cores))
        every = 1e3 * best(lambda: list(pool.map(reference, wanted * 2)), 1) / len(wanted) / 2
    print(f"layer and light at 640 x 480, ms a press: NumPy, one core {alone:.0f}, {cores} cores {every:.1f}")
    at, ring = grid(GRID_SIZE, SPACING_MM), Ring(GEOMETRY, device)
    gaps = np.stack([-(object_height(name, at[None, :], at[:, None]) + deep) for name, deep, *_ in wanted])
    surfaces = [reference(press)[0] for press in wanted]
    for batch in (1, 8, 64):
        if batch > len(wanted):
            break
        layer = 1e3 * best(lambda n=batch: contact_pressures(gaps[:n], SPACING_MM, GEOMETRY, device)) / batch
        light = 1e3 * best(lambda n=batch: ring.irradiances(surfaces[:n], LIGHT[None])) / batch
        whole = 1e3 * best(lambda n=batch: list(Presses(GEOMETRY, by, n).seen(wanted[:n], LIGHT[None]))) / batch
        print(f"  {by}, batches of {batch}: {whole:.1f} (layer {layer:.2f}, light {light:.2f}, the rest on one core); "
              f"{alone / whole:.1f} x one core, {every / whole:.1f} x all; layer and light alone "
              f"{alone / (layer + light):.0f} x one core")  # fmt: skip


def best(function: Callable[[], object], times: int = 3) -> float:
    """Least seconds of some runs, the first one left out where there are more."""
    taken = []
    for _ in range(times):
        begun = time.perf_counter()
        function()
        if torch.cuda.is_available():
            torch.cuda.synchronize()
        taken.append(time.perf_counter() - begun)
    return min(taken)


def inference(learnt: Table, by: str) -> None:
    """Print milliseconds a frame of GelNet, and how far slopes are from ONNX Runtime's."""
    trainer = make_trainer(by, seed=0)
    trainer.begin(learnt.pixels, learnt.gradient, width=32, recipe=RECIPES["fast"])
    for start in range(0, min(len(learnt.pixels), 204800), 2048):
        trainer.step(learnt.pixels[start : start + 2048], learnt.gradient[start : start + 2048], 5e-3)
    pixels = np.resize(learnt.pixels, (PIXELS, learnt.pixels.shape[1]))
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads, options.log_severity_level = 1, 3
    session = onnxruntime.InferenceSession(to_onnx(trainer.parameters(), {}), options, ["CPUExecutionProvider"])
    onnx_s = best(lambda: session.run(["gradient"], {"pixels": pixels}))
    apart = np.abs(trainer.answer(pixels) - session.run(["gradient"], {"pixels": pixels})[0]).max()
    print(f"GelNet, ms a frame of {PIXELS} pixels: ONNX Runtime, one core {1e3 * onnx_s:.1f}; slopes differ by "
          f"{apart:.1e} at most")  # fmt: skip
    for batch in (1, 8, 64) if by == "cuda" else (1,):
        many = np.tile(pixels, (batch, 1))
        seconds = best(lambda many=many: trainer.answer(many)) / batch
        print(f"  {by}, batches of {batch}: {1e3 * seconds:.2f}, {onnx_s / seconds:.1f} x; from array to array")


def training(learnt: Table, test: Table, by: str, recipe: str) -> None:
    """Print last loss, error and seconds of each trainer over seeds."""
    print(f"recipe {recipe} on {len(learnt.rows)} rows:")
    for name in dict.fromkeys(("numpy", "torch", by)):
        losses, errors, seconds = [], [], []
        for seed in SEEDS:
            trainer = make_trainer(name, seed=seed)
            begun = time.perf_counter()
            losses.append(train(learnt, RECIPES[recipe], trainer, width=32).losses[-1])
            seconds.append(time.perf_counter() - begun)
            errors.append(normal_error_deg(trainer, test)["mean"])
        print(
            f"  {trainer.version}: {min(seconds):.1f} s; last loss {_each(losses)}; other presses {_each(errors)} deg"
        )
    torch.set_deterministic_debug_mode("default")


def _each(values: list[float]) -> str:
    return " ".join(f"{value:.4f}" for value in values)


def main(arguments: Sequence[str]) -> None:
    """Print everything; without a GPU say so."""
    by = arguments[0] if arguments else "cuda"
    try:
        device = device_of(by)
    except NoGpuError as error:
        print(f"{error}; `python -m tests.benchmarks.gpu torch` runs the batches on the processor")
        return
    begun, gpu = time.perf_counter(), by == "cuda"
    cores = len(os.sched_getaffinity(0))
    print(f"{name_of(device)}, NumPy {np.__version__}, {cores} cores")
    torch.set_num_threads(1)
    bounds(Presses(GEOMETRY, by, 16), 33 if gpu else 4)
    time_presses(device, by, cores)
    sensor, options = simulated_sensor(GEOMETRY, seed=0), Options(rows_per_press=5500)
    noise = sensor.response.noise_grey
    learnt, test = (
        table_of_presses(sensor, options, count=count, noise_grey=noise, seed=seed)
        for count, seed in ((24 if gpu else 4, 11), (6 if gpu else 2, 12))
    )
    inference(learnt, by)
    training(learnt, test, by, "thorough" if gpu else "fast")
    print(f"{time.perf_counter() - begun:.0f} s in all")


if __name__ == "__main__":
    main(sys.argv[1:])
