"""Measure what the README states: the time of the frame path and the depth scale of the integrator."""

import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from statistics import median

import numpy as np
import onnxruntime
from numpy.typing import NDArray

from gellight.bundle.bundle import Bundle
from gellight.evaluation.analytic_surfaces import Surface, fitted_scale, gaussian, plane, sharp_cap, smooth_cap
from gellight.evaluation.simulated_presses import Figures
from gellight.frames.frames import CameraFrame, TactileFrame
from gellight.reconstruction.integration import integrate
from gellight.reconstruction.pipeline import Reconstructor

_GREY_PER_SLOPE = np.array([[90.0, 0.0], [-45.0, 78.0], [-45.0, -78.0]])
_SHAPES = ((240, 320), (480, 640))
_SIZES_PX = (5, 10, 20, 40, 60)
_POSITIONS = 16


@dataclass(frozen=True)
class Times:
    """Wall time over the rounds, ms."""

    minimum_ms: float
    median_ms: float


@dataclass(frozen=True)
class FrameTimes:
    """The frame path against one plain run of the network, both in the same minutes."""

    scene: str
    image_width_px: int
    image_height_px: int
    touched: float
    """share of the pixels that went through the network"""
    stages: dict[str, Times]
    whole: Times
    plain: Times
    """rows of all pixels stacked, one batch through ONNX Runtime: the slopes alone"""
    plain_over_slopes: float
    """median of plain over median of mask and gradient stage"""
    plain_over_whole: float
    """median of plain over median of the whole frame path"""


@dataclass(frozen=True)
class DepthScale:
    """What becomes of the height of one analytic surface under `integrate`, float32."""

    surface: str
    size_px: float
    place: str
    image_width_px: int
    image_height_px: int
    scale: float
    """best-fitting factor, 1 is right; the mean over the positions"""
    scale_spread: float
    """standard deviation over sub-pixel positions"""
    largest_error: float
    """of any pixel, relative to the height of the surface"""


def frame_times(bundle: Bundle, *, rounds: int = 15, threads: int = 1) -> list[FrameTimes]:
    """Time the frame path with 15 % of the view and with the whole view touched, alternating with the plain run.

    The scenes are tinted by their slopes, as under three coloured lights; the time depends on the touched share alone.
    """
    reconstructor = Reconstructor(bundle, threads=threads)
    plain = _plain_run(bundle, threads)
    return [_measure(name, reconstructor, plain, frame, rounds) for name, frame in _scenes(bundle.reference).items()]


def depth_scales() -> list[DepthScale]:
    """Integrate Gaussians (size: width at half height), smooth and sharp caps (size: diameter) and a plane."""
    found = []
    for shape in _SHAPES:
        for size in _SIZES_PX:
            for place in ("middle", "border"):
                for name, make in _SURFACES.items():
                    found.append(_depth_scale(name, make, size, place, shape))
        found.append(_compared("plane", max(shape), "everywhere", shape, [plane(shape, 0.3, -0.2)]))
    return found


def as_rows(results: Sequence[FrameTimes | DepthScale | Figures]) -> list[dict[str, object]]:
    """Turn results into plain dictionaries, for JSON."""
    return [asdict(result) for result in results]


def _scenes(reference: NDArray[np.float32]) -> dict[str, CameraFrame]:
    height, width = shape = reference.shape[:2]
    # The mask is about 20 px wider than the cap.
    diameter = 2 * np.sqrt(0.15 * height * width / np.pi) - 20
    pressed = smooth_cap(shape, diameter, (0.03 * width, 0.02 * height), height=diameter / 8)
    y, x = np.indices(shape) / np.array([height, width]).reshape(2, 1, 1)
    waves = Surface(x, 0.4 * np.stack([np.cos(9 * x + 5 * y), np.sin(4 * x - 7 * y)], axis=2))
    return {"15 % touched": _photograph(reference, pressed), "all touched": _photograph(reference, waves)}


def _photograph(reference: NDArray[np.float32], surface: Surface) -> CameraFrame:
    image = reference + surface.gradient_map @ _GREY_PER_SLOPE.T
    return CameraFrame(image=np.clip(np.round(image), 0, 255).astype(np.uint8), time_s=0.0, sequence=0)


def _plain_run(bundle: Bundle, threads: int) -> Callable[[NDArray[np.float32]], object]:
    """What is done without this pipeline: stack difference, x and y of all pixels, run them as one batch."""
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = threads
    session = onnxruntime.InferenceSession(bundle.network, options, providers=["CPUExecutionProvider"])
    rows, columns = np.indices(bundle.image_shape, dtype=np.float32)

    def run(difference: NDArray[np.float32]) -> object:
        pixels = np.concatenate([difference.reshape(-1, 3), columns.reshape(-1, 1), rows.reshape(-1, 1)], axis=1)
        return session.run(None, {"pixels": pixels})

    return run


def _measure(
    scene: str,
    reconstructor: Reconstructor,
    plain: Callable[[NDArray[np.float32]], object],
    frame: CameraFrame,
    rounds: int,
) -> FrameTimes:
    result: TactileFrame = reconstructor.reconstruct(frame)
    plain(result.difference)
    stages: dict[str, list[float]] = {stage: [] for stage in result.stage_seconds}
    whole, single = [], []
    for _ in range(rounds):
        start = time.perf_counter()
        result = reconstructor.reconstruct(frame)
        whole.append(time.perf_counter() - start)
        for stage, seconds in result.stage_seconds.items():
            stages[stage].append(seconds)
        start = time.perf_counter()
        plain(result.difference)
        single.append(time.perf_counter() - start)
    slopes = [mask + gradient for mask, gradient in zip(stages["mask"], stages["gradient"], strict=True)]
    height, width = result.depth_mm.shape
    return FrameTimes(
        scene=scene,
        image_width_px=width,
        image_height_px=height,
        touched=float(reconstructor.touched(result.difference).mean()),
        stages={stage: _times(seconds) for stage, seconds in stages.items()},
        whole=_times(whole),
        plain=_times(single),
        plain_over_slopes=median(single) / median(slopes),
        plain_over_whole=median(single) / median(whole),
    )


def _times(seconds: list[float]) -> Times:
    return Times(round(min(seconds) * 1e3, 3), round(median(seconds) * 1e3, 3))


Maker = Callable[[tuple[int, int], float, tuple[float, float]], Surface]
_SURFACES: dict[str, Maker] = {
    "gaussian": lambda shape, size, centre: gaussian(shape, size / np.sqrt(8 * np.log(2)), centre),
    "smooth cap": smooth_cap,
    "sharp cap": sharp_cap,
}


def _depth_scale(name: str, make: Maker, size: float, place: str, shape: tuple[int, int]) -> DepthScale:
    """Average over sub-pixel positions: many for the sharp rim, which falls between other samples at each."""
    rng = np.random.default_rng(0)
    middle = 0.0 if place == "middle" else shape[1] / 2 - 0.2 * size
    count = _POSITIONS if name == "sharp cap" else 4
    made = [make(shape, size, (middle + x, y)) for x, y in rng.uniform(-0.5, 0.5, (count, 2))]
    return _compared(name, size, place, shape, made)


def _compared(name: str, size: float, place: str, shape: tuple[int, int], surfaces: list[Surface]) -> DepthScale:
    scales, errors = [], []
    for surface in surfaces:
        depth = integrate(surface.gradient_map.astype(np.float32), 1.0)
        scales.append(fitted_scale(depth, surface.depth))
        error = depth - (surface.depth - np.median(surface.depth))
        errors.append(float(np.abs(error).max() / np.ptp(surface.depth)))
    return DepthScale(
        surface=name,
        size_px=size,
        place=place,
        image_width_px=shape[1],
        image_height_px=shape[0],
        scale=float(np.mean(scales)),
        scale_spread=float(np.std(scales)),
        largest_error=max(errors),
    )
